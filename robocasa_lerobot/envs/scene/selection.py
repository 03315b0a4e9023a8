"""Which fixture plays a role in a task, where the robot stands, and which surface an object starts on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.envs.placement import Area, Footprint, PlacementError
from robocasa_lerobot.envs.scene.fixtures.base import Fixture
from robocasa_lerobot.envs.scene.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.scene.fixtures.counters import Counter, Sink
from robocasa_lerobot.envs.scene.fixtures.room import Slab, Window
from robocasa_lerobot.envs.scene.layout import Layout
from robocasa_lerobot.envs.task import InsideOf, OnCounter, RobotStart
from robocasa_lerobot.errors import UnknownNameError

# Distance of the base centre from the front edge of the counter that it faces, metres (robocasa facts, section 6).
ROBOT_STANDOFF_M = 0.20
BESIDE_CLEARANCE_M = 0.20
# Free poses are searched for with the start's deviation, then with wider ones (robocasa facts, section 6); RoboCasa
# widens without end, ours gives the layout up and takes another.
SPAWN_TRIES, SPAWN_ROUNDS = 50, 4
SPAWN_WIDENING_M = (0.10, 0.05)
SPAWN_MARGIN_M = 0.02
# Box of the mobile base around the base centre, in its own frame (x forward): bounds in metres.
BASE_BOX_X, BASE_BOX_Y = (-0.55, 0.15), (-0.25, 0.25)
BASE_TOP_M = 0.38
# Half size of the column above it, around the base centre, and the height that counts as its way.
COLUMN_HALF_M, COLUMN_TOP_M = 0.13, 1.0
MIN_REGION_WIDTH_M = 0.12

FIXTURE_KINDS: dict[str, Callable[[Fixture], bool]] = {
    # Top drawers have their middle between 0.7 and 0.9 m (robocasa facts, section 6).
    "drawer_top": lambda f: isinstance(f, Drawer) and 0.7 <= f.pos[2] <= 0.9,
    "drawer": lambda f: isinstance(f, Drawer),
    "sink": lambda f: isinstance(f, Sink),
    "counter": lambda f: isinstance(f, Counter),
}


@dataclass(frozen=True)
class RobotPose:
    """Where the base centre stands (metres), its heading (radians), and on which side a fixture beside it is."""

    x: float
    y: float
    yaw: float
    side: str = ""

    def footprint(self) -> Footprint:
        """The mobile base on the floor plan."""
        along, half_x = (BASE_BOX_X[0] + BASE_BOX_X[1]) / 2, (BASE_BOX_X[1] - BASE_BOX_X[0]) / 2
        centre = self.x + np.cos(self.yaw) * along, self.y + np.sin(self.yaw) * along
        return Footprint(float(centre[0]), float(centre[1]), self.yaw, (half_x, BASE_BOX_Y[1]))


def candidates(layout: Layout, kind: str) -> list[Fixture]:
    """Fixtures of a kind, in the layout's order.

    Raises:
        UnknownNameError: no such kind.
    """
    if kind not in FIXTURE_KINDS:
        raise UnknownNameError("fixture kind", kind, FIXTURE_KINDS)
    return [f for f in layout.fixtures.values() if FIXTURE_KINDS[kind](f)]


def counter_of(layout: Layout, fixture: Fixture) -> Counter:
    """The counter above a base fixture, or around a sink."""
    for counter in layout.fixtures.values():
        if isinstance(counter, Counter):
            local = _into(counter, fixture.pos[0], fixture.pos[1])
            if abs(local[0]) <= counter.width / 2 and abs(local[1]) <= counter.depth / 2:
                return counter
    raise AssertionError(f"{fixture.name} stands under no counter")


def robot_pose(rng: np.random.Generator, layout: Layout, start: RobotStart, fixture: Fixture) -> RobotPose:
    """A free pose facing a fixture, by RoboCasa's rules, with the start's uniform deviation to all sides.

    Raises:
        PlacementError: no pose was free.
    """
    counter = counter_of(layout, fixture)
    local_x = _into(counter, fixture.pos[0], fixture.pos[1])[0]
    lateral = fixture.width / 2 + BESIDE_CLEARANCE_M
    # Standing to the left of the fixture, it is at the robot's right, and the other way round.
    options = [("right", -lateral), ("left", lateral)] if start.beside else [("", 0.0)]
    half_range = np.array(start.deviation)
    for _ in range(SPAWN_ROUNDS):
        for _ in range(SPAWN_TRIES):
            order = rng.permutation(len(options))
            deviation = rng.uniform(-1, 1, size=2) * half_range
            for index in order:
                side, offset = options[int(index)]
                x = local_x + offset + float(deviation[0])
                y = -counter.depth / 2 - ROBOT_STANDOFF_M - float(deviation[1])
                world = counter.to_world((x, y, 0.0))
                pose = RobotPose(float(world[0]), float(world[1]), counter.yaw + np.pi / 2, side)
                if not _blocked(layout, pose):
                    return pose
        half_range = half_range + SPAWN_WIDENING_M
    raise PlacementError(f"no free place for the robot at {fixture.name}")


def is_free(fixtures: Mapping[str, Fixture], pose: RobotPose) -> bool:
    """Whether the robot can stand at a pose without touching a fixture."""
    column = Footprint(pose.x, pose.y, pose.yaw, (COLUMN_HALF_M, COLUMN_HALF_M))
    for body, top in ((pose.footprint(), BASE_TOP_M), (column, COLUMN_TOP_M)):
        standing = [f for f in fixtures.values() if f.pos[2] - f.height / 2 < top and f.name != "floor"]
        if any(body.overlaps(footprint(f), SPAWN_MARGIN_M) for f in standing):
            return False
    return True


def _blocked(layout: Layout, pose: RobotPose) -> bool:
    return not is_free(layout.fixtures, pose)


def footprint(fixture: Fixture) -> Footprint:
    """A fixture's box on the floor plan."""
    return Footprint(fixture.pos[0], fixture.pos[1], fixture.yaw, (fixture.width / 2, fixture.depth / 2))


def counter_areas(layout: Layout, start: OnCounter, near: Fixture) -> tuple[list[Area], list[Footprint]]:
    """The rectangles of the counter that a start allows, and what already stands on the counter."""
    counter = counter_of(layout, near)
    near_x = _into(counter, near.pos[0], near.pos[1])[0]
    width, depth = start.size
    shift_x, shift_y = start.offset
    if start.at == "front":
        y0 = -counter.depth / 2 + shift_y
        y1 = min(y0 + depth, counter.depth / 2)
    else:
        y1 = counter.depth / 2 - shift_y
        y0 = max(y1 - depth, -counter.depth / 2)
    half = near.width / 2
    spans = {
        "above": [(near_x - width / 2, near_x + width / 2)],
        "left_right": [(near_x - half - width, near_x - half), (near_x + half, near_x + half + width)],
    }[start.loc]
    areas = []
    for low, high in spans:
        x0, x1 = max(low + shift_x, -counter.width / 2), min(high + shift_x, counter.width / 2)
        if x1 - x0 >= MIN_REGION_WIDTH_M:
            areas.append(Area(x0, x1, y0, y1, counter.pos[:2], counter.yaw, counter.surface_z))
    if not areas:
        raise PlacementError(f"no room on {counter.name} near {near.name}")
    occupied = [
        footprint(f)
        for f in layout.fixtures.values()
        if not isinstance(f, Counter | Slab | Window)
        and f.pos[2] + f.height / 2 > counter.surface_z - 0.005
        and f.pos[2] - f.height / 2 < counter.surface_z + 0.3
    ]
    return areas, occupied


def inside_area(start: InsideOf, fixture: Fixture, openness: float) -> Area:
    """The part of a drawer's or basin's floor that a start allows, in the room as the drawer stands open."""
    assert isinstance(fixture, Drawer | Sink)
    region = fixture.interior if isinstance(fixture, Drawer) else fixture.basin
    half_w, half_d = min(start.size[0] / 2, region.half[0]), min(start.size[1] / 2, region.half[1])
    centre_y = region.center[1] + start.at * (region.half[1] - half_d)
    slide = -openness * fixture.full_travel if isinstance(fixture, Drawer) else 0.0
    centre = fixture.to_world((region.center[0], centre_y + slide, region.center[2] - region.half[2]))
    return Area(-half_w, half_w, -half_d, half_d, (float(centre[0]), float(centre[1])), fixture.yaw, float(centre[2]))


def _into(fixture: Fixture, x: float, y: float) -> tuple[float, float]:
    dx, dy = x - fixture.pos[0], y - fixture.pos[1]
    c, s = np.cos(fixture.yaw), np.sin(fixture.yaw)
    return float(c * dx + s * dy), float(-s * dx + c * dy)
