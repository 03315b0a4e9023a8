"""An experiment as typed configuration: a policy and a graph of training phases.

The file format, overrides and how a phase or a file inherits are described in `configs/README.md`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.data.mixture_config import LoaderConfig
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import check_keys, decode, parse_overrides
from robocasa_lerobot.training.config import experiment_files as overlay
from robocasa_lerobot.training.config.phase import EmaConfig, PhaseConfig, check_choice
from robocasa_lerobot.training.config.scale import ScaleConfig, load_scale, scaled

__all__ = ["FROM_SCRATCH", "HUB", "EmaConfig", "ExperimentConfig", "PhaseConfig", "load_experiment", "to_yaml"]

FROM_SCRATCH = "from_scratch"
HUB = "hub:"
FRAME_CACHE = "frame_cache"
MIXED_PRECISION = ("no", "bf16", "fp16")
TRACKERS = ("tensorboard", "trackio", "wandb")


@dataclass
class ExperimentConfig:
    """A policy, its training phases, and where the results go.

    Attributes:
        output_dir: results; each phase gets a folder in it.
        policy: settings of a LeRobot policy: `type` and its fields, or `path` of a checkpoint and what to change.
        phases: in the order in which they run; each may start from any that comes before it.
        seed: of everything random, together with the phase's name.
        device: `cpu`, `cuda`, `mps`, or null for the best one there is.
        mixed_precision: `no`, `bf16` or `fp16`.
        registry: where selections of datasets look that name no registry, and whose task sets evaluations mean that
            name none; null is the benchmark's.
        trackers: where metrics go besides `metrics.jsonl`: `tensorboard`, `trackio`, `wandb`.
        scale: what `--scale` made smaller, as a record; null is nothing.
    """

    name: str
    output_dir: str
    policy: dict[str, Any]
    phases: list[PhaseConfig]
    seed: int = 0
    device: str | None = None
    mixed_precision: str = "no"
    trackers: list[str] = field(default_factory=list)
    registry: str | None = None
    loader: LoaderConfig = field(default_factory=LoaderConfig)
    scale: ScaleConfig | None = None

    def __post_init__(self) -> None:
        if not self.phases:
            raise UserError(f"experiment {self.name!r} has no phases.")
        if "type" not in self.policy and "path" not in self.policy:
            raise UserError(
                f"experiment {self.name!r}: `policy` needs a `type`, a `file` or the `path` of a checkpoint."
            )
        if self.seed < 0:
            raise UserError(f"experiment {self.name!r}: seed is {self.seed}, expected 0 or more.")
        if self.mixed_precision == str(False):  # what YAML makes of a bare `no`
            self.mixed_precision = "no"
        check_choice("mixed_precision", self.mixed_precision, MIXED_PRECISION)
        for tracker in self.trackers:
            check_choice("trackers", tracker, TRACKERS)
        names = [phase.name for phase in self.phases]
        for number, phase in enumerate(self.phases):
            if phase.name in names[:number]:
                raise UserError(f"two phases are called {phase.name!r}.")
            self._check_init(phase, names, names[:number])
            self._check_replay(phase)

    def _check_init(self, phase: PhaseConfig, names: Sequence[str], earlier: Sequence[str]) -> None:
        init = phase.init
        known = init is None or init == FROM_SCRATCH or init in earlier or init.startswith(HUB) or Path(init).is_dir()
        if not known and init in names:
            raise UserError(f"phase {phase.name!r} starts from {init!r}, which does not come before it.")
        if not known:
            raise UnknownNameError(
                "start",
                str(init),
                [FROM_SCRATCH, *earlier],
                f"(`init` of phase {phase.name!r}; no such folder either)",
            )
        if phase.statistics is None and self.init_of(phase) != FROM_SCRATCH:
            raise UserError(
                f"phase {phase.name!r} starts from {self.init_of(phase)!r} and does not say what its inputs are "
                "normalised with: set `statistics` to `keep` (the checkpoint's, so that the same state stays the same "
                "input), `replace` (those of this phase's data) or `pool` (both)."
            )
        if phase.statistics == "pool" and self.init_of(phase) not in (FROM_SCRATCH, *earlier):
            raise UserError(
                f"phase {phase.name!r}: `statistics: pool` needs the data of what it starts from, and "
                f"{self.init_of(phase)!r} is no phase of this experiment. Set `keep` or `replace`."
            )

    def _check_replay(self, phase: PhaseConfig) -> None:
        if phase.replay is None:
            return
        earlier = [other.name for other in self.phases[: self.phases.index(phase)]]
        for name in phase.replay.phases or []:
            if name not in earlier:
                raise UnknownNameError("phase", name, earlier, f"(in `replay` of phase {phase.name!r})")
        if not phase.replay.phases and not self.ancestors(phase):
            raise UserError(f"phase {phase.name!r} has a `replay` share, but builds on no earlier phase.")

    @property
    def data_loader(self) -> LoaderConfig:
        """The loader's settings with a place for its caches: `<output_dir>/frame_cache` unless it names another."""
        if self.loader.cache_dir is not None:
            return self.loader
        return dataclasses.replace(self.loader, cache_dir=str(Path(self.output_dir) / FRAME_CACHE))

    def phase(self, name: str) -> PhaseConfig:
        """The phase of that name.

        Raises:
            UnknownNameError: there is none.
        """
        found = {phase.name: phase for phase in self.phases}
        if name not in found:
            raise UnknownNameError("phase", name, found, f"(of experiment {self.name!r})")
        return found[name]

    def init_of(self, phase: PhaseConfig) -> str:
        """`from_scratch`, an earlier phase, a folder or `hub:owner/name`: where the phase's weights come from."""
        if phase.init is not None:
            return phase.init
        number = self.phases.index(phase)
        return self.phases[number - 1].name if number else str(self.policy.get("path", FROM_SCRATCH))

    def parent(self, phase: PhaseConfig) -> PhaseConfig | None:
        """The phase whose weights this one starts from, if it starts from one."""
        init = self.init_of(phase)
        return next((other for other in self.phases if other.name == init), None)

    def ancestors(self, phase: PhaseConfig) -> list[PhaseConfig]:
        """The phases that this one builds on, the first one first."""
        parent = self.parent(phase)
        return [] if parent is None else [*self.ancestors(parent), parent]

    def replayed(self, phase: PhaseConfig) -> list[PhaseConfig]:
        """The phases whose data this one sees again."""
        if phase.replay is None:
            return []
        return [self.phase(n) for n in phase.replay.phases] if phase.replay.phases else self.ancestors(phase)


def load_experiment(path: Path, overrides: Sequence[str] = (), scale: str | None = None) -> ExperimentConfig:
    """The experiment of a file, with overrides such as `--phases.pretrain.steps=10`, at the scale of a file or name.

    Raises:
        UserError: a missing file, an unknown key (the closest match is named), or a value that does not fit.
    """
    changes = parse_overrides(overrides)
    data = overlay.resolve(path, changes)
    given = ", ".join(f"--{key}" for key, _ in changes)
    check_keys(ExperimentConfig, data, path.name if not given else f"{path.name} with {given}")
    experiment = decode(ExperimentConfig, data, str(path))
    if scale is None:
        return experiment
    asked = load_scale(scale)
    policy, phases, loader = scaled(asked, experiment.policy, experiment.phases, experiment.loader)
    return dataclasses.replace(experiment, policy=policy, phases=phases, loader=loader, scale=asked)


def to_yaml(experiment: ExperimentConfig) -> str:
    """The resolved experiment, in the same format as its file (without `base`, `defaults` and references to files)."""
    return yaml.safe_dump(dataclasses.asdict(experiment), sort_keys=False, width=120)
