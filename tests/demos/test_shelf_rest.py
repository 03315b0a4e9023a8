"""Where a leaning object comes to rest on a shelf: upright again, or toppled towards where it leans."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from robocasa_lerobot.demos.motion import Array, rotation_about
from robocasa_lerobot.demos.skills.pick_place.poses.shelf_rest import rest_of

HALF, TALL = 0.03, 0.09  # half sizes of a box like a bottle, metres


def _leaning(degrees: float) -> Array:
    """Corners of a box that leans towards x."""
    box = np.array(list(itertools.product((-HALF, HALF), (-HALF, HALF), (-TALL, TALL))))
    corners: Array = box @ rotation_about(np.array([0.0, 1.0, 0.0]), float(np.deg2rad(degrees))).T
    return corners


@pytest.mark.parametrize("degrees", [0.0, 6.0, 12.0])
def test_what_leans_a_little_stands(degrees: float) -> None:
    points, _, _ = rest_of(_leaning(degrees), np.zeros(3))
    assert np.ptp(points[:, 2]) == pytest.approx(2 * TALL, abs=0.01)


@pytest.mark.parametrize("degrees", [30.0, 55.0])
def test_what_leans_far_topples_that_way(degrees: float) -> None:
    start = _leaning(degrees)
    points, middle, fall = rest_of(start, np.zeros(3))
    assert np.ptp(points[:, 2]) == pytest.approx(2 * HALF, abs=0.02)
    assert fall > 0.02
    assert middle[0] > 0.02
    assert points[:, 2].min() == pytest.approx(start[:, 2].min(), abs=1e-9)
    assert points[:, 0].max() > start[:, 0].max()
