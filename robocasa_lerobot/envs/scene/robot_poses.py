"""Where a robot stands in a kitchen: before which side of a fixture, and whether there is room for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, SweptBox
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.stools import SEAT_M
from robocasa_lerobot.envs.kitchens.footprints import Footprint, Footprints, Part, PlacementError, Standing
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.kitchens.plan.islands import STOOL_OUT_M
from robocasa_lerobot.envs.robots.robot import StandingShape
from robocasa_lerobot.envs.scene.roles import footprint, ground_fixture
from robocasa_lerobot.envs.scene.spec import RobotStart

# Free poses are searched for with the start's deviation, then with wider ones (docs/robocasa.md, section 6); RoboCasa
# widens without end, ours gives the layout up and takes another.
SPAWN_TRIES, SPAWN_ROUNDS = 50, 4
SPAWN_WIDENING_M = (0.10, 0.05)
FEW_TRIES = 8  # of a round, one by one: nearly always enough; the others are looked at together, which is faster
SPAWN_MARGIN_M = 0.02
_WIDE_OPEN = 0.5  # share of full travel from which on a door is in a robot's place
# How far off the nearest free place is looked for where a robot cannot stand before a fixture: in a corner.
NEAREST_M, NEAREST_STEP_M = 0.75, 0.05


@dataclass(frozen=True)
class RobotPose:
    """Where the base centre stands (metres), its heading (radians), and on which side a fixture beside it is."""

    x: float
    y: float
    yaw: float
    side: str = ""


@dataclass(frozen=True)
class Face:
    """A side of a fixture that a robot may stand at.

    Attributes:
        turn: of the side's frame from the fixture's, radians; 0 is the front.
        width, depth: of the fixture seen from there, metres.
        clearance: kept free for stools, metres.
    """

    turn: float
    width: float
    depth: float
    clearance: float = 0.0


def faces(layout: Layout, ground: Fixture, fixture: Fixture) -> list[Face]:
    """Sides of a ground fixture, the best first: the front, or for islands and tables any, at their stools last."""
    front = Face(0.0, ground.width, ground.depth)
    if not (isinstance(ground, Counter) and ground.back_face):
        return [front]
    stools = [ground.to_local(f.pos)[1] for f in layout.of_type("stool") if _belongs(ground, f)]
    room = STOOL_OUT_M + SEAT_M / 2
    front = Face(0.0, ground.width, ground.depth, room if any(y < 0 for y in stools) else 0.0)
    back = Face(np.pi, ground.width, ground.depth, room if any(y > 0 for y in stools) else 0.0)
    if layout.types[fixture.name] == "stool":
        return [back if ground.to_local(fixture.pos)[1] > 0 else front]
    if fixture is not ground:
        return [front]
    sides = [Face(turn, ground.depth, ground.width) for turn in (-np.pi / 2, np.pi / 2)]
    return sorted([front, back, *sides], key=lambda face: (face.clearance, abs(face.turn) == np.pi / 2, abs(face.turn)))


def _belongs(counter: Counter, stool: Fixture) -> bool:
    x, y = counter.to_local(stool.pos)
    return abs(x) <= counter.width / 2 and abs(y) <= counter.depth / 2 + STOOL_OUT_M + 0.05


def standing_pose(layout: Layout, fixture: Fixture, shape: StandingShape) -> RobotPose:
    """Where a robot stands to use a fixture: in line with its middle, at the usual distance of its front."""
    ground = ground_fixture(layout, fixture)
    face = faces(layout, ground, fixture)[0]
    return _pose_at(layout, ground, face, fixture.pos[:2], (0.0, 0.0), 0.0, "", shape)


def nearest_free(pose: RobotPose, layout: Layout, shape: StandingShape) -> RobotPose:
    """A pose, or the free one of its heading that is nearest to it with all doors shut; itself where there is none."""
    reach = np.arange(-NEAREST_M, NEAREST_M + 1e-9, NEAREST_STEP_M)
    shifts = sorted(((float(x), float(y)) for x in reach for y in reach), key=lambda shift: float(np.hypot(*shift)))
    poses = [pose, *(RobotPose(pose.x + x, pose.y + y, pose.yaw, pose.side) for x, y in shifts)]
    free = np.array([in_room(layout, at) for at in poses]) & Obstacles(layout.fixtures, shape).leave_free(poses)
    return poses[int(np.argmax(free))]


def _standoff(ground: Fixture, shape: StandingShape) -> float:
    return shape.standoff + ground.stand_offset_m


def _pose_at(
    layout: Layout,
    ground: Fixture,
    face: Face,
    at: tuple[float, float],
    shift: tuple[float, float],
    setback: float,
    side: str,
    shape: StandingShape,
) -> RobotPose:
    """The pose before a face of a ground fixture, in line with a point of the room, shifted right and inwards."""
    x = _turned(ground.to_local(at), -face.turn)[0] + shift[0]
    y = -face.depth / 2 - _standoff(ground, shape) - setback - face.clearance - shift[1]
    world = ground.to_world((*_turned((x, y), face.turn), 0.0))
    heading = ground.yaw + face.turn + np.pi / 2
    yaw = float(np.arctan2(np.sin(heading), np.cos(heading)))
    return RobotPose(float(world[0]), float(world[1]), yaw, side)


def robot_pose(
    rng: np.random.Generator,
    layout: Layout,
    start: RobotStart,
    fixture: Fixture,
    shape: StandingShape,
    at: tuple[float, float] | None = None,
    opened: Iterable[tuple[Fixture, float]] = (),
) -> RobotPose:
    """A free pose facing a fixture, by RoboCasa's rules, with the start's uniform deviation to all sides.

    `shape` is what the robot takes up, `at` a point of the room to stand in line with, instead of the fixture's
    middle. The robot does not stand in the open doors and drawers of those `opened`, by a share of
    their full travel.

    Raises:
        PlacementError: no pose was free.
    """
    ground = ground_fixture(layout, fixture)
    lateral = fixture.width / 2 + start.clearance
    # Standing to the left of the fixture, it is at the robot's right, and vice versa.
    options = [("right", -lateral), ("left", lateral)] if start.beside else [("", 0.0)]
    if start.setback and layout.types[fixture.name] == "fridge_bottom_freezer":
        options = [("", -start.setback)]  # clear of its doors (docs/robocasa.md, section 6)
    obstacles = Obstacles(layout.fixtures, shape, opened)
    for face in faces(layout, ground, fixture):
        half_range = np.array(start.deviation)
        for _ in range(SPAWN_ROUNDS):
            for count in (*[1] * FEW_TRIES, SPAWN_TRIES - FEW_TRIES):
                tried = []
                for _ in range(count):
                    order = rng.permutation(len(options))
                    deviation = rng.uniform(-1, 1, size=2) * half_range
                    for index in order:
                        side, offset = options[int(index)]
                        shift = (offset + float(deviation[0]), float(deviation[1]))
                        place = at or fixture.pos[:2]
                        pose = _pose_at(layout, ground, face, place, shift, start.setback, side, shape)
                        tried.append(pose)
                free = obstacles.leave_free(tried)
                if free.any():
                    return tried[int(np.argmax(free))]
            half_range = half_range + SPAWN_WIDENING_M
    raise PlacementError(f"no free place for the robot at {fixture.name}")


def _turned(point: tuple[float, float], angle: float) -> tuple[float, float]:
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return c * point[0] - s * point[1], s * point[0] + c * point[1]


class Obstacles:
    """What a robot may meet where it stands: at the height of its base, of the column above it, and of its hand."""

    def __init__(
        self, fixtures: Mapping[str, Fixture], shape: StandingShape, opened: Iterable[tuple[Fixture, float]] = ()
    ) -> None:
        doors = open_doors_of(opened)
        base, column = (_standing(fixtures, doors, top) for top in (shape.base_top, shape.column_top))
        low, high = shape.hand_z
        tall = [f for f in fixtures.values() if f.pos[2] - f.height / 2 < high and f.pos[2] + f.height / 2 > low]
        above = [door.footprint for door in doors if door.low < high and door.high > low]
        self._standing = Standing(
            [
                Part(sum(shape.base_x) / 2, _half(shape.base_x, shape.base_y[1]), base, SPAWN_MARGIN_M),
                Part(0.0, (shape.column_half, shape.column_half), column, SPAWN_MARGIN_M),
                Part(
                    sum(shape.hand_x) / 2,
                    _half(shape.hand_x, shape.hand_half),
                    Footprints([*(footprint(f) for f in tall), *above]),
                ),
            ]
        )

    def leave_free(self, poses: Sequence[RobotPose]) -> NDArray[np.bool_]:
        """Of n poses those at which the robot touches none, its arm as at the start of an episode; shape (n,)."""
        return self.leave_free_at(np.array([(pose.x, pose.y, pose.yaw) for pose in poses]))

    def leave_free_at(self, poses: NDArray[np.float64]) -> NDArray[np.bool_]:
        """The same of poses as rows of x and y in metres and yaw in radians, (n, 3)."""
        return self._standing.clear(poses)


def _half(along: tuple[float, float], across: float) -> tuple[float, float]:
    return (along[1] - along[0]) / 2, across


@dataclass(frozen=True)
class OpenDoor:
    """Where an open door or a pulled-out drawer is: on the floor plan, and from which height to which, metres."""

    footprint: Footprint
    low: float
    high: float


def _standing(fixtures: Mapping[str, Fixture], doors: list[OpenDoor], top: float) -> Footprints:
    """Fixtures but the floor, and doors, that begin below a height, metres; and handles that stand out of them."""
    standing = [f for f in fixtures.values() if f.pos[2] - f.height / 2 < top and f.name != "floor"]
    marks = [mark for f in standing for mark in (footprint(f), *_handles(f, top))]
    return Footprints([*marks, *(door.footprint for door in doors if door.low < top)])


def open_doors_of(fixtures: Iterable[tuple[Fixture, float]]) -> list[OpenDoor]:
    """The open doors and the pulled-out drawers of some fixtures, each with its share of full travel."""
    found = []
    for fixture, share in fixtures:
        for box in fixture.swept_at(share):
            low = float(fixture.to_world((0.0, 0.0, box.low))[2])
            found.append(OpenDoor(_footprint_of(fixture, box), low, low + box.height))
    return found


def _footprint_of(fixture: Fixture, box: SweptBox) -> Footprint:
    x, y, _ = fixture.to_world((*box.middle, 0.0)).tolist()
    return Footprint(x, y, fixture.yaw, box.half)


def is_free(
    layout: Layout, pose: RobotPose, shape: StandingShape, opened: Iterable[tuple[Fixture, float]] = ()
) -> bool:
    """Whether a robot can stand at a pose in the room, its arm as at the start of an episode, and touches nothing.

    Args:
        layout: the kitchen.
        pose: of the base.
        shape: of the robot.
        opened: fixtures whose doors or drawers are open, each with its share of full travel.
    """
    return in_room(layout, pose) and bool(Obstacles(layout.fixtures, shape, opened).leave_free([pose])[0])


def open_before(places: Iterable[tuple[Fixture, float, float]]) -> list[tuple[Fixture, float]]:
    """What the robot must not stand in: doors that are wide open, and drawers as far as they are out at most.

    Args:
        places: fixtures, each with the least and the greatest share of full travel by which it is open.

    Returns:
        Some of them, each with the share to leave room for.
    """
    found = []
    for fixture, low, high in places:
        if low > _WIDE_OPEN:
            found.append((fixture, 1.0))
        elif fixture.slides_out:
            found.append((fixture, high))
    return found


def in_room(layout: Layout, pose: RobotPose) -> bool:
    """Whether a base stands between the walls; its extent does not count."""
    bounds = layout.room
    return bounds["x_min"] < pose.x < bounds["x_max"] and bounds["y_min"] < pose.y < 0.0


def _handles(fixture: Fixture, top: float) -> list[Footprint]:
    """The handles of a fixture that are low enough to be met: they stand out of its box."""
    return [] if fixture.pos[2] > top else [_footprint_of(fixture, box) for box in fixture.handles_out()]
