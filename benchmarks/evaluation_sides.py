"""One evaluation of a checkpoint, by our engine or by LeRobot's, in a process of its own.

    python benchmarks/evaluation_sides.py SIDE JOB.json

prints one line of JSON: seconds of the evaluation itself, and where they went as far as the side tells.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

OURS, LEROBOT = "ours", "lerobot"
# With films: ours as many as LeRobot's 10 for each task, which cannot be turned off there.
SIDES = ((OURS, True), (LEROBOT, True), (OURS, False), (LEROBOT, False))


@dataclass(frozen=True)
class Job:
    """What is evaluated: the same on both sides. `seed` is that of each task's first trial."""

    checkpoint: str
    tasks: list[str]
    trials: int
    workers: int
    image_size: int
    out: str
    films: bool
    seed: int = 0


def make_checkpoint(folder: Path, settings: dict[str, Any], image_size: int) -> Path:
    """A policy with random weights: it never succeeds, so that every trial lasts its horizon on both sides."""
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.factory import get_policy_class, make_policy_config, make_pre_post_processors

    from robocasa_lerobot import contract
    from robocasa_lerobot.policies.registry import register_policies
    from robocasa_lerobot.settings import decode

    register_policies()
    torch.manual_seed(0)
    images = {key: PolicyFeature(FeatureType.VISUAL, (3, image_size, image_size)) for key in contract.IMAGE_KEYS}
    config_class = type(make_policy_config(settings["type"]))
    values = decode(config_class, {name: value for name, value in settings.items() if name != "type"})
    config = dataclasses.replace(
        values,
        input_features={**images, contract.STATE_KEY: PolicyFeature(FeatureType.STATE, (contract.STATE_SIZE,))},
        output_features={contract.ACTION_KEY: PolicyFeature(FeatureType.ACTION, (contract.ACTION_SIZE,))},
        device="cpu",
    )
    policy = get_policy_class(config.type)(config)
    sizes = {contract.STATE_KEY: contract.STATE_SIZE, contract.ACTION_KEY: contract.ACTION_SIZE}
    # Actions of a tenth of the full command: the arm moves, and nothing diverges.
    stats = {key: {"min": -0.1 * torch.ones(n), "max": 0.1 * torch.ones(n)} for key, n in sizes.items()}
    policy.save_pretrained(folder)
    for processor in make_pre_post_processors(config, dataset_stats=stats):
        processor.save_pretrained(folder)
    return folder


def run_ours(job: Job) -> dict[str, Any]:
    """Our engine, on the seeds that LeRobot gives its episodes: seed, seed + 1, ... for each task."""
    from robocasa_lerobot.evaluation.config.evaluation import EnvSettings, EvaluationConfig, PolicySettings
    from robocasa_lerobot.evaluation.run.processes import start_importing
    from robocasa_lerobot.gl import ensure_drawing

    config = EvaluationConfig(
        policy=PolicySettings(path=[job.checkpoint], label=["policy"], device="cpu"),
        env=EnvSettings(tasks=job.tasks, image_size=job.image_size),
        trials=job.trials,
        workers=job.workers,
        videos=min(10, job.trials) if job.films else 0,
        out=job.out,
        report=False,  # which LeRobot has none of; its `eval_info.json` both write
    )
    ensure_drawing()  # this and the next before other imports, as the command does
    start_importing([Path(job.checkpoint)], config.policy.threads, own_process=True)
    from robocasa_lerobot.evaluation.run.engine import evaluate, prepare
    from robocasa_lerobot.evaluation.run.outputs import write_outputs

    evaluation = prepare(config)
    plan = [dataclasses.replace(spec, seed=job.seed + spec.trial) for spec in evaluation.plan]
    evaluation = dataclasses.replace(evaluation, plan=plan, todo_plan=plan)
    records = evaluate(evaluation)
    with contextlib.redirect_stdout(sys.stderr):  # the rates, beside which the result is read
        write_outputs(evaluation)
    assert all(record.error is None for record in records), [record.error for record in records]
    parts = ("policy", "physics", "rendering", "building", "waiting")
    total = sum(record.seconds.total for record in records)
    split = {part: sum(getattr(record.seconds, part) for record in records) / total for part in parts}
    steps = [record.steps for record in records]
    return {"split": split, "steps": steps, "successes": sum(r.success for r in records), "busy_seconds": total}


def run_lerobot(job: Job) -> dict[str, Any]:
    """`lerobot-eval` as it comes; without films only the number of episodes that it renders is set to 0."""
    from lerobot.scripts import lerobot_eval

    spent = {"policy": 0.0, "env": 0.0}
    original = lerobot_eval.eval_policy_all

    def watched(**arguments: Any) -> Any:
        if not job.films:
            arguments["max_episodes_rendered"] = 0
        policy = arguments["policy"]
        policy.select_action = _timed(policy.select_action, spent, "policy")
        for name in ("preprocessor", "postprocessor"):
            arguments[name] = _Timed(arguments[name], spent, "policy")
        for group in arguments["envs"].values():
            for env in group.values():
                env.step = _timed(env.step, spent, "env")
        return original(**arguments)

    lerobot_eval.eval_policy_all = watched
    sys.argv = [
        "lerobot-eval",
        f"--policy.path={job.checkpoint}",
        "--policy.device=cpu",
        "--env.type=robocasa_kitchen",
        f"--env.task={','.join(job.tasks)}",
        f"--env.image_size={job.image_size}",
        f"--eval.n_episodes={job.trials}",
        f"--eval.batch_size={job.workers}",
        f"--seed={job.seed}",
        f"--output_dir={job.out}",
    ]
    started = time.perf_counter()
    lerobot_eval.main()
    total = time.perf_counter() - started
    info = json.loads((Path(job.out) / "eval_info.json").read_text(encoding="utf-8"))
    successes = sum(sum(task["metrics"]["successes"]) for task in info["per_task"])
    split = {"policy": spent["policy"] / total, "stepping envs, slowest of each batch": spent["env"] / total}
    return {"split": {**split, "else (start, resets, films)": 1 - sum(split.values())}, "successes": int(successes)}


class _Timed:
    """A processor pipeline whose calls are timed; everything else is its own."""

    def __init__(self, inner: Any, spent: dict[str, float], name: str) -> None:
        self._inner, self._call = inner, _timed(inner, spent, name)

    def __call__(self, *arguments: Any) -> Any:
        return self._call(*arguments)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def _timed(function: Any, spent: dict[str, float], name: str) -> Any:
    def timed(*arguments: Any, **named: Any) -> Any:
        started = time.perf_counter()
        try:
            return function(*arguments, **named)
        finally:
            spent[name] += time.perf_counter() - started

    return timed


def main() -> None:
    """Run one side; the last line of the output is its result."""
    side, job_file = sys.argv[1:]
    job = Job(**json.loads(Path(job_file).read_text(encoding="utf-8")))
    result = run_ours(job) if side == OURS else run_lerobot(job)
    print("\nRESULT " + json.dumps(result))


if __name__ == "__main__":
    main()
