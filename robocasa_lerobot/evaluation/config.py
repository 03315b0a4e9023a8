"""Settings of an evaluation: `python eval.py --policy.path=DIR --env.tasks=OpenDrawer --trials 10`."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.provenance import git_commit, machine, utc_now, versions
from robocasa_lerobot.evaluation.results import UNPERTURBED, PolicyInfo, RunHeader

KITCHEN_ENV_FACTORY = "robocasa_lerobot.envs.kitchen_env:KitchenEnv"
SPLITS = ("target", "pretrain")
RENDER_PRESETS = ("fast", "quality")
DEVICES = ("auto", "cpu", "cuda", "mps")


@dataclass
class PolicySettings:
    """Which policies are evaluated.

    path: `pretrained_model` folders, or `random` and `zero` (reference policies); several give one report.
    label: their names in results and report; default: phase and step of the checkpoint.
    device: auto, cpu, cuda or mps.
    threads: CPU threads of each worker's policy. Fixed, not derived from the number of workers, because sums of
        floats depend on it, and a trial's outcome must not depend on how trials are spread over processes.
    """

    path: list[str] = field(default_factory=list)
    label: list[str] = field(default_factory=list)
    device: str = "auto"
    threads: int = 1


@dataclass
class EnvSettings:
    """In which kitchens, and for how long.

    tasks: registered task names.
    split: target or pretrain scenes.
    render_preset: fast or quality.
    image_size: pixels, height and width; default: what the checkpoint was trained at, else 256.
    horizon: control steps at 20 Hz for all tasks; default: each task's own.
    horizon_multiplier: factor on each task's own horizon.
    factory: `module:callable` that makes the env, called with task, split, render_preset, image_size and horizon.
    render_devices: EGL devices that the workers are dealt out to (`robocasa-lerobot doctor` lists them; the numbers
        are not CUDA's); default: EGL's choice, its first one for all.
    """

    tasks: list[str] = field(default_factory=list)
    split: str = "target"
    render_preset: str = "fast"
    image_size: int | None = None
    horizon: int | None = None
    horizon_multiplier: float = 1.0
    factory: str = KITCHEN_ENV_FACTORY
    render_devices: list[int] = field(default_factory=list)


@dataclass
class EvaluationConfig:
    """All settings of an evaluation.

    trials: trials of each policy on each task.
    seed: fixes scenes, starts and the policy's sampling noise of all trials.
    executed_steps: executed steps of each predicted action chunk; default: the policy's own.
    workers: parallel processes; 0: one for each CPU core. Outcomes do not depend on it.
    videos: how many trials of each policy on each task are filmed: the first ones, and where these show no success or
        no failure, the first such trial is run once more for its film. 0: no films.
    out: folder of trials.jsonl, videos and report; default: outputs/evaluations/<labels>.
    retry_errors: run trials again that are recorded with an error.
    stall_seconds: a worker that reports no progress for so long is ended, and its trial tried once more.
    report: write report.html and report.md at the end.
    """

    policy: PolicySettings = field(default_factory=PolicySettings)
    env: EnvSettings = field(default_factory=EnvSettings)
    trials: int = 10
    seed: int = 0
    executed_steps: int | None = None
    workers: int = 0
    videos: int = 2
    out: str | None = None
    retry_errors: bool = False
    stall_seconds: float = 300.0
    report: bool = True

    def __post_init__(self) -> None:
        """Check what can be checked without opening anything.

        Raises:
            UserError: a setting out of its range.
        """
        if not self.policy.path:
            raise UserError("no policy: give --policy.path=CHECKPOINT/pretrained_model, or random, or zero.")
        if not self.env.tasks:
            raise UserError("no task: give --env.tasks=OpenDrawer (`robocasa-lerobot tasks` lists them).")
        if self.policy.label and len(self.policy.label) != len(self.policy.path):
            raise UserError(f"{len(self.policy.label)} policy.label for {len(self.policy.path)} policy.path.")
        for what, names in (("policy.label", self.policy.label), ("env.tasks", self.env.tasks)):
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise UserError(f"{what}: {', '.join(twice)} given twice.")
        choices = (("env.split", self.env.split, SPLITS), ("policy.device", self.policy.device, DEVICES))
        for name, value, known in (*choices, ("env.render_preset", self.env.render_preset, RENDER_PRESETS)):
            if value not in known:
                raise UnknownNameError(name, value, known)
        at_least = {
            "trials": (self.trials, 1),
            "workers": (self.workers, 0),
            "videos": (self.videos, 0),
            "seed": (self.seed, 0),
            "policy.threads": (self.policy.threads, 1),
            "executed_steps": (self.executed_steps, 1),
            "env.image_size": (self.env.image_size, 16),
            "env.horizon": (self.env.horizon, 1),
        }
        for name, (number, low) in at_least.items():
            if number is not None and number < low:
                raise UserError(f"{name}: found {number}, expected at least {low}.")
        if self.env.horizon_multiplier <= 0 or self.stall_seconds <= 0:
            raise UserError("env.horizon_multiplier and stall_seconds must be above 0.")
        if self.env.horizon is not None and self.env.horizon_multiplier != 1.0:
            raise UserError("env.horizon and env.horizon_multiplier exclude each other: give one of them.")

    def worker_count(self, trials: int) -> int:
        """Processes to start for `trials` trials."""
        return max(1, min(self.workers or os.cpu_count() or 1, trials))


def horizons(env: EnvSettings) -> dict[str, int | None]:
    """Control steps of each task: the fixed horizon, or the registry's times the multiplier.

    Raises:
        UnknownNameError: a task that is not registered.
        UserError: a multiplier for an env of the user's own, whose horizons are not known here.
    """
    if env.factory != KITCHEN_ENV_FACTORY:
        if env.horizon_multiplier != 1.0:
            raise UserError("env.horizon_multiplier needs the kitchen env; give env.horizon for an env of your own.")
        return dict.fromkeys(env.tasks, env.horizon)
    from robocasa_lerobot.envs import registry

    own = {name: int(registry.get_task(name).horizon) for name in env.tasks}
    if env.horizon is not None:
        return dict.fromkeys(own, env.horizon)
    return {name: max(1, round(steps * env.horizon_multiplier)) for name, steps in own.items()}


def check_factory(factory: str) -> None:
    """The factory must be written `module:callable`."""
    module, colon, name = factory.partition(":")
    if not (module and colon and name):
        raise UserError(f"env.factory: found {factory!r}, expected module:callable, e.g. {KITCHEN_ENV_FACTORY}.")


def outcome_settings(config: EvaluationConfig, image_size: int) -> dict[str, Any]:
    """The settings that a trial's outcome depends on; trials are only ever mixed when all of these agree."""
    where = ("tasks", "render_devices")
    env = {name: value for name, value in dataclasses.asdict(config.env).items() if name not in where}
    return {
        **env,
        "image_size": image_size,
        "seed": config.seed,
        "executed_steps": config.executed_steps,
        "device": config.policy.device,
        "threads": config.policy.threads,
        "success_rule": "any step",
    }


def run_header(
    config: EvaluationConfig, policies: dict[str, PolicyInfo], horizons: dict[str, int | None], settings: dict[str, Any]
) -> RunHeader:
    """The header of a run with these settings on this machine."""
    env = config.env
    return RunHeader(
        protocol="custom",
        task_sets={},
        tasks=list(horizons),
        missing_tasks=[],
        trials=config.trials,
        seed=config.seed,
        split=env.split,
        render_preset=env.render_preset,
        image_size=settings["image_size"],
        horizon_rule="fixed" if env.horizon else "task" if env.factory == KITCHEN_ENV_FACTORY else "env",
        horizon_multiplier=env.horizon_multiplier,
        success_rule="any_step",
        success_hold_steps=1,
        executed_steps=config.executed_steps,
        perturbations={UNPERTURBED: {}},
        settings=settings,
        policies=policies,
        versions=versions(),
        git_commit=git_commit(),
        device=config.policy.device,
        machine=machine(),
        started=utc_now(),
    )


def output_folder(config: EvaluationConfig, labels: list[str]) -> Path:
    """Where results go: `out`, or a folder named after the policies."""
    return Path(config.out) if config.out else Path("outputs/evaluations") / "-".join(labels)
