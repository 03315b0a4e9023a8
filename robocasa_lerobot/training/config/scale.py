"""Experiments made small: `--scale FILE` tries a whole graph, with its evaluations, in minutes and without a GPU.

A scale changes how much is done, never what is done: the phases, their data and starts, the order and the evaluations
stay as the experiment has them. `ScaleConfig` is everything that it may change.
"""

from __future__ import annotations

import dataclasses
import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from robocasa_lerobot.config_files import find_config
from robocasa_lerobot.data.mixture_config import LoaderConfig, MixtureConfig
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.settings import check_keys, decode, load_yaml
from robocasa_lerobot.training.config.phase import PhaseConfig

_IDENTITY = ("type", "path", "file")  # settings that say which policy it is


@dataclass
class EvaluationScale:
    """What of each evaluation of a phase is smaller; null leaves it.

    Attributes:
        trials: of each policy on each task.
        horizon: control steps of all tasks, instead of each task's own.
        workers: parallel processes.
        videos: trials of each task that are filmed.
    """

    trials: int | None = None
    horizon: int | None = None
    workers: int | None = None
    videos: int | None = None

    def __post_init__(self) -> None:
        _check_at_least("scale.evaluation", {"trials": 1, "horizon": 1, "workers": 1, "videos": 0}, self)


@dataclass
class ScaleConfig:
    """What `--scale` may make smaller of an experiment; null leaves it, and nothing gets larger by it.

    Attributes:
        name: of the scale, for the records; the file's name where it has none.
        steps: optimiser steps of each phase; a schedule made for more steps than the phase's keeps that proportion.
        batch_size: samples of each optimiser step.
        save_every: steps between checkpoints.
        log_every: steps of a line of metrics.
        held_out_samples: frames of each task whose loss is measured.
        tasks_per_set: so many tasks of each task set: of data the first that the registry has, in evaluations the
            first that this version can simulate.
        data_share: frames of the data that are there, as a share of those that the experiment is made for. What the
            loader may keep in memory, on disk and open shrinks alike, so that what does not fit at full size does not
            fit here.
        image_size: height and width in pixels of the pictures that are trained on.
        workers: loader processes.
        policies: settings of the policies' sizes, by type: widths, depths, and sizes of what they are made of.
        evaluation: of the phases' evaluations.
    """

    name: str = ""
    steps: int | None = None
    batch_size: int | None = None
    save_every: int | None = None
    log_every: int | None = None
    held_out_samples: int | None = None
    tasks_per_set: int | None = None
    data_share: float = 1.0
    image_size: int | None = None
    workers: int | None = None
    policies: dict[str, dict[str, Any]] = field(default_factory=dict)
    evaluation: EvaluationScale = field(default_factory=EvaluationScale)

    def __post_init__(self) -> None:
        lows = dict.fromkeys(("steps", "batch_size", "save_every", "log_every", "held_out_samples", "tasks_per_set"), 1)
        _check_at_least("scale", {**lows, "image_size": 16, "workers": 0}, self)
        if not 0 < self.data_share <= 1:
            raise UserError(f"scale: data_share is {self.data_share}, expected more than 0 and at most 1.")
        for kind, settings in self.policies.items():
            found = [name for name in _IDENTITY if name in settings]
            if found:
                raise UserError(
                    f"scale: policies.{kind} sets {', '.join(found)}; a scale gives sizes, not another policy."
                )


def load_scale(name: str) -> ScaleConfig:
    """The scale of a file, or of a name in `configs/scales/`.

    Raises:
        UserError: no such file, a key that a scale may not change (the closest match is named), or a wrong value.
    """
    path = find_config(name, "scales")
    data = load_yaml(path)
    check_keys(ScaleConfig, data, path.name)
    return decode(ScaleConfig, {"name": path.stem, **data}, str(path))


def scaled(
    scale: ScaleConfig, policy: dict[str, Any], phases: Sequence[PhaseConfig], loader: LoaderConfig
) -> tuple[dict[str, Any], list[PhaseConfig], LoaderConfig]:
    """An experiment's policy, phases and loader at that scale; the scale holds over what the experiment says."""
    kind = str(policy.get("type"))
    return {**policy, **scale.policies.get(kind, {})}, [_phase(p, kind, scale) for p in phases], _loader(loader, scale)


def _phase(phase: PhaseConfig, kind: str, scale: ScaleConfig) -> PhaseConfig:
    steps = _least(phase.steps, scale.steps)
    batch_size = _least(phase.batch_size, scale.batch_size)
    sizes = scale.policies.get(str(phase.policy.get("type", kind)), {})
    anew = "type" in phase.policy  # another policy than the experiment's: all sizes; else those that the phase changes
    held_out = phase.held_out
    if held_out is not None:
        samples = _least(held_out.samples, scale.held_out_samples)
        held_out = dataclasses.replace(held_out, every=min(held_out.every, steps), samples=samples)
    return dataclasses.replace(
        phase,
        steps=steps,
        schedule_steps=phase.schedule_steps and max(1, round(phase.schedule_steps * steps / phase.steps)),
        batch_size=batch_size,
        gradient_accumulation=math.gcd(phase.gradient_accumulation, batch_size),
        save_every=_least(phase.save_every, scale.save_every) if phase.save_every else phase.save_every,
        log_every=_least(phase.log_every, scale.log_every),
        held_out=held_out,
        policy={**phase.policy, **{k: v for k, v in sizes.items() if anew or k in phase.policy}},
        mixture=_mixture(phase.mixture, scale),
        evaluations=[" ".join((text, *_evaluation_settings(scale))) for text in phase.evaluations],
    )


def _mixture(mixture: MixtureConfig, scale: ScaleConfig) -> MixtureConfig:
    if scale.tasks_per_set is None:
        return mixture
    select = [dataclasses.replace(part, tasks_per_set=scale.tasks_per_set) for part in mixture.select]
    return dataclasses.replace(mixture, select=select)


def _loader(loader: LoaderConfig, scale: ScaleConfig) -> LoaderConfig:
    share = scale.data_share
    return dataclasses.replace(
        loader,
        workers=_least(loader.workers, scale.workers),
        image_size=loader.image_size if scale.image_size is None else scale.image_size,
        cache_budget_gb=loader.cache_budget_gb * share,
        cache_columns_above_gb=loader.cache_columns_above_gb * share,
        cache_open_files=max(1, round(loader.cache_open_files * share)),
    )


def _evaluation_settings(scale: ScaleConfig) -> Sequence[str]:
    """Options of the command of an evaluation; the last one makes the results tell that they are a trial's."""
    given = {
        "trials": scale.evaluation.trials,
        "env.horizon": scale.evaluation.horizon,
        "workers": scale.evaluation.workers,
        "videos": scale.evaluation.videos,
        "env.tasks_per_set": scale.tasks_per_set,
        "scale": scale.name,
    }
    return [shlex.quote(f"--{name}={value}") for name, value in given.items() if value is not None]


def _least(own: int, most: int | None) -> int:
    return own if most is None else min(own, most)


def _check_at_least(where: str, lows: dict[str, int], values: Any) -> None:
    for name, low in lows.items():
        value = getattr(values, name)
        if value is not None and value < low:
            raise UserError(f"{where}: {name} is {value}, expected at least {low}.")
