"""Which fixture plays a role in a task, and which carries it."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.kitchens.fixture_types import FIXTURE_KINDS
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.errors import UnknownNameError

HOUSING_BELOW_M = 0.6  # a housing whose underside is lower stands on the floor


def candidates(layout: Layout, kind: str) -> list[Fixture]:
    """Fixtures of a kind, in the layout's order.

    Raises:
        UnknownNameError: no such kind.
    """
    if kind not in FIXTURE_KINDS:
        raise UnknownNameError("fixture kind", kind, FIXTURE_KINDS)
    return [f for f in layout.fixtures.values() if FIXTURE_KINDS[kind](layout, f)]


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
    types = layout.types
    if isinstance(fixture, Counter) or types[fixture.name].startswith(("stove", "fridge")):
        return fixture if types[fixture.name] != "stovetop" else counter_of(layout, fixture)
    ground = [
        f
        for name, f in layout.fixtures.items()
        if isinstance(f, Counter)
        or (
            (types[name] in ("stove", "stove_wide", "housing_cabinet") or types[name].startswith("fridge"))
            and f.pos[2] - f.height / 2 < HOUSING_BELOW_M
        )
    ]
    for f in ground:
        if _within(f, fixture):
            return f
    return min(ground, key=lambda f: float(np.hypot(f.pos[0] - fixture.pos[0], f.pos[1] - fixture.pos[1])))


def _within(ground: Fixture, fixture: Fixture) -> bool:
    local = ground.to_local(fixture.pos)
    return abs(local[0]) <= ground.width / 2 and abs(local[1]) <= ground.depth / 2
