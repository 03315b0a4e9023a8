"""How the hand may come to an object, grasp it and leave with it; and which grasps of it have failed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, HandTarget, base_pose, nearer_turn
from robocasa_lerobot.demos.planning.grasps import GraspPose
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, grasps
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

OUT_M = 0.25
LIFT_M, HOVER_M = 0.12, 0.12
LIFTS_M = (0.035, 0.010)  # before it is drawn out of a front
WORSE_GRASP, DOUBTFUL = 0.45, 1.3
STEEP = 0.5  # sine of a slope
TRIED, ALIKE_M = 1.2, 0.015  # cost of a grasp like one that has failed: its place in the object is as near as this
ALIKE_COS = float(np.cos(np.deg2rad(25.0)))  # of the angle between hands that hold alike


@dataclass(frozen=True)
class GraspStrategy:
    """How an object is grasped.

    Attributes:
        tilts: of the hand's approach from straight down to straight ahead, radians, with their costs.
        entries: whether the hand may come from above ("up"), or out of the front ("out" rises a little, "level" does
            not), or between ("across"), or along its fingers ("along").
        out_m: how far it goes along its path out, metres.
        hover_m, lift_m: how far over the grasp the hand comes from, and lifts to, where it comes from above, metres.
        lifts: before it is drawn out of a front, metres.
        turns: of a tilted approach from the base's heading to the left, radians.
        worse_grasp: cost of a grasp's score below the best one's.
        among_tilts: whether that is the best of all tilts, not of its own.
        narrow: whether the hand keeps to straight lines also where these are steep, does not press down, and goes
            after an object that it moves by its coming: in a drawer, which yields.
        poses: grasps of an object by a hand that comes along an approach.
        first: done before each attempt.
        nearer: how far an object may be put down again nearer to the robot than it lies, metres.
        doubtful: cost of a path from which on it rather is, though it is held.
        close_fit: whether an object is about as wide as the open hand, which comes up to it the more exactly, and goes
            after it where it is pushed on.
    """

    tilts: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    entries: tuple[str, ...] = ("up",)
    out_m: float = OUT_M
    hover_m: float = HOVER_M
    lift_m: float = LIFT_M
    lifts: tuple[float, ...] = LIFTS_M
    turns: tuple[float, ...] = (0.0,)
    worse_grasp: float = WORSE_GRASP
    among_tilts: bool = False
    narrow: bool = False
    poses: Callable[[KitchenEnv, Graspable, Array], list[GraspPose]] = grasps
    first: Callable[[KitchenEnv], Iterator[Array]] | None = None
    nearer: Callable[[KitchenEnv], float] | None = None
    doubtful: float = DOUBTFUL
    close_fit: bool = False


def in_radians(*tilts: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """Tilts given in degrees, with their costs, as strategies have them."""
    return tuple((float(np.deg2rad(tilt)), cost) for tilt, cost in tilts)


FROM_ABOVE = GraspStrategy(((0.0, 0.0), (np.deg2rad(30.0), 0.25)))
ANY_APPROACH = GraspStrategy(
    ((0.0, 0.0), (np.deg2rad(35.0), 0.1), (np.deg2rad(65.0), 0.2), (np.deg2rad(88.0), 0.3)), ("up", "across", "out")
)
# Of what is about as high as the room between a fridge's shelves, or goes far in: a hand over it would meet the one
# above.
_TIGHT_TILTS = in_radians((50, 0.0), (65, 0.0), (40, 0.1), (80, 0.1), (25, 0.3), (0, 0.6))
FOR_A_TIGHT_SHELF = replace(ANY_APPROACH, tilts=_TIGHT_TILTS, among_tilts=True)
# Of what is stacked between shelves, where it may not lean: the lower the hand behind it, the better.
_STACK_TILTS = in_radians((80, 0.0), (65, 0.0), (88, 0.1), (50, 0.2), (25, 0.5), (0, 0.8))
FOR_A_STACK = replace(ANY_APPROACH, tilts=_STACK_TILTS, among_tilts=True)
# Out of a slot in whose plane the hand may lean, below a wall cabinet.
FROM_A_SLOT = GraspStrategy(
    ((0.0, 0.0), (np.deg2rad(35.0), 0.1), (np.deg2rad(50.0), 0.2), (np.deg2rad(65.0), 0.3)),
    ("across", "out"),
    lifts=(0.06,),
    turns=(0.0, np.pi / 2, -np.pi / 2),
)
# Out of a drawer below a shelf, whose hind part the shelf covers.
FROM_CRISPER = GraspStrategy(
    in_radians((35, 0.0), (50, 0.1), (20, 0.1), (65, 0.2), (5, 0.2)),
    ("along",),
    narrow=True,
)
# Out of a drawer, whose hind part is below the counter: straight up to over its top.
OUT_OF_DRAWER = GraspStrategy(
    ((0.0, 0.0), (np.deg2rad(20.0), 0.1), (np.deg2rad(30.0), 0.2), (np.deg2rad(45.0), 0.3)),
    ("up", "across"),
    out_m=0.30,
    narrow=True,
    hover_m=0.26,
    lift_m=0.30,
)


def steep(one: HandTarget, other: HandTarget) -> bool:
    """Whether the line between two poses goes up or down rather than through a front."""
    away = other.position - one.position
    return abs(float(away @ UP)) > STEEP * float(np.linalg.norm(away))


def ahead_of(env: KitchenEnv) -> Array:
    """Unit vector (3,) along the base's heading."""
    _, yaw = base_pose(env.data)
    return np.array([np.cos(yaw), np.sin(yaw), 0.0])


def entry(env: KitchenEnv, name: str) -> Array:
    """Unit vector out of where an object is: "up", "out" or "level" to the robot, or "across" between the two."""
    ahead = ahead_of(env)
    out = {"up": UP, "out": 0.1 * UP - ahead, "across": UP - ahead, "level": -ahead}[name]
    unit: Array = out / np.linalg.norm(out)
    return unit


@dataclass(frozen=True)
class _Grasp:
    """A pose of the hand in an object's axes, metres; `slid` where the object slid out, which others there may hold."""

    position: Array
    rotation: Array
    slid: bool = False


@dataclass
class TriedGrasps:
    """What has failed with one object."""

    _grasps: list[_Grasp] = field(default_factory=list)

    def note(self, grasp: _Grasp, *, slid: bool = False) -> None:
        """Keep a grasp as `in_object` gave it."""
        self._grasps.append(_Grasp(grasp.position, grasp.rotation, slid))

    def cost(self, env: KitchenEnv, obj: Graspable, hand: HandTarget) -> float:
        """What a hand at a pose costs for the ones that it is like."""
        return TRIED * sum(_alike(in_object(env, obj, hand), other) for other in self._grasps) if self._grasps else 0.0


def in_object(env: KitchenEnv, obj: Graspable, hand: HandTarget) -> _Grasp:
    """Where a hand is in an object's axes."""
    body = env.data.body(obj.name)
    back = body.xmat.reshape(3, 3).T
    return _Grasp(back @ (hand.position - body.xpos), back @ hand.rotation)


def _alike(grasp: _Grasp, other: _Grasp) -> bool:
    if np.linalg.norm(grasp.position - other.position) >= ALIKE_M:
        return False
    if not other.slid:
        return True
    turn = nearer_turn(grasp.rotation, other.rotation).T @ other.rotation
    return bool((np.trace(turn) - 1) / 2 > ALIKE_COS)
