"""Where a checkpoint comes from, in a file inside it: experiment, phase and step stay known wherever it is copied."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ORIGIN_FILE = "origin.json"
_TRAIN_CONFIG = "train_config.json"


@dataclass(frozen=True)
class Origin:
    """The experiment and its phase that made a checkpoint, and after how many optimiser steps; None: not known."""

    experiment: str | None = None
    phase: str | None = None
    step: int | None = None

    def write(self, pretrained: Path) -> None:
        """Write `origin.json` into a `pretrained_model` folder."""
        (pretrained / ORIGIN_FILE).write_text(json.dumps(asdict(self), indent=2) + "\n", encoding="utf-8")


def read_origin(pretrained: Path) -> Origin:
    """What a `pretrained_model` folder says about its making.

    `origin.json` has all of it. A checkpoint without one is asked where it lies
    (`<phase>/checkpoints/<step>/pretrained_model`), and LeRobot's `train_config.json` what the job was called.
    """
    folder = pretrained.resolve()
    said = _mapping(folder / ORIGIN_FILE)
    if said:
        experiment, phase, step = (said.get(name) for name in ("experiment", "phase", "step"))
        return Origin(_text(experiment), _text(phase), step if isinstance(step, int) else None)
    phase = step = None
    checkpoint = folder.parent
    if folder.name == "pretrained_model" and checkpoint.parent.name == "checkpoints" and checkpoint.name.isdigit():
        phase, step = checkpoint.parent.parent.name, int(checkpoint.name)
    return Origin(_experiment_of_job(_mapping(folder / _TRAIN_CONFIG)), phase, step)


def experiment_of(job: str | None, phase: str) -> str | None:
    """The experiment's name in that of a job, `<experiment>_<phase>`; None where it is called otherwise."""
    if not job or not job.endswith(f"_{phase}"):
        return None
    return job.removesuffix(f"_{phase}") or None


def _experiment_of_job(config: dict[str, Any]) -> str | None:
    output = _text(config.get("output_dir"))
    return experiment_of(_text(config.get("job_name")), Path(output).name) if output else None


def _mapping(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return values if isinstance(values, dict) else {}


def _text(value: object) -> str | None:
    return value if isinstance(value, str) and value else None
