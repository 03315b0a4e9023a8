"""An experiment as typed configuration: a policy and a list of training phases.

The file format, overrides and how a phase inherits are described in `configs/README.md`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.data.config import LoaderConfig, MixtureConfig
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import decode, parse_overrides
from robocasa_lerobot.training import overlay

FROM_SCRATCH = "from_scratch"
STATISTICS = ("keep", "recompute")
IMAGE_STATISTICS = ("dataset", "imagenet")
MIXED_PRECISION = ("no", "bf16", "fp16")


@dataclass
class EmaConfig:
    """Exponential moving average of the weights; decay = 1 - (1 + step / inv_gamma) ** -power, within bounds.

    The defaults are those of the benchmark's Diffusion Policy. With it, checkpoints hold the averaged weights.
    """

    enabled: bool = True
    power: float = 0.75
    inv_gamma: float = 1.0
    min_decay: float = 0.0
    max_decay: float = 0.9999


@dataclass
class PhaseConfig:
    """One training run of the experiment.

    Attributes:
        name: names the phase's folder and lets later phases start from it.
        mixture: the data.
        steps: optimiser steps.
        init: `from_scratch`, the name of an earlier phase, or a `pretrained_model` folder; null is the previous
            phase, or for the first one `policy.path` if the experiment has it, else `from_scratch`.
        statistics: of normalisation, when starting from a checkpoint: `keep` the checkpoint's, or `recompute`
            them for this phase's data (the policy then sees the same state as another input).
        image_statistics: `dataset`, or `imagenet` for encoders trained on ImageNet.
        policy: settings of the policy that this phase changes.
        batch_size: samples per optimiser step, over all processes and accumulated parts.
        gradient_accumulation: parts in which a batch goes through the policy, one after the other.
        learning_rate: null is the policy's own; otherwise the rates of all parameter groups are scaled alike.
        warmup_steps: null is the policy's own schedule's.
        grad_clip_norm: largest gradient norm; null is the policy's own, 0 is none.
        save_every: steps between checkpoints; the last step always has one. 0 is the last step only.
        save_initial: also keep the policy before the first step, as checkpoint 000000.
        log_every: steps that a line of metrics.jsonl averages over.
        ema: moving average of the weights.
    """

    name: str
    mixture: MixtureConfig
    steps: int
    init: str | None = None
    statistics: str = "keep"
    image_statistics: str = "dataset"
    policy: dict[str, Any] = field(default_factory=dict)
    batch_size: int = 32
    gradient_accumulation: int = 1
    learning_rate: float | None = None
    warmup_steps: int | None = None
    grad_clip_norm: float | None = None
    save_every: int = 0
    save_initial: bool = False
    log_every: int = 10
    ema: EmaConfig = field(default_factory=EmaConfig)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", self.name):
            raise UserError(f"phase {self.name!r}: a name has letters, digits, '_', '-' and '.', as it names a folder.")
        for name in ("steps", "batch_size", "gradient_accumulation", "log_every"):
            if getattr(self, name) < 1:
                raise UserError(f"phase {self.name!r}: {name} is {getattr(self, name)}, expected at least 1.")
        if self.batch_size % self.gradient_accumulation:
            raise UserError(
                f"phase {self.name!r}: batch_size {self.batch_size} is no multiple of gradient_accumulation "
                f"{self.gradient_accumulation}."
            )
        _check_choice(f"phase {self.name!r}: statistics", self.statistics, STATISTICS)
        _check_choice(f"phase {self.name!r}: image_statistics", self.image_statistics, IMAGE_STATISTICS)


@dataclass
class ExperimentConfig:
    """A policy, its training phases, and where the results go.

    Attributes:
        output_dir: results; each phase gets a folder in it.
        policy: settings of a LeRobot policy: `type` and its fields, or `path` of a checkpoint and what to change.
        phases: in the order in which they run.
        seed: of everything random, together with the phase's name.
        device: `cpu`, `cuda`, `mps`, or null for the best one there is.
        mixed_precision: `no`, `bf16` or `fp16`.
    """

    name: str
    output_dir: str
    policy: dict[str, Any]
    phases: list[PhaseConfig]
    seed: int = 0
    device: str | None = None
    mixed_precision: str = "no"
    loader: LoaderConfig = field(default_factory=LoaderConfig)

    def __post_init__(self) -> None:
        if not self.phases:
            raise UserError(f"experiment {self.name!r} has no phases.")
        if "type" not in self.policy and "path" not in self.policy:
            raise UserError(
                f"experiment {self.name!r}: `policy` needs a `type`, a `file` or the `path` of a checkpoint."
            )
        _check_choice("mixed_precision", self.mixed_precision, MIXED_PRECISION)
        names = [phase.name for phase in self.phases]
        for number, phase in enumerate(self.phases):
            if phase.name in names[:number]:
                raise UserError(f"two phases are called {phase.name!r}.")
            self._check_init(phase, names, names[:number])

    def _check_init(self, phase: PhaseConfig, names: Sequence[str], earlier: Sequence[str]) -> None:
        if phase.init is None or phase.init == FROM_SCRATCH or phase.init in earlier or Path(phase.init).is_dir():
            return
        if phase.init in names:
            raise UserError(f"phase {phase.name!r} starts from {phase.init!r}, which does not come before it.")
        raise UnknownNameError(
            "start", phase.init, [FROM_SCRATCH, *earlier], f"(`init` of phase {phase.name!r}; no such folder either)"
        )

    def init_of(self, phase: PhaseConfig) -> str:
        """`from_scratch`, the name of an earlier phase, or a folder: where the phase's weights come from."""
        if phase.init is not None:
            return phase.init
        number = self.phases.index(phase)
        return self.phases[number - 1].name if number else str(self.policy.get("path", FROM_SCRATCH))


def load_experiment(path: Path, overrides: Sequence[str] = ()) -> ExperimentConfig:
    """The experiment of a file, with overrides such as `--phases.pretrain.steps=10`.

    Raises:
        UserError: a missing file, an unknown key (the closest match is named), or a value that does not fit.
    """
    data = overlay.resolve(path, parse_overrides(overrides))
    overlay.check_keys(ExperimentConfig, data, path.name)
    return decode(ExperimentConfig, data, str(path))


def to_yaml(experiment: ExperimentConfig) -> str:
    """The resolved experiment, in the same format as its file (without `defaults` and references to files)."""
    return yaml.safe_dump(dataclasses.asdict(experiment), sort_keys=False, width=120)


def _check_choice(what: str, value: str, choices: Sequence[str]) -> None:
    if value not in choices:
        raise UnknownNameError(f"value of {what}:", value, choices)
