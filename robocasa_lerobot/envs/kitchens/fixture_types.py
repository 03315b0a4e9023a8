"""Fixture types that tasks ask for, and what counts as one, by RoboCasa's rules (docs/robocasa.md, section 6)."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum

from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds, kinds_in
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.errors import UnknownNameError

Filter = Callable[[Layout, Fixture], bool]


class FixtureType(IntEnum):
    """What a task may ask for; the numbers are RoboCasa's."""

    MICROWAVE = 1
    STOVE = 2
    OVEN = 3
    SINK = 4
    COFFEE_MACHINE = 5
    TOASTER = 6
    TOASTER_OVEN = 7
    FRIDGE = 8
    DISHWASHER = 9
    BLENDER = 10
    STAND_MIXER = 11
    ELECTRIC_KETTLE = 12
    STOOL = 13
    COUNTER = 14
    ISLAND = 15
    COUNTER_NON_CORNER = 16
    DINING_COUNTER = 17
    CABINET = 18
    CABINET_WITH_DOOR = 19
    CABINET_SINGLE_DOOR = 20
    CABINET_DOUBLE_DOOR = 21
    SHELF = 22
    DRAWER = 23
    TOP_DRAWER = 24
    WINDOW = 25
    DISH_RACK = 26
    COUNTER_NON_DINING = 27


# Heights of the floor of a cabinet that objects are put into, metres.
_CABINET_FLOOR = (1.0, 1.5)
_TOP_DRAWER_MIDDLE = (0.7, 0.9)
_CABINETS = ("single_cabinet", "hinge_cabinet", "open_cabinet")


def _types(*types: str) -> Filter:
    return lambda layout, fixture: layout.types[fixture.name] in types


def _cabinet(*types: str) -> Filter:
    def found(layout: Layout, fixture: Fixture) -> bool:
        low, high = _CABINET_FLOOR
        return (
            layout.types[fixture.name] in types
            and low <= fixture.pos[2] - fixture.height / 2 <= high
            and not any(part in fixture.name for part in ("stack", "corner"))
            and not _over_corner(layout, fixture)
        )

    return found


def _over_corner(layout: Layout, fixture: Fixture) -> bool:
    """Whether it hangs over the counter of a corner, which no robot can stand before."""
    x, y, _ = fixture.pos
    return any(
        isinstance(f, Counter) and "corner" in f.name and max(abs(f.pos[0] - x), abs(f.pos[1] - y)) < f.width / 2
        for f in layout.fixtures.values()
    )


def _top_drawer(layout: Layout, fixture: Fixture) -> bool:
    low, high = _TOP_DRAWER_MIDDLE
    return layout.types[fixture.name] == "drawer" and low <= fixture.pos[2] <= high


def _counter(_: Layout, fixture: Fixture) -> bool:
    return isinstance(fixture, Counter) and "corner" not in fixture.name


def _island(_: Layout, fixture: Fixture) -> bool:
    return isinstance(fixture, Counter) and (fixture.island_only or "island" in fixture.name)


def _dining_counter(_: Layout, fixture: Fixture) -> bool:
    return (
        isinstance(fixture, Counter)
        and not fixture.island_only
        and (fixture.name.startswith(("island", "dining")) or fixture.table)
    )


def _appliance(name: str) -> Filter:
    """An appliance of a category, e.g. "fridge", or of a kind of one, e.g. "fridge_french_door"."""
    return lambda layout, fixture: layout.types[fixture.name] in kinds_in(name)


FILTERS: dict[FixtureType, Filter] = {
    **{kind: _appliance(kind.name.lower()) for kind in FixtureType if kinds_in(kind.name.lower())},
    FixtureType.STOOL: _types("stool"),
    FixtureType.COUNTER: _counter,
    FixtureType.ISLAND: _island,
    FixtureType.COUNTER_NON_CORNER: _counter,
    FixtureType.DINING_COUNTER: _dining_counter,
    FixtureType.CABINET: _cabinet(*_CABINETS),
    FixtureType.CABINET_WITH_DOOR: _cabinet("single_cabinet", "hinge_cabinet"),
    FixtureType.CABINET_SINGLE_DOOR: _cabinet("single_cabinet"),
    FixtureType.CABINET_DOUBLE_DOOR: _cabinet("hinge_cabinet"),
    FixtureType.SHELF: _types("shelf"),
    FixtureType.DRAWER: _types("drawer"),
    FixtureType.TOP_DRAWER: _top_drawer,
    FixtureType.WINDOW: _types("window"),
    FixtureType.DISH_RACK: _types("dish_rack"),
    FixtureType.COUNTER_NON_DINING: lambda layout, f: _counter(layout, f) and not _dining_counter(layout, f),
}
# By the words of task declarations: the enum's names in small letters.
FIXTURE_KINDS: dict[str, Filter] = {kind.name.lower(): FILTERS[kind] for kind in FixtureType}
FIXTURE_KINDS["drawer_top"] = FILTERS[FixtureType.TOP_DRAWER]


def _with_freezer(_: Layout, fixture: Fixture) -> bool:
    """A fridge whose freezer has a door, and shelves that the arm reaches: not below, not in a drawer."""
    return "freezer" in fixture.compartments and bool(fixture.usable_shelves("freezer"))


def _with_drawer(layout: Layout, fixture: Fixture) -> bool:
    return FILTERS[FixtureType.FRIDGE](layout, fixture) and bool(fixture.parts_to_choose("drawer"))


def _with_two_basins(layout: Layout, fixture: Fixture) -> bool:
    return FILTERS[FixtureType.SINK](layout, fixture) and len(fixture.regions) > 1


def _with_two_racks(layout: Layout, fixture: Fixture) -> bool:
    return FILTERS[FixtureType.TOASTER_OVEN](layout, fixture) and len(fixture.parts_to_choose("rack")) == 2


def _with_four_slots(layout: Layout, fixture: Fixture) -> bool:
    return FILTERS[FixtureType.TOASTER](layout, fixture) and len(fixture.parts_to_choose("slot")) == 4


def _of_three_stools(*, at_end: bool) -> Filter:
    """A stool of a row of three, at either end of it or between: where a layout has exactly three."""

    def found(layout: Layout, fixture: Fixture) -> bool:
        row = layout.of_type("stool")
        if len(row) != 3 or fixture not in row:
            return False
        # The middle one is the nearest to both others together.
        middle = min(row, key=lambda stool: sum(math.dist(stool.pos[:2], other.pos[:2]) for other in row))
        return (fixture is not middle) == at_end

    return found


# What a robot is sent from and to (docs/robocasa.md, section 8).
_LANDMARKS = (
    "coffee_machine", "toaster", "toaster_oven", "stove", "stove_wide", "stovetop", "open_cabinet", "microwave", "sink",
    "hood", "oven", "fridge_french_door", "fridge_side_by_side", "fridge_bottom_freezer", "dishwasher",
    "electric_kettle", "stand_mixer",
)  # fmt: skip
_SOURCES = (*_LANDMARKS, "single_cabinet", "hinge_cabinet", "drawer")


def _once(layout: Layout, fixture: Fixture) -> bool:
    kind = layout.types[fixture.name]
    return kind in _LANDMARKS and list(layout.types.values()).count(kind) == 1


FIXTURE_KINDS |= {
    "fridge_with_drawer": _with_drawer,
    "fridge_with_freezer": _with_freezer,
    "sink_with_two_basins": _with_two_basins,
    "stool_at_end_of_three": _of_three_stools(at_end=True),
    "toaster_with_four_slots": _with_four_slots,
    "toaster_oven_with_two_racks": _with_two_racks,
    "stool_amid_three": _of_three_stools(at_end=False),
    "landmark": _types(*_SOURCES),
    "landmark_once": _once,
}


def fixture_filter(kind: str) -> Filter:
    """What counts as a fixture of a kind: by the words of `FIXTURE_KINDS`, else by a category or kind of appliances.

    Raises:
        UnknownNameError: no such kind.
    """
    if kind in FIXTURE_KINDS:
        return FIXTURE_KINDS[kind]
    if not kinds_in(kind):
        raise UnknownNameError("fixture kind", kind, (*FIXTURE_KINDS, *kinds()))
    return _appliance(kind)
