"""Where an object is: in or on which fixture or other object, as it lies now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.pick_place.graspable import holder_of
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, Region
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.regions import regions_of
from robocasa_lerobot.envs.kitchens.footprints import PlacementError

ON_TOP_M = 0.45  # an object's origin is less than this above the counter that carries it, also in or on another one


@dataclass(frozen=True)
class Location:
    """What carries an object.

    Attributes:
        fixture: that it is in or on; None where it is on the floor or in the hand.
        region: name of the fixture's region that it is in; empty on a counter.
        holder: object that it is in or on; empty where there is none.
    """

    fixture: Fixture | None
    region: str = ""
    holder: str = ""


def locate(env: KitchenEnv, name: str) -> Location:
    """The location of an object: the smallest region that holds its origin, else the counter below it."""
    point = env.data.body(name).xpos.copy()
    holder = holder_of(env, name)
    best: tuple[float, Fixture, str] | None = None
    for fixture in env.scene.fixtures.values():
        if np.linalg.norm(np.asarray(fixture.pos) - point) > np.linalg.norm(fixture.size):
            continue
        for region_name, region in _regions(fixture):
            volume = float(np.prod(region.half))
            if (best is None or volume < best[0]) and region.contains(env.data, point):
                best = (volume, fixture, region_name)
    if best is not None:
        return Location(best[1], best[2], holder)
    return Location(_counter_below(env, point), "", holder)


def _regions(fixture: Fixture) -> list[tuple[str, Region]]:
    try:
        return regions_of(fixture)
    except PlacementError:
        return []


def _counter_below(env: KitchenEnv, point: Array) -> Counter | None:
    for fixture in env.scene.fixtures.values():
        if isinstance(fixture, Counter) and 0.0 < point[2] - fixture.surface_z < ON_TOP_M:
            x, y = fixture.to_local(point)
            if abs(x) <= fixture.width / 2 and abs(y) <= fixture.depth / 2:
                return fixture
    return None
