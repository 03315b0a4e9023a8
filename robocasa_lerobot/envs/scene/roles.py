"""Which fixture plays a role in a task, and which carries it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robocasa_lerobot.envs.kitchens.fixture_types import fixture_filter
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.footprints import Footprint, PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.scene.spec import FixtureSpec

BESIDE_M = 0.3  # that a fixture reaches beyond another one, to be beside it
ALIKE_COS = 0.99  # of the angle between fixtures of one row
HOUSING_BELOW_M = 0.6  # a housing whose underside is lower stands on the floor


def cast_roles(rng: np.random.Generator, fixtures: Sequence[FixtureSpec], layout: Layout) -> dict[str, str]:
    """Fixture name of each role of a task.

    Raises:
        PlacementError: the layout has nothing for a role.
    """
    roles: dict[str, str] = {}
    for wanted in fixtures:
        pool = [f for f in candidates(layout, wanted.kind) if _suits(f, wanted, layout, roles)]
        if not pool:
            raise PlacementError(
                f"layout {layout.layout_id} has no {wanted.kind} for {wanted.role!r}. Name another kind, a smaller "
                "size, or in `needs` what layouts must have."
            )
        if wanted.near:
            ref = layout.fixtures[roles[wanted.near]]
            roles[wanted.role] = min(pool, key=lambda f: _distance(f, ref)).name
        else:
            roles[wanted.role] = pool[int(rng.integers(len(pool)))].name
    return roles


def _suits(fixture: Fixture, wanted: FixtureSpec, layout: Layout, roles: dict[str, str]) -> bool:
    names = {roles[role] for role in wanted.other_than}
    others = [layout.fixtures[name] for name in names]
    large = fixture.width >= wanted.size[0] and fixture.depth >= wanted.size[1]
    apart = all(footprint(other).gap(footprint(fixture)) >= wanted.apart_m for other in others)
    far = all(_distance(other, fixture) >= wanted.middle_apart_m for other in others)
    beside = not wanted.side or _reaches(fixture, layout.fixtures[roles[wanted.near]], wanted.side)
    return fixture.name not in names and large and apart and far and beside


def _reaches(fixture: Fixture, ref: Fixture, side: str) -> bool:
    """Whether a fixture of the same row reaches beyond another one on a side of that."""
    x, y = ref.to_local(fixture.pos)
    same_row = abs(y) < ref.depth / 2 and np.cos(fixture.yaw - ref.yaw) > ALIKE_COS
    beyond = (x if side == "right" else -x) + fixture.width / 2 - ref.width / 2
    return bool(same_row and beyond > BESIDE_M)


def _distance(fixture: Fixture, ref: Fixture) -> float:
    """Metres on the floor plan from the middle of a reference to the rectangle of a fixture."""
    x, y = fixture.to_local(ref.pos)
    return float(np.hypot(max(abs(x) - fixture.width / 2, 0.0), max(abs(y) - fixture.depth / 2, 0.0)))


def footprint(fixture: Fixture) -> Footprint:
    """A fixture's box on the floor plan."""
    return Footprint(fixture.pos[0], fixture.pos[1], fixture.yaw, (fixture.width / 2, fixture.depth / 2))


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
