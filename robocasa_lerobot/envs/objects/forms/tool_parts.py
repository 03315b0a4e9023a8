"""What cutlery and tools share."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.objects.draft import Draft
from robocasa_lerobot.envs.objects.mesh import (
    Mesh,
    cushion,
    prism,
)
from robocasa_lerobot.envs.objects.paint import Rgb

STEEL: Rgb = (0.78, 0.79, 0.81)


BLACK: Rgb = (0.12, 0.12, 0.13)


WHITE: Rgb = (0.94, 0.94, 0.92)


def flat_bar(points: list[tuple[float, float, float]], z: float) -> Mesh:
    """A flat bar along x through (x, half width, height)."""
    rows = np.asarray(points, float)
    outline = np.concatenate([rows[:, :2] * [1, -1], rows[::-1, :2]])
    mesh = prism(outline, 0.0, z)
    height = lambda v: np.interp(v[:, 0], rows[:, 0], rows[:, 2])  # noqa: E731
    return mesh.mapped(lambda v: np.column_stack([v[:, :2], v[:, 2] + height(v)]))


def grip(
    d: Draft, x0: float, x1: float, width: float, height: float, rgb: Rgb, z: float = 0.0, finish: str = "satin"
) -> None:
    """A handle with soft ends between x0 and x1, standing on z, and its collision box."""
    mesh = cushion((x1 - x0, width, height), 0.4, 0.3, 3).moved((x0 + x1) / 2, 0, z)
    d.add(mesh, rgb, finish)
    d.box((x1 - x0, width, height), ((x0 + x1) / 2, 0, z + height / 2))
