"""What an evaluation in another simulator plans otherwise than one in our kitchens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.config.evaluation import KITCHEN_ENV_FACTORY, EvaluationConfig
from robocasa_lerobot.evaluation.planning.trials import trial_seed
from robocasa_lerobot.evaluation.records.results import REPLAY
from robocasa_lerobot.evaluation.simulators.simulator import LEROBOT, Simulator, describe

OWN_SCENES = "own"  # the header's split


def plan_simulator(
    simulator: Simulator, config: EvaluationConfig, sources: Sequence[PolicySource], settings: dict[str, Any]
) -> dict[str, list[int]]:
    """Check the settings and ask the simulator; the seeds of each task's trials, {} for the usual ones.

    `settings`, those that outcomes depend on, get the simulator's versions and lose what means nothing to it.

    Raises:
        UserError: a setting that is for our kitchens alone, or a simulator or task that is not there.
    """
    _check(simulator, config, sources)
    tasks = list(config.env.tasks)
    description = describe(simulator, tasks, config.stall_seconds)
    settings["simulator"] = description.settings()
    settings["split"] = OWN_SCENES
    if config.env.type is not None:
        settings["factory"] = LEROBOT
    if config.env.image_size is None and all(source.image_size is None for source in sources):
        settings["image_size"] = 0  # the env's own
    for name in ("render_preset", "perturbation"):
        settings.pop(name, None)
    if not description.starts:
        return {}
    seeds = {}
    for task in tasks:
        count = description.starts.get(task)
        if count is not None and config.trials > count:
            raise UserError(f"task {task} has {count} fixed starts, {config.trials} trials: use --trials={count}.")
        given = range(config.trials)
        seeds[task] = [*given] if count is not None else [trial_seed(config.seed, task, trial) for trial in given]
    return seeds


def _check(simulator: Simulator, config: EvaluationConfig, sources: Sequence[PolicySource]) -> None:
    env = config.env
    if env.type is None and env.factory == KITCHEN_ENV_FACTORY:
        raise UserError(
            "env.python without an env: give --env.factory=module:callable (or FILE.py:callable) of that interpreter, "
            "or --env.type=lerobot:NAME."
        )
    if env.type is not None and env.factory != KITCHEN_ENV_FACTORY:
        raise UserError("env.type and env.factory exclude each other: give one of them.")
    if env.type is not None and not config.success.rule == "any_step":
        raise UserError(f"success.rule={config.success.rule}: LeRobot's envs end at their first success: use any_step.")
    if config.perturbation.names != ["none"]:
        raise UserError("perturbation.names: they are perturbations of our kitchens; another simulator has none.")
    if env.split != "target":
        raise UserError(f"env.split={env.split}: splits are of our kitchens; give an option of the env's own.")
    if any(source.type == REPLAY for source in sources):
        raise UserError(
            "replay:FILE begins in our kitchens; recordings of another simulator are shown by its adapter's expert "
            "(docs/simulators.md), with --policy=demonstrator."
        )
