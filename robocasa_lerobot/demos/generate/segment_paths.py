"""Segments of sources as alternatives for the planner in a scene, which takes the one that the arm does best."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.generate.course import Course
from robocasa_lerobot.demos.generate.execute import Carried, as_target, hand_now
from robocasa_lerobot.demos.generate.select import narrowed
from robocasa_lerobot.demos.generate.sources.source import Piece
from robocasa_lerobot.demos.generate.sources.transform import heading, inverse, make_pose, yaw_pose
from robocasa_lerobot.demos.motion import UP, Array, HandTarget, base_pose, rotation_about
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.reaching import Held, MotionPlan, WaypointPath, plan_reach
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

STEEP_RAD = np.deg2rad(15.0)  # of a hand from straight down, up to which it may come turned in any way
MOST_PATHS, EACH_PATHS = 200, 10  # that are planned for; of each source, the best ones, first


@dataclass(frozen=True, kw_only=True)
class SegmentPath(WaypointPath):
    """A segment in this scene.

    Attributes:
        piece: the segment.
        hand: pose (4, 4) of the hand here at a step of the source, from the segment's lead to before its end.
        target: the same of where the controller is led to.
    """

    piece: Piece
    hand: Callable[[int], Array]
    target: Callable[[int], Array]

    @property
    def first(self) -> Array:
        """The hand's pose (4, 4) that it begins with."""
        return self.hand(self.piece.segment.lead)


def poses_at(piece: Piece, hand: Callable[[int], Array], steps: Iterable[int]) -> tuple[HandTarget, ...]:
    """The hand's poses at steps of a segment, or at its last one, for a planner."""
    return tuple(as_target(hand(min(step, piece.segment.end - 1))) for step in steps)


def led_ahead(piece: Piece, hand: Array, about: Array, step: int) -> Array:
    """Where the controller is led to (4, 4): as far ahead of the hand (4, 4) as in the source, turned by `about`."""
    eef, target = piece.data.eef[step], piece.data.target[step]
    ahead = about @ (target[:3, 3] - eef[:3, 3])
    return make_pose(hand[:3, 3] + ahead, hand[:3, :3] @ eef[:3, :3].T @ target[:3, :3])


def along(
    path: SegmentPath,
    moved: Callable[[], Array] = lambda: np.zeros(3),
    late: Callable[[int], bool] = lambda step: False,
) -> Carried:
    """The segment along a path, moved by metres (3,) as what it is about has moved by then; see `Carried.late`."""
    last = path.piece.segment.end - 1

    def at(pose: Callable[[int], Array], step: int) -> Array:
        found: Array = make_pose(moved(), np.eye(3)) @ pose(min(step, last))
        return found

    return Carried(path.piece, lambda step: at(path.target, step), lambda step: at(path.hand, step), late)


def cheapest[P: SegmentPath](env: KitchenEnv, paths: Sequence[P], course: Course) -> list[P]:
    """The paths that are planned for: those of the sources that are selected, the cheapest of them."""

    def change(path: P) -> Array:
        segment, data = path.piece.segment, path.piece.data
        position, yaw = base_pose(env.data)
        here = inverse(yaw_pose(float(position[0]), float(position[1]), yaw)) @ path.hand(segment.end - 1)
        return inverse(inverse(data.base_pose(segment.begin)) @ data.eef[segment.end - 1]) @ here

    selected = narrowed(
        paths,
        course.manner,
        course.rng,
        source=lambda path: path.piece.source.number,
        object_change=change,
        first_pose=lambda path: path.first,
        hand=hand_now(env),
    )
    ordered = sorted(selected, key=lambda path: path.extra)
    # Some of every source: those that are not drawn are for what the others cannot do.
    count: Counter[int] = Counter()
    first: list[P] = []
    rest: list[P] = []
    for path in ordered:
        count[path.piece.source.number] += 1
        (first if count[path.piece.source.number] <= EACH_PATHS else rest).append(path)
    return sorted((first + rest)[:MOST_PATHS], key=lambda path: path.extra)


def best_plan(
    env: KitchenEnv,
    course: Course,
    paths: Sequence[SegmentPath],
    point: Array,
    blocked: Sequence[RobotPose],
    *,
    key: int,
    allowed: frozenset[int],
    lacking: str,
    held: Held | None = None,
    loaded: int = 0,
    most: float = np.inf,
) -> MotionPlan:
    """The best of the paths, from where the robot stands or from where it may go; see `plan_reach`.

    Raises:
        SkillError: none is within reach, or none for less than a cost of `most`: that is `lacking`.
    """
    may_drive = course.manner.base != "fixed"
    found = plan_reach(
        env, paths, point, key=key, held=held, loaded=loaded, allowed=allowed, blocked=blocked, may_drive=may_drive
    )
    if not found or found[0].cost - found[0].path.drawn > most:
        raise SkillError(lacking)
    return found[0]


def after_letting_go(let_go: Array, last: Array, pose: Array, about: Array) -> Array:
    """A hand's pose after it has let go: away as in the source, out along its own fingers where it is flat."""
    turn = let_go[:3, :3] @ last[:3, :3].T
    flat = np.arccos(np.clip(-last[2, 2], -1.0, 1.0)) > STEEP_RAD
    way = rotation_about(UP, heading(turn)) if flat else about
    return make_pose(let_go[:3, 3] + way @ (pose[:3, 3] - last[:3, 3]), turn @ pose[:3, :3])
