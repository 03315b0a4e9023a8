"""Segments of sources as alternatives for the planner in a scene, which takes the one that the arm does best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.generate.course import Course
from robocasa_lerobot.demos.generate.execute import Carried, hand_now
from robocasa_lerobot.demos.generate.select import narrowed
from robocasa_lerobot.demos.generate.sources.source import Piece
from robocasa_lerobot.demos.generate.sources.transform import heading, inverse, make_pose, yaw_pose
from robocasa_lerobot.demos.motion import UP, Array, base_pose, rotation_about
from robocasa_lerobot.demos.skills.reaching import WaypointPath
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

STEEP_RAD = np.deg2rad(15.0)  # of a hand from straight down, up to which it may come turned in any way
MOST_PATHS = 200  # that are planned for


@dataclass(frozen=True)
class SegmentPath(WaypointPath):
    """A segment in this scene: `hands` are the hand's poses here at the steps from its lead to its end."""

    piece: Piece | None = None
    targets_here: tuple[Array, ...] = ()
    hands_here: tuple[Array, ...] = ()


def along(path: SegmentPath, moved: Callable[[], Array], late: Callable[[int], bool] = lambda step: False) -> Carried:
    """The segment along a path, moved by metres (3,) as what it is about has moved by then; see `Carried.late`."""
    assert path.piece is not None
    lead, count = path.piece.segment.lead, len(path.hands_here)

    def at(poses: tuple[Array, ...], step: int) -> Array:
        found: Array = make_pose(moved(), np.eye(3)) @ poses[min(step - lead, count - 1)]
        return found

    return Carried(path.piece, lambda step: at(path.targets_here, step), lambda step: at(path.hands_here, step), late)


def cheapest[P: SegmentPath](env: KitchenEnv, paths: Sequence[P], course: Course) -> list[P]:
    """The paths that are planned for: those of the sources that are selected, the cheapest of them."""

    def change(path: P) -> Array:
        assert path.piece is not None
        segment, data = path.piece.segment, path.piece.data
        position, yaw = base_pose(env.data)
        here = inverse(yaw_pose(float(position[0]), float(position[1]), yaw)) @ path.hands_here[-1]
        return inverse(inverse(data.base_pose(segment.begin)) @ data.eef[segment.end - 1]) @ here

    selected = narrowed(
        paths,
        course.manner,
        course.rng,
        source=lambda path: -1 if path.piece is None else path.piece.source.number,
        object_change=change,
        first_pose=lambda path: path.hands_here[0],
        hand=hand_now(env),
    )
    return sorted(selected, key=lambda path: path.extra)[:MOST_PATHS]


def after_letting_go(let_go: Array, last: Array, pose: Array, about: Array) -> Array:
    """A hand's pose after it has let go: away as in the source, out along its own fingers where it is flat."""
    turn = let_go[:3, :3] @ last[:3, :3].T
    flat = np.arccos(np.clip(-last[2, 2], -1.0, 1.0)) > STEEP_RAD
    way = rotation_about(UP, heading(turn)) if flat else about
    return make_pose(let_go[:3, 3] + way @ (pose[:3, 3] - last[:3, 3]), turn @ pose[:3, :3])
