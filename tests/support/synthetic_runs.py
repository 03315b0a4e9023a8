"""Runs of the benchmark's kinds from synthetic trials, to show and test reports. No policy ever ran.

    python tests/support/synthetic_runs.py outputs/synthetic   # runs of each kind and their reports

Every header says `synthetic: true` in its settings, which the report shows on top of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets, task_facts
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import (
    TRIALS_FILE,
    PolicyInfo,
    RunHeader,
    Seconds,
    StageSummary,
    TermSummary,
    TrialRecord,
)
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.config.phase import PhaseConfig
from robocasa_lerobot.training.planning.evaluations import PhaseEvaluation, phase_evaluations
from robocasa_lerobot.video import VideoWriter

TERMS = ("reached", "grasped", "placed", "gripper_away")
GROUPS = published.group_of_task()
EXPERIMENTS = Path(__file__).parents[2] / "configs/experiments/robocasa365"
LABELS = ("lifelong_phase", "demo_fraction", "training_data")
Rates = Mapping[str, float]


def header(protocol: str, policies: Sequence[PolicyInfo], tasks: Sequence[str], **changes: Any) -> RunHeader:
    values: dict[str, Any] = {
        "protocol": protocol,
        "task_sets": {
            group: [t for t in tasks if GROUPS.get(t) == group]
            for group in published.GROUPS
            if any(GROUPS.get(t) == group for t in tasks)
        },
        "tasks": list(tasks),
        "missing_tasks": [],
        "trials": 50,
        "seed": 0,
        "split": "target",
        "render_preset": "fast",
        "image_size": 256,
        "horizon_rule": "task",
        "horizon_multiplier": 1.0,
        "success_rule": "any_step",
        "success_hold_steps": 1,
        "executed_steps": 16,
        "perturbations": {"none": {}},
        "settings": {"synthetic": True, "seed": 0},
        "policies": {policy.label: policy for policy in policies},
        "versions": {"robocasa_lerobot": "0.1.0", "python": "3.12", "mujoco": "3.17.0", "lerobot": "0.6.1"},
        "git_commit": "0" * 40,
        "device": "synthetic",
        "machine": {"processor": "none: these trials were drawn at random", "system": "none"},
        "started": "2026-01-01T00:00:00+00:00",
    }
    return RunHeader(**{**values, **changes})


def policy(label: str, **changes: Any) -> PolicyInfo:
    values: dict[str, Any] = {"path": f"synthetic/{label}", "type": "synthetic", "fingerprint": "0" * 64}
    return PolicyInfo(label=label, **{**values, **changes})


def trials(
    head: RunHeader,
    label: str,
    rates: Rates,
    count: int,
    perturbation: str = "none",
    luck_share: float = 0.6,
    films: Mapping[str, Sequence[int]] | None = None,
) -> list[TrialRecord]:
    """Trials of one policy; the luck of a scene is shared by all policies, so that comparisons are paired."""
    out = []
    for task, rate in rates.items():
        horizon = 300 + 50 * (sum(map(ord, task)) % 20)
        scenes = np.random.default_rng([1, *task.encode()]).normal(size=count)
        own = np.random.default_rng([2, *task.encode(), *label.encode(), *perturbation.encode()])
        noise, errors = own.normal(size=count), own.random(count) < 0.002
        mixed = np.sqrt(luck_share) * scenes + np.sqrt(1 - luck_share) * noise
        threshold = norm.ppf(rate)  # success with exactly this probability
        for trial in range(count):
            success = bool(mixed[trial] < threshold) and not errors[trial]
            first = int(horizon * min(0.999, 0.15 + 0.8 * own.beta(2, 3))) if success else None
            met = np.full(len(TERMS), True)
            if not success:
                # Each goal has a difficulty of its own; at least one is missed.
                met = own.random(len(TERMS)) < [0.9, 0.7, 0.4, 0.8]
                met[int(own.choice(len(TERMS), p=[0.1, 0.25, 0.5, 0.15]))] = False
            lost = not success and own.random() < 0.3
            terms = {
                name: TermSummary(10 * (i + 1) if met[i] else None, 0.5 if met[i] else 0.0, bool(met[i]) and not lost)
                for i, name in enumerate(TERMS)
            }
            total = task_facts()[task].subtasks if task in task_facts() else 1
            reached = total if success else int(own.integers(total))
            stages = StageSummary(total, reached, 0, None if success else f"do part {reached + 1} of {task}")
            film = films is not None and trial in films.get(task, ())
            out.append(
                TrialRecord(
                    run=head.id,
                    label=label,
                    task=task,
                    perturbation=perturbation,
                    trial=trial,
                    seed=1000 + trial,
                    policy_seed=trial,
                    split=head.split,
                    layout_id=1 + trial % 10,
                    style_id=1 + trial % 10,
                    instruction=f"Synthetic instruction of {task}.",
                    horizon=horizon,
                    horizon_multiplier=1.0,
                    success=success,
                    first_success_step=first,
                    steps=first or horizon,
                    terms={} if errors[trial] else terms,
                    stages=None if errors[trial] else stages,
                    outcome="crashed" if errors[trial] else "finished",
                    error="Traceback: a synthetic error" if errors[trial] else None,
                    attempts=2 if errors[trial] else 1,
                    first_outcome="crashed" if errors[trial] else None,
                    first_error="Traceback: a synthetic error" if errors[trial] else None,
                    warnings={},
                    trajectory="00",
                    video=f"videos/{label}/{task}-{trial}.mp4" if film else None,
                    seconds=Seconds(total=1.0),
                    finished="2026-01-01T00:00:00+00:00",
                )
            )
    return out


def write(folder: Path, head: RunHeader, records: Sequence[TrialRecord]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    lines = [head.to_line(), *(record.to_line() for record in records)]
    (folder / TRIALS_FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")
    for record in records:
        if record.video is not None:
            _film(folder / record.video, record)
    return folder


def scaled(averages: Mapping[str, float], tasks: Sequence[str]) -> dict[str, float]:
    """Rates of tasks whose group averages are `averages` (percent), spread as the published single tasks are."""
    best = published.per_task_rates()
    out = {}
    for task in tasks:
        group = [best[t] for t in best if GROUPS[t] == GROUPS[task]]
        out[task] = min(0.98, best[task] / (sum(group) / len(group)) * averages[GROUPS[task]] / 100)
    return out


def multi_task(folder: Path, count: int = 50, films: bool = True) -> list[Path]:
    table = published.table("multi_task")
    tasks = list(GROUPS)
    names = {"diffusion_policy": "diffusion transformer", "pi05": "flow VLA", "gr00t": "flow VLA, large"}
    head = header("leaderboard", [policy(name, step=250_000, phase="multitask") for name in names.values()], tasks)
    head = header("leaderboard", list(head.policies.values()), tasks, split="pretrain", trials=count)
    records = []
    for key, name in names.items():
        averages = {row: table.percent[row][key] for row in published.GROUPS}
        rates = scaled(averages, tasks)
        filmed = dict.fromkeys(tasks[:3], (0, 1, 2)) if films and key == "gr00t" else None
        records += trials(head, name, rates, count, films=filmed)
    return [write(folder, head, records)]


def experiment(name: str, folder: Path, count: int = 30, type: str = "groot") -> list[Path]:
    """The runs that `train.py --evaluate` leaves of an experiment file of the benchmark: a folder for each evaluation
    of each phase, with the one policy of that phase, evaluated on what the file says and with the labels it gives."""
    own = load_experiment(EXPERIMENTS / f"{name}.yaml")
    return [
        _evaluation(own.name, phase, evaluation, folder / own.name, count, type)
        for phase in own.phases
        for evaluation in phase_evaluations(phase)
    ]


def _evaluation(name: str, phase: PhaseConfig, evaluation: PhaseEvaluation, root: Path, count: int, type: str) -> Path:
    checkpoint = root / phase.name / "checkpoints/last/pretrained_model"
    given = ["--config_path", str(evaluation.file), f"--policy={checkpoint}", *evaluation.settings]
    config = load_config(EvaluationConfig, given)
    first = {key: (values or [None])[0] for key, values in vars(config.policy).items() if key in LABELS}
    label = f"{name}/{phase.name}-{phase.steps:06d}"
    about = policy(label, experiment=name, phase=phase.name, step=phase.steps, path=str(checkpoint), type=type, **first)
    names = config.env.task_sets[: about.lifelong_phase] if config.lifelong else config.env.task_sets
    sets = {key: list(published_task_sets()[key]) for key in names}
    tasks = [task for members in sets.values() for task in members]
    head = header(
        config.protocol,
        [about],
        tasks,
        task_sets=sets,
        split=config.env.split,
        trials=count,
        perturbations={key: {} for key in config.perturbation.names},
    )
    records = []
    for perturbation in config.perturbation.names:
        rates = _rates(about, sets, perturbation)
        records += trials(head, label, rates, count, perturbation=perturbation, luck_share=0.8)
    return write(root / phase.name / "evaluations" / evaluation.file.stem, head, records)


def _rates(about: PolicyInfo, sets: Mapping[str, Sequence[str]], perturbation: str) -> dict[str, float]:
    """Rates about the published ones of the experiment and phase; those of other experiments are foundation's."""
    assert about.experiment is not None
    share = {0.0: "pretraining", 0.1: "10", 0.3: "30", 1.0: "100"}.get(about.demo_fraction or 0.0, "100")
    if about.lifelong_phase is not None:
        values = published.table("lifelong").percent[str(about.lifelong_phase)]
        return {task: values[name] / 100 for name, members in sets.items() for task in members}
    tasks = [task for members in sets.values() for task in members]
    if about.experiment.startswith("scene_diversity"):
        values = published.table("scene_diversity").percent["zero_shot" if share == "pretraining" else "target_10"]
        value = values[about.experiment.rpartition("_")[2]]
        return scaled(dict.fromkeys(published.GROUPS, value), tasks)
    if len(sets) == 1 and about.demo_fraction is None:
        values = published.table("robustness").percent[next(iter(sets))]
        return scaled(dict.fromkeys(published.GROUPS, values[perturbation]), tasks)
    table, column = {
        "composition_human50": ("pretraining_composition", f"human50_{share}"),
        "composition_human300": ("pretraining_composition", f"human300_{share}"),
        "target_only": ("foundation", f"target_{share}"),
        "multitask_diffusion_policy": ("multi_task", "diffusion_policy"),
        "multitask_pi0": ("multi_task", "pi0"),
        "multitask_pi05": ("multi_task", "pi05"),
        "multitask_gr00t": ("multi_task", "gr00t"),
        "multitask_gr00t_lora": ("low_rank", "lora"),
        "joint_cotraining": ("joint_cotraining", "gr00t"),
    }.get(about.experiment, ("foundation", f"both_{share}"))
    if share == "pretraining" and table in ("pretraining_composition", "foundation"):
        table, column = "foundation", "pretraining"
    percent = published.table(table).percent
    return scaled({row: percent[row][column] for row in published.GROUPS}, tasks)


def foundation(folder: Path, count: int = 30) -> list[Path]:
    return [*experiment("target_only", folder, count), *experiment("foundation", folder, count)]


def lifelong(folder: Path, count: int = 20) -> list[Path]:
    return experiment("lifelong", folder, count)


def robustness(folder: Path, count: int = 50) -> list[Path]:
    return [run for run in experiment("foundation", folder, count) if run.name == "robustness"]


def ablations(folder: Path, count: int = 20) -> list[Path]:
    names: tuple[str, ...] = ("composition_human50", "composition_human300")
    names += ("scene_diversity_5", "scene_diversity_25", "scene_diversity_2500", "joint_cotraining")
    return [
        run for name in (*names, "multitask_gr00t", "multitask_gr00t_lora") for run in experiment(name, folder, count)
    ]


RUNS = {
    "multi_task": multi_task,
    "foundation": foundation,
    "lifelong": lifelong,
    "robustness": robustness,
    "ablations": ablations,
}


def _film(path: Path, record: TrialRecord, frames: int = 60) -> None:
    """A drawn scene that nobody takes for a kitchen: a square that moves over stripes towards a line."""
    y, x = np.mgrid[0:192, 0:192]
    with VideoWriter(path, fps=10) as writer:
        for index in range(frames):
            views = []
            for camera in range(3):
                stripes = ((x + y * (camera - 1)) // 24 % 2).astype(np.uint8)
                picture = np.stack([90 + 40 * stripes, 110 + 30 * stripes, 130 + 20 * stripes], axis=-1).astype(
                    np.uint8
                )
                picture[:, 150:153] = (240, 200, 60)
                left = int(20 + (130 if record.success else 70) * index / frames)
                picture[80:112, left : left + 32] = (60, 160, 110) if record.success else (190, 80, 60)
                views.append(picture)
            writer.write(np.concatenate(views, axis=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    folder = parser.parse_args().out
    from robocasa_lerobot.evaluation.report.output import write_report

    for name, make in RUNS.items():
        write_report(make(folder / name), out=folder / name / "report.html")


if __name__ == "__main__":
    main()
