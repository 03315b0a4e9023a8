"""Where an object may be put down in a drawer: in its part that is open above, the way round that fits there."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, base_pose
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.basin_poses import room_in
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, Region
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter

DEEP, ACROSS = (0.25, 0.5, 0.75), (-1.0, -0.5, 0.0, 0.5, 1.0)  # shares of the open part, and of what is left aside
ASIDE_M = 0.04  # kept from the drawer's sides, at least
DROPS_M, DROP_COST = (0.0, 0.04, 0.08, 0.12), 2.0  # over the drawer's floor, and a cost for each metre
MIDDLE_COST, ASIDE_COST = 1.0, 0.5  # for each metre from the middle of the open part, and from before the robot
LEAST_OPEN_M = 0.06  # a part that is open less than this is as good as none
# Of what an object reaches beyond the open part, and is higher than it need be, for each metre.
BEYOND_COST, FLAT_COST = 8.0, 3.0


def in_drawer(env: KitchenEnv, drawer: Drawer) -> PlacePoses:
    """All over the open part of a drawer, or let fall from over there."""

    def poses() -> Sequence[PlacePose]:
        data, region = env.data, open_part(env, drawer)
        wide, deep, tall = region.half
        most = max(wide - ASIDE_M, 0.0)
        own = float(np.clip(region.local(data, base_pose(data)[0])[0], -most, most))
        found = []
        for x, share, drop in itertools.product((own, *(most * share for share in ACROSS)), DEEP, DROPS_M):
            y = deep * (2 * share - 1)
            cost = DROP_COST * drop + MIDDLE_COST * abs(y) + ASIDE_COST * abs(x - own)
            found.append(PlacePose(region.world(data, (x, y, -tall)) + drop * UP, cost))
        return found

    return poses


def fits_in_drawer(env: KitchenEnv, obj: Graspable, drawer: Drawer) -> Callable[[Array, Array], float]:
    """The cost of an object that would come to lie on the drawer's front, or on the counter over it, or upright."""
    return room_in(env, obj, open_part(env, drawer), out_cost=BEYOND_COST, flat_cost=FLAT_COST)


def open_part(env: KitchenEnv, drawer: Drawer) -> Region:
    """The part of a drawer that has no counter over it; all of it where that is next to nothing."""
    (region,) = drawer.regions.values()
    x, y, z = region.center
    wide, deep, tall = region.half
    behind = min((_front_edge(env, cover, region) for cover in _covers(env, drawer)), default=deep)
    length = float(np.clip(behind, -deep, deep)) + deep
    if length < LEAST_OPEN_M:
        return region
    return replace(region, center=(x, y - deep + length / 2, z), half=(wide, length / 2, tall))


def _covers(env: KitchenEnv, drawer: Drawer) -> list[Fixture]:
    """Counters over a drawer; where there is none, what it is built into ends where its front is when it is shut."""
    found: list[Fixture] = []
    for fixture in env.scene.fixtures.values():
        if isinstance(fixture, Counter) and fixture.surface_z > drawer.pos[2]:
            x, y = fixture.to_local(drawer.pos)
            if abs(x) <= fixture.width / 2 and abs(y) <= fixture.depth / 2:
                found.append(fixture)
    return found or [drawer]


def _front_edge(env: KitchenEnv, cover: Fixture, region: Region) -> float:
    """How far behind a drawer's middle the edge of what is over it lies, metres."""
    corners = [
        cover.to_world((side * cover.width / 2, end * cover.depth / 2, 0.0)) for side in (-1, 1) for end in (-1, 1)
    ]
    return min(float(region.local(env.data, corner)[1]) for corner in corners)
