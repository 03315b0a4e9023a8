"""Paths of the base where there is little room: between the cells of the grid, out of pockets, and with margins."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from robocasa_lerobot.demos.planning.base_path import CELL_M, search_path
from robocasa_lerobot.demos.planning.base_room import SHIFT_M, Room
from robocasa_lerobot.demos.planning.errors import ShutInError
from robocasa_lerobot.demos.skills.navigation import _legs
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

BORDER_M = 1.5


class Field(Room):
    """A square floor on which the base is a point that has no business where `inside` holds."""

    margin_m = 0.01

    def __init__(self, inside: Callable[[float, float], bool]) -> None:
        self._inside = inside

    def free_at(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        free = [max(abs(x), abs(y)) < BORDER_M and not self._inside(x, y) for x, y, _ in poses.tolist()]
        return np.array(free, dtype=np.bool_)


def went(start: RobotPose, path: Sequence[RobotPose]) -> list[tuple[float, float]]:
    """Points along a path, millimetres apart."""
    corners = np.array([(pose.x, pose.y) for pose in (start, *path)])
    points = [a + share * (b - a) for a, b in itertools.pairwise(corners) for share in np.linspace(0, 1, 100)]
    return [(float(x), float(y)) for x, y in points]


def test_what_is_thinner_than_a_cell_is_gone_round() -> None:
    def wall(x: float, y: float) -> bool:
        return 0.035 < x < 0.065 and abs(y) < 0.3  # cells lie at multiples of ten centimetres from the goal

    start, goal = RobotPose(-0.5, 0.0, 0.0), RobotPose(0.5, 0.0, 0.0)
    assert CELL_M == pytest.approx(0.10)
    path = search_path(Field(wall), start, goal)
    assert path[-1] == goal
    assert not any(wall(*point) for point in went(start, path))


def test_a_goal_that_is_shut_in_is_exchanged_for_one_that_is_not() -> None:
    goal = RobotPose(0.5, 0.0, 0.0)

    def ring(x: float, y: float) -> bool:
        return 0.05 < np.hypot(x - goal.x, y - goal.y) < 0.125

    start = RobotPose(-0.5, 0.0, 0.0)
    assert Field(ring).free(goal)
    path = search_path(Field(ring), start, goal)
    end = path[-1]
    assert 0.125 <= np.hypot(end.x - goal.x, end.y - goal.y) <= SHIFT_M + 1e-9
    assert not any(ring(*point) for point in went(start, path))


def test_where_all_goals_are_shut_in_there_is_no_path() -> None:
    def ring(x: float, y: float) -> bool:
        return 0.25 < np.hypot(x - 0.5, y) < 0.40

    with pytest.raises(ShutInError, match="no path for the base"):
        search_path(Field(ring), RobotPose(-0.5, 0.0, 0.0), RobotPose(0.5, 0.0, 0.0))


def test_steps_from_cell_to_cell_become_straight_moves_that_are_free_all_along() -> None:
    def wall(x: float, y: float) -> bool:
        return 0.035 < x < 0.065 and abs(y) < 0.3

    room, start, goal = Field(wall), RobotPose(-0.5, 0.0, 0.0), RobotPose(0.5, 0.0, 1.5)
    path = search_path(room, start, goal)
    assert all(room.closely(one, other) for one, other in itertools.pairwise([start, *path]))
    assert len(path) <= 4  # round one end of the wall, instead of ten cells and more
    steps = np.array([(pose.x, pose.y) for pose in (start, *path)])
    assert np.linalg.norm(np.diff(steps, axis=0), axis=1).sum() < 1.35


def test_a_piece_of_a_path_is_not_braked_for_where_the_next_goes_straight_on() -> None:
    poses = [RobotPose(0.45, 0.0, 0.0), RobotPose(0.45, 0.45, 0.0)]
    legs = _legs(RobotPose(0.0, 0.0, 0.0), poses)
    assert [leg.goal for leg in legs][-1] == poses[-1]
    assert [leg.beyond_m for leg in legs] == pytest.approx([0.30, 0.15, 0.0, 0.30, 0.15, 0.0])
    turning = _legs(RobotPose(0.0, 0.0, 0.0), [RobotPose(0.0, 0.0, 0.5), RobotPose(0.0, 0.0, 0.0)])
    assert [leg.beyond_rad for leg in turning] == pytest.approx([0.25, 0.0, 0.25, 0.0])
