"""Which fixture plays a role in a task, and which carries it."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.kitchens.fixture_types import fixture_filter
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout

HOUSING_BELOW_M = 0.6  # a housing whose underside is lower stands on the floor


def candidates(layout: Layout, kind: str) -> list[Fixture]:
    """Fixtures of a kind, in the layout's order.

    Raises:
        UnknownNameError: no such kind.
    """
    suits = fixture_filter(kind)
    return [f for f in layout.fixtures.values() if suits(layout, f)]


def counter_of(layout: Layout, fixture: Fixture) -> Counter:
    """The counter above a base fixture, around a sink, under an appliance, or nearest in front of what hangs.

    Raises:
        PlacementError: the fixture has no counter, e.g. a fridge.
    """
    if isinstance(fixture, Counter):
        return fixture
    for counter in layout.fixtures.values():
        if isinstance(counter, Counter) and _within(counter, fixture):
            return counter
    raise PlacementError(f"{fixture.name} has no counter")


def ground_fixture(layout: Layout, fixture: Fixture) -> Fixture:
    """What the robot stands before to reach a fixture: a counter, stove, tall housing or fridge."""
    if _is_ground(fixture):
        return fixture
    ground = [f for f in layout.fixtures.values() if _is_ground(f)]
    for f in ground:
        if _within(f, fixture):
            return f
    return min(ground, key=lambda f: float(np.hypot(f.pos[0] - fixture.pos[0], f.pos[1] - fixture.pos[1])))


def _is_ground(fixture: Fixture) -> bool:
    return isinstance(fixture, Counter) or (fixture.is_ground and fixture.pos[2] - fixture.height / 2 < HOUSING_BELOW_M)


def _within(ground: Fixture, fixture: Fixture) -> bool:
    local = ground.to_local(fixture.pos)
    return abs(local[0]) <= ground.width / 2 and abs(local[1]) <= ground.depth / 2
