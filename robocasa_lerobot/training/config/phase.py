"""One training phase as typed configuration; `configs/README.md` shows how phases make an experiment."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from robocasa_lerobot.data.mixture_config import MixtureConfig
from robocasa_lerobot.errors import UnknownNameError, UserError

STATISTICS = ("keep", "replace", "pool")
IMAGE_STATISTICS = ("dataset", "imagenet")


@dataclass
class EmaConfig:
    """Exponential moving average of the weights; decay = 1 - (1 + step / inv_gamma) ** -power, within bounds.

    The defaults are those of the benchmark's Diffusion Policy. With it, checkpoints hold the averaged weights. A
    constant decay is `min_decay` equal to `max_decay`.
    """

    enabled: bool = True
    power: float = 0.75
    inv_gamma: float = 1.0
    min_decay: float = 0.0
    max_decay: float = 0.9999

    def __post_init__(self) -> None:
        for name in ("power", "inv_gamma"):  # with another power, no step would ever be averaged
            if not 0 < getattr(self, name) < math.inf:
                raise UserError(f"ema: {name} is {getattr(self, name)}, expected more than 0.")
        if not 0 <= self.min_decay <= self.max_decay <= 1:
            raise UserError(
                f"ema: min_decay is {self.min_decay} and max_decay {self.max_decay}, expected 0 <= min_decay <= "
                "max_decay <= 1."
            )


@dataclass
class LoraConfig:
    """Low-rank adaptation (Hu et al. 2021): W + alpha / rank * B A with trained A and B, everything else frozen.

    Attributes:
        rank: rows of A and columns of B.
        alpha: scale of the change; null is `rank`, that is, a factor of 1.
        dropout: of the change's weights while training.
        targets: patterns (`*`, `?`) of the names of linear layers that are adapted; null is all that the policy
            trains without it, so not what it keeps frozen by itself.
        train: patterns of parameters that are trained fully beside them, such as a head.
    """

    rank: int = 16
    alpha: float | None = None
    dropout: float = 0.0
    targets: list[str] | None = None
    train: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.rank < 1:
            raise UserError(f"lora: rank is {self.rank}, expected at least 1.")
        if self.alpha is not None and not math.isfinite(self.alpha):
            raise UserError(f"lora: alpha is {self.alpha}, expected a number.")
        if not 0 <= self.dropout < 1:
            raise UserError(f"lora: dropout is {self.dropout}, expected at least 0 and below 1.")


@dataclass
class ReplayConfig:
    """Samples of earlier phases among those of this one.

    Attributes:
        share: of the samples, split equally among the phases.
        phases: which ones; null is all that this phase builds on.
    """

    share: float = 0.2
    phases: list[str] | None = None

    def __post_init__(self) -> None:
        if not 0 < self.share < 1:
            raise UserError(f"replay: share is {self.share}, expected a number between 0 and 1.")


@dataclass
class HeldOutConfig:
    """Episodes that are left out of the training, to measure the loss on them for each task.

    Attributes:
        share: of the episodes of each task; none of a task with fewer than those of which this is one.
        every: optimiser steps between measurements; the last step always has one.
        samples: frames of each task that are measured, the same ones every time.
    """

    share: float = 0.05
    every: int = 1000
    samples: int = 64

    def __post_init__(self) -> None:
        if not 0 < self.share < 1:
            raise UserError(f"held_out: share is {self.share}, expected a number between 0 and 1.")
        if self.every < 1 or self.samples < 1:
            raise UserError("held_out: `every` and `samples` are at least 1.")


@dataclass
class AugmentConfig:
    """Changes of the pictures while training, drawn for each sample and camera, the same over its time steps.

    Attributes:
        crop: side of a random crop, which is scaled back to the full size, as a part of the picture's; 1 is none.
        rotate: largest angle in degrees.
        brightness: factor within 1 - b .. 1 + b.
        contrast: likewise, around the picture's mean grey.
        saturation: likewise, around each pixel's grey.
        hue: turn of the hue within -h .. h, in full turns.
        crop_cameras: patterns of the cameras that are cropped and rotated; null is all.
        blank: share of the samples in which a camera's pictures are plain grey, drawn for each camera on its own. A
            view of the whole room tells kitchens apart, and a policy that knows the kitchen by heart looks no more.
        blank_cameras: patterns of the cameras that this happens to; null is all.
        mirror: share of the samples that are seen in a mirror: pictures, state, actions and `left` and `right` in the
            instruction. For data of PandaOmron, with both cameras beside the hand.
    """

    crop: float = 1.0
    rotate: float = 0.0
    brightness: float = 0.0
    contrast: float = 0.0
    saturation: float = 0.0
    hue: float = 0.0
    crop_cameras: list[str] | None = None
    blank: float = 0.0
    blank_cameras: list[str] | None = None
    mirror: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.crop <= 1:
            raise UserError(f"augment: crop is {self.crop}, expected more than 0 and at most 1.")
        for name in ("rotate", "brightness", "contrast", "saturation", "hue"):
            if getattr(self, name) < 0:
                raise UserError(f"augment: {name} is {getattr(self, name)}, expected 0 or more.")
        for name in ("blank", "mirror"):
            if not 0 <= getattr(self, name) < 1:
                raise UserError(f"augment: {name} is {getattr(self, name)}, expected 0 or more and less than 1.")


@dataclass
class PhaseConfig:
    """One training run of the experiment.

    Attributes:
        name: names the phase's folder and lets other phases start from it.
        mixture: the data.
        steps: optimiser steps.
        init: `from_scratch`, the name of an earlier phase, a `pretrained_model` folder, or `hub:owner/name`; null is
            the previous phase, or for the first one `policy.path` if the experiment has it, else `from_scratch`.
        statistics: of normalisation; must be said by a phase that starts from a checkpoint: `keep` the
            checkpoint's, `replace` them by those of this phase's data (the policy then sees the same state as
            another input), or `pool` the data of this phase and of those it builds on.
        image_statistics: `dataset`, or `imagenet` for encoders trained on ImageNet.
        policy: settings of the policy that this phase changes.
        freeze: patterns (`*`, `?`) of the names of parameters, or of modules holding them, that are not trained.
        lora: train low-rank changes only. Checkpoints hold the changed weights as an ordinary policy.
        replay: samples of earlier phases among those of this one.
        batch_size: samples per optimiser step, over all processes and accumulated parts.
        gradient_accumulation: parts in which a batch goes through the policy, one after the other.
        learning_rate: null is the policy's own; otherwise the rates of all parameter groups are scaled alike.
        warmup_steps: null is the policy's own schedule's; a rate without a schedule is constant after them.
        optimizer: fields of the policy's own optimiser that this phase changes, such as `weight_decay`; with a
            `type`, another of LeRobot's optimisers.
        scheduler: likewise for the schedule of the learning rate; `type: none` keeps the rate constant.
        schedule_steps: steps that the schedule is made for; null is `steps`.
        drop_last_frames: frames at the end of each episode that start no sample; null is what the policy asks for.
        grad_clip_norm: largest gradient norm; null is the policy's own, 0 is none.
        save_every: steps between checkpoints; the last step always has one. 0 is the last step only.
        save_initial: also keep the policy before the first step, as checkpoint 000000.
        keep_last: newest checkpoints that are kept; 0 keeps all. The initial one always stays.
        keep_every: checkpoints of every so many steps are kept, whatever `keep_last` says; 0 is none.
        log_every: steps that a line of metrics.jsonl averages over.
        ema: moving average of the weights.
        augment: changes of the pictures.
        held_out: loss on episodes that are not trained on.
        compile: translate the policy with `torch.compile`; first steps take minutes, and later ones less time.
        evaluations: evaluation files that are run on the finished phase with `--evaluate`, by name or path; settings
            of them may follow, as in `lifelong --policy.lifelong_phase=2`.
    """

    name: str
    mixture: MixtureConfig
    steps: int
    init: str | None = None
    statistics: str | None = None
    image_statistics: str = "dataset"
    policy: dict[str, Any] = field(default_factory=dict)
    freeze: list[str] = field(default_factory=list)
    lora: LoraConfig | None = None
    replay: ReplayConfig | None = None
    batch_size: int = 32
    gradient_accumulation: int = 1
    learning_rate: float | None = None
    warmup_steps: int | None = None
    optimizer: dict[str, Any] = field(default_factory=dict)
    scheduler: dict[str, Any] = field(default_factory=dict)
    schedule_steps: int | None = None
    drop_last_frames: int | None = None
    grad_clip_norm: float | None = None
    save_every: int = 0
    save_initial: bool = False
    keep_last: int = 0
    keep_every: int = 0
    log_every: int = 10
    ema: EmaConfig = field(default_factory=EmaConfig)
    augment: AugmentConfig | None = None
    held_out: HeldOutConfig | None = None
    compile: bool = False
    evaluations: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", self.name):
            raise UserError(f"phase {self.name!r}: a name has letters, digits, '_', '-' and '.', as it names a folder.")
        for name in ("steps", "batch_size", "gradient_accumulation", "log_every"):
            if getattr(self, name) < 1:
                raise UserError(f"phase {self.name!r}: {name} is {getattr(self, name)}, expected at least 1.")
        for name in ("save_every", "keep_last", "keep_every", "drop_last_frames"):
            if (getattr(self, name) or 0) < 0:
                raise UserError(f"phase {self.name!r}: {name} is {getattr(self, name)}, expected 0 or more.")
        if self.batch_size % self.gradient_accumulation:
            raise UserError(
                f"phase {self.name!r}: batch_size {self.batch_size} is no multiple of gradient_accumulation "
                f"{self.gradient_accumulation}."
            )
        for name in ("learning_rate", "warmup_steps", "schedule_steps", "grad_clip_norm"):
            if not 0 <= (getattr(self, name) or 0) < math.inf:
                raise UserError(f"phase {self.name!r}: {name} is {getattr(self, name)}, expected 0 or more.")
        if self.lora is not None and self.freeze:
            raise UserError(f"phase {self.name!r}: `lora` freezes everything but its own weights; leave `freeze` out.")
        if self.statistics is not None:
            check_choice(f"phase {self.name!r}: statistics", self.statistics, STATISTICS)
        check_choice(f"phase {self.name!r}: image_statistics", self.image_statistics, IMAGE_STATISTICS)


def check_choice(what: str, value: str, choices: Sequence[str]) -> None:
    """Raise an UnknownNameError unless `value` is one of `choices`."""
    if value not in choices:
        raise UnknownNameError(f"value of {what}:", value, choices)
