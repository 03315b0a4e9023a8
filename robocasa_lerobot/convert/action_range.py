"""Actions beyond what robosuite's controllers take: which components have a range, and how many steps leave it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.mapping.robot_mapping import RobotMapping

# A full command is 1; controllers clip greater values. A little beyond is rounding and noise, more is another unit.
FULL_COMMAND = 1.0
FAR = 1.05


def out_of_range(mapping: RobotMapping, actions: Iterable[NDArray[Any]]) -> dict[str, Any] | None:
    """How many of the steps of `actions`, runs of (T, A), leave the range, as kept in `conversion.json`.

    Gives None for robots of which nothing is known about the unit of any component (those of mapping files, real ones).
    """
    parts = mapping.action_parts
    bounded = np.concatenate([np.full(part.size, _is_command(mapping, part)) for part in parts])
    if not bounded.any():
        return None
    largest = np.zeros(len(bounded))
    outside = steps = 0
    for run in actions:
        sizes = np.where(bounded, np.abs(run.reshape(len(run), -1)), 0.0)
        outside += int((sizes > FAR).any(axis=1).sum())
        steps += len(sizes)
        largest = np.maximum(largest, sizes.max(axis=0, initial=0.0))
    return {
        "range": [-FULL_COMMAND, FULL_COMMAND],
        "counted_beyond": FAR,
        "steps": outside,
        "share": outside / steps,
        "largest": float(largest.max()),
        "component": contract.component_names(parts)[int(largest.argmax())],
    }


def warning_of(found: dict[str, Any] | None) -> str | None:
    """A sentence for the user where steps leave the range, else None."""
    if not found or not found["steps"]:
        return None
    return (
        f"{found['share']:.1%} of the steps ({found['steps']}) have actions outside of [-1, 1], up to "
        f"{found['largest']:.3g} in {found['component']}: controllers clip them, or they are in "
        "another unit. They are kept as they are."
    )


def _is_command(mapping: RobotMapping, part: Part) -> bool:
    return mapping.unit_commands and not part.name.endswith("_absolute")
