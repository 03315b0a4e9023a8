"""From settings to the plan: tasks, horizons, what a trial's outcome depends on, and the run's header."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.actors.chunk_policy import can_be_frozen, default_width
from robocasa_lerobot.evaluation.config.evaluation import (
    EnvSettings,
    EvaluationConfig,
    PerturbationSettings,
)
from robocasa_lerobot.evaluation.records.results import PolicyInfo, RunHeader
from robocasa_lerobot.provenance import git_commit, machine, utc_now, versions

# The release of RoboCasa whose horizons our tasks have; those of 1.0.0 were two thirds of them.
HORIZON_VERSION = "1.0.1"
_SHOWN = 60

PACKAGES = ("lerobot", "mujoco", "torch", "onnxruntime", "gymnasium", "numpy")  # what simulates and infers


class NothingRegisteredError(UserError):
    """An evaluation none of whose tasks this version has: there is nothing wrong with it, and nothing to run."""


@dataclass(frozen=True)
class PlannedTasks:
    """The run's plan: `horizons` of tasks (control steps), and `sets` with those of their tasks that are run.

    `missing` are tasks that were named, or that belong to a named set, and are not run; `missing_by_set` has them by
    set, for those sets that are not run as a whole.
    """

    horizons: dict[str, int | None]
    sets: dict[str, list[str]]
    missing: list[str]
    missing_by_set: dict[str, list[str]] = field(default_factory=dict)

    def of_policy(self, lifelong_phase: int | None) -> list[str]:
        """The tasks of a policy: all, or those of the first sets."""
        if lifelong_phase is None:
            return list(self.horizons)
        if lifelong_phase > len(self.sets):
            raise UserError(f"policy.lifelong_phase: found {lifelong_phase}, but env.task_sets has {len(self.sets)}.")
        chosen = [task for tasks in list(self.sets.values())[:lifelong_phase] for task in tasks]
        return list(dict.fromkeys(chosen))


def plan_tasks(env: EnvSettings, first_sets: int | None = None) -> PlannedTasks:
    """The tasks of the settings, with their horizons: fixed ones, or the registry's times the multiplier.

    Args:
        env: the settings.
        first_sets: how many of the task sets count; None is all.

    Raises:
        UnknownNameError: a task or a task set that neither the benchmark nor the registry file has.
        NothingRegisteredError: this version has none of the tasks.
        UserError: tasks are not registered yet and may not be left out (all are named).
    """
    if not env.is_kitchen:
        if env.task_sets:
            raise UserError("env.task_sets are the kitchens'; name the tasks of an env of your own in env.tasks.")
        if env.horizon_multiplier != 1.0:
            raise UserError("env.horizon_multiplier needs the kitchen env; give env.horizon for an env of your own.")
        return PlannedTasks(dict.fromkeys(env.tasks, env.horizon), {}, [])
    from robocasa_lerobot.benchmark.tasks import published_tasks
    from robocasa_lerobot.envs.tasks import registry

    registered = set(registry.task_names())
    for task in env.tasks:
        if task not in published_tasks():
            registry.get_task(task)
    named, whole = _tasks_of_sets(env.task_sets[:first_sets], env.registry)
    if env.tasks_per_set is not None:  # a set of which nothing is registered keeps some that are missing
        named, whole = _first_of_sets(named, whole, registered, env.tasks_per_set)
    wanted = list(dict.fromkeys(env.tasks or (task for tasks in named.values() for task in tasks)))
    chosen = registered & set(wanted)
    if not chosen:
        what = ", ".join(named) or ", ".join(env.tasks)
        raise NothingRegisteredError(f"this version has none of the tasks of {what}: there is nothing to run.")
    lacking = [task for task in wanted if task not in registered]
    if lacking and not env.allow_missing_tasks:
        raise UserError(_lacking(list(named), lacking, sorted(chosen)))
    order = [task for tasks in named.values() for task in tasks] if named else []
    order = [task for task in dict.fromkeys((*order, *env.tasks)) if task in chosen]
    steps = {task: int(registry.get_task(task).horizon) for task in order}
    horizons: dict[str, int | None] = {
        task: env.horizon if env.horizon is not None else max(1, round(own * env.horizon_multiplier))
        for task, own in steps.items()
    }
    sets = {name: [task for task in tasks if task in chosen] for name, tasks in named.items()}
    left_out = {name: [task for task in tasks if task not in sets[name]] for name, tasks in whole.items()}
    missing = dict.fromkeys((*(t for tasks in left_out.values() for t in tasks if t not in chosen), *lacking))
    return PlannedTasks(horizons, sets, list(missing), {name: tasks for name, tasks in left_out.items() if tasks})


def _tasks_of_sets(names: Sequence[str], registry: str | None) -> tuple[dict[str, Sequence[str]], ...]:
    """The tasks of each set, and those of which it is a part.

    What a registry leaves of the benchmark's sets (`only` in its file) is a part of them; a set that the file itself
    defines is its own, whatever its name.
    """
    from robocasa_lerobot.benchmark.tasks import published_task_sets

    published = published_task_sets()
    known, own = dict(published), dict[str, list[str]]()
    if registry is not None:
        from robocasa_lerobot.data.registry.registry import open_registry

        opened = open_registry(registry)
        known |= opened.task_sets
        own = opened.config.task_sets
    for name in names:
        if name not in known:
            raise UnknownNameError("task set", name, known, f"(in the registry {registry})" if registry else "")
    named: dict[str, Sequence[str]] = {name: known[name] for name in names}
    whole: dict[str, Sequence[str]] = {
        name: published[name] if name in published and name not in own else tasks for name, tasks in named.items()
    }
    return named, whole


def _first_of_sets(
    named: Mapping[str, Sequence[str]], whole: Mapping[str, Sequence[str]], registered: set[str], count: int
) -> tuple[dict[str, Sequence[str]], ...]:
    """So many tasks of each set, registered ones first."""
    some = {name: sorted(tasks, key=lambda task: task not in registered)[:count] for name, tasks in named.items()}
    return dict(some), {name: list(dict.fromkeys((*some[name], *tasks)))[:count] for name, tasks in whole.items()}


def _lacking(sets: Sequence[str], lacking: list[str], there: list[str]) -> str:
    shown = ", ".join(lacking[:_SHOWN]) + (f" and {len(lacking) - _SHOWN} more" if len(lacking) > _SHOWN else "")
    return (
        f"{len(lacking)} task(s) of {', '.join(sets) or 'env.tasks'} are not registered in this version: {shown}. Run "
        f"those that are there with --env.tasks={','.join(there)} or --env.allow_missing_tasks=true; the results then "
        "say that the evaluation is partial."
    )


def partial_sentence(
    sets: Mapping[str, Sequence[str]], missing: Sequence[str], missing_by_set: Mapping[str, Sequence[str]]
) -> str | None:
    """What a run leaves out of its task sets and tasks, as a sentence; None where it is whole."""
    if not missing and not missing_by_set:
        return None
    parts = [
        f"{len(lacking)} of {len(lacking) + len(sets.get(name, ()))} tasks of {name}"
        for name, lacking in missing_by_set.items()
    ]
    in_sets = {task for tasks in missing_by_set.values() for task in tasks}
    parts += [task for task in missing if task not in in_sets]
    return f"partial: without {', '.join(parts)}; averages are over the tasks that were run."


def perturbation_parameters(settings: PerturbationSettings) -> dict[str, dict[str, Any]]:
    """Each planned perturbation with its standard deviations."""
    prefixes = {"camera": ("camera_", "wrist_"), "joint": ("joint_",), "base": ("base_",)}
    values = dataclasses.asdict(settings)
    return {
        name: {key: value for key, value in values.items() if key.startswith(prefixes.get(name, ("\0",)))}
        for name in settings.names
    }


def env_arguments(name: str, settings: PerturbationSettings) -> dict[str, Any]:
    """Arguments of the kitchen env for a perturbation; the seeds of its noise are the trial's own."""
    if name == "language":
        return {"novel_language": True}
    if name == "camera":
        from robocasa_lerobot.envs.robots.camera_noise import CameraNoise

        return {
            "camera_noise": CameraNoise(
                scene_position_m=settings.camera_position_m,
                scene_angle_deg=settings.camera_angle_deg,
                wrist_position_m=settings.wrist_position_m,
                wrist_angle_deg=settings.wrist_angle_deg,
            )
        }
    if name in ("joint", "base"):
        from robocasa_lerobot.envs.scene.reset_noise import InitialNoise

        if name == "joint":
            return {"initial_noise": InitialNoise(arm_rad=settings.joint_rad)}
        noise = InitialNoise(base_position_m=settings.base_position_m, base_yaw_deg=settings.base_yaw_deg)
        return {"initial_noise": noise}
    return {}


def outcome_settings(
    config: EvaluationConfig, image_size: int, device: str = "cpu", kinds: Iterable[str] = ()
) -> dict[str, Any]:
    """The settings that a trial's outcome depends on; trials are only ever mixed when all of these agree.

    `kinds` are the types of the policies that are computed.
    """
    places = ("tasks", "task_sets", "registry", "tasks_per_set", "allow_missing_tasks", "render_devices", "python")
    new = ("type", "options")  # older results do not have them
    env = {
        name: value
        for name, value in dataclasses.asdict(config.env).items()
        if name not in places and (value or name not in new)
    }
    noise = {name: value for name, value in dataclasses.asdict(config.perturbation).items() if name != "names"}
    return {
        "protocol": config.protocol,
        **env,
        "image_size": image_size,
        "seed": config.seed,
        "executed_steps": config.executed_steps,
        "device": device,
        "threads": config.policy.threads,
        "batch_width": config.policy.batch_width or default_width(kinds, device),
        "success_rule": config.success.rule,
        "success_hold_steps": config.success.hold_steps,
        "perturbation": noise,
        **({"runtime": "onnx"} if config.policy.runtime == "onnx" and can_be_frozen(kinds, device) else {}),
        **({} if config.scale is None else {"scale": config.scale}),
    }


def run_header(
    config: EvaluationConfig,
    policies: dict[str, PolicyInfo],
    tasks: PlannedTasks,
    settings: dict[str, Any],
) -> RunHeader:
    """The header of a run with these settings on this machine."""
    env = config.env
    rule = "fixed" if env.horizon else "task" if env.is_kitchen else "env"
    return RunHeader(
        protocol=config.protocol,
        task_sets=tasks.sets,
        tasks=list(tasks.horizons),
        missing_tasks=tasks.missing,
        trials=config.trials,
        seed=config.seed,
        split=settings["split"],
        render_preset=env.render_preset,
        image_size=settings["image_size"],
        horizon_rule=rule,
        horizon_multiplier=env.horizon_multiplier,
        success_rule=config.success.rule,
        success_hold_steps=config.success.hold_steps,
        executed_steps=config.executed_steps,
        perturbations=perturbation_parameters(config.perturbation),
        settings=settings,
        policies=policies,
        versions=versions(*PACKAGES),
        git_commit=git_commit(),
        device=settings["device"],
        machine=machine(),
        started=utc_now(),
        horizon_version=HORIZON_VERSION if rule == "task" else None,
        registry=env.registry,
        missing_by_set=tasks.missing_by_set,
    )


def resolve_device(asked: str, needs_torch: bool) -> str:
    """`auto` resolved to what this machine has; torch is only imported where there may be a GPU.

    Raises:
        UserError: a device that this machine does not have.
    """
    import platform

    if not needs_torch:
        return "cpu"
    shown = any(Path(path).exists() for path in ("/proc/driver/nvidia", "/dev/kfd", "/dev/dxg"))  # the last: WSL2
    may_be_gpu = shown or platform.system() != "Linux"
    if asked == "cpu" or (asked == "auto" and not may_be_gpu):
        return "cpu"
    from robocasa_lerobot.evaluation.actors.policy_runner import pick_device

    return pick_device(asked)
