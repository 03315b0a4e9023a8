"""Layouts and styles against RoboCasa365's facts: what kitchens have, counts over all, what splits share."""

from __future__ import annotations

import itertools
from collections import Counter as Tally

import pytest

from robocasa_lerobot.envs.checks.soundness import blocked_walkways
from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds, model_for, model_of
from robocasa_lerobot.envs.kitchens.fixture_types import FILTERS, FixtureType
from robocasa_lerobot.envs.kitchens.fixtures.accessories import Accessory
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.kitchens.fixtures.fronts import HANDLES, PANELS
from robocasa_lerobot.envs.kitchens.fixtures.hoods import DESIGNS as HOODS
from robocasa_lerobot.envs.kitchens.fixtures.stools import DESIGNS as STOOLS
from robocasa_lerobot.envs.kitchens.layout import Layout, layout_ids, layout_record, load_layout
from robocasa_lerobot.envs.kitchens.materials import COMMON_SURFACES, load_style, split_of, style_ids
from robocasa_lerobot.envs.kitchens.splits import (
    EXCLUDED,
    GROUPS,
    NAMED,
    benchmark_split,
    expand,
    scene_ids,
    validation_kitchens,
    without,
)
from robocasa_lerobot.envs.scene.placement.counter_areas import standing_on
from robocasa_lerobot.envs.scene.roles import candidates, footprint
from robocasa_lerobot.errors import UnknownNameError, UserError

ALL = tuple(range(1, 61))
EVERYWHERE = (
    *("sink", "microwave", "dishwasher", "dish_rack", "toaster", "toaster_oven", "paper_towel", "electric_kettle"),
    *("stand_mixer", "blender", "coffee_machine", "hinge_cabinet", "drawer", "hood", "window", "counter"),
)
STOVETOPS = (2, 4, 7, 9, 12, 15, 17, 18, 22, 28, 29, 31, 34, 35, 37, 39, 42)
FREEZERS = (2, 7, 9, 18, 21, 24, 29, 32, 38, 41, 43, 44, 45, 47, 57)
NO_ISLAND, ISLANDS, DINING = (1, 3, 5, 6, 8), (2, 4, 7, 9, 10), (2, 4, 7, 8, 9, 10)


@pytest.fixture(scope="module")
def layouts() -> dict[int, Layout]:
    return {i: load_layout(i) for i in layout_ids()}


def _having(layouts: dict[int, Layout], *types: str) -> tuple[int, ...]:
    return tuple(i for i, layout in layouts.items() if layout.of_type(*types))


def _with(layouts: dict[int, Layout], kind: FixtureType) -> tuple[int, ...]:
    return tuple(i for i, layout in layouts.items() if candidates(layout, kind.name.lower()))


def test_there_are_sixty_of_each() -> None:
    assert layout_ids() == style_ids() == ALL


@pytest.mark.parametrize("kind", EVERYWHERE)
def test_every_layout_has(kind: str, layouts: dict[int, Layout]) -> None:
    assert _having(layouts, kind) == ALL


def test_counts_of_stoves_fridges_islands_and_stools(layouts: dict[int, Layout]) -> None:
    assert _having(layouts, "stovetop") == _having(layouts, "oven") == STOVETOPS
    assert len(_having(layouts, "stove")) == 31
    assert len(_having(layouts, "stove_wide")) == 12
    assert len(_having(layouts, "fridge_french_door")) == 31
    assert len(_having(layouts, "fridge_bottom_freezer")) == 14
    assert _having(layouts, "fridge_side_by_side") == FREEZERS
    assert len(_with(layouts, FixtureType.ISLAND)) == 37
    assert len(_having(layouts, "stool")) == 47


def test_each_layout_has_one_stove_one_fridge_one_sink(layouts: dict[int, Layout]) -> None:
    for layout in layouts.values():
        for kind in (FixtureType.STOVE, FixtureType.FRIDGE, FixtureType.SINK, FixtureType.MICROWAVE):
            assert len(candidates(layout, kind.name.lower())) == 1, (layout.layout_id, kind)


def test_the_lists_of_layouts_say_what_they_lack(layouts: dict[int, Layout]) -> None:
    lacking = {
        need: set(ALL) - set(_with(layouts, kind))
        for need, kind in (
            ("double_cab", FixtureType.CABINET_DOUBLE_DOOR),
            ("dining_counter", FixtureType.DINING_COUNTER),
            ("island", FixtureType.ISLAND),
        )
    }
    assert lacking["double_cab"] == set(EXCLUDED["double_cab"])
    assert lacking["dining_counter"] == set(EXCLUDED["dining_counter"])
    # The list has 9 and 10, whose islands RoboCasa counts; 20, 39 and 50 have none, or islands would not be 37.
    assert lacking["island"] == set(EXCLUDED["island"]) - {9, 10} | {20, 39, 50}
    # Ovens out of the list's reach are there all the same.
    assert set(ALL) - set(EXCLUDED["oven"]) == set(STOVETOPS) - {22, 28}
    assert set(ALL) - set(EXCLUDED["freezer"]) == set(FREEZERS)


def test_objects_keep_clear_of_what_stands_on_a_counter(layouts: dict[int, Layout]) -> None:
    found = set()
    for layout in layouts.values():
        counters = [f for f in layout.fixtures.values() if isinstance(f, Counter)]
        for thing in (f for f in layout.fixtures.values() if isinstance(f, Accessory)):
            for counter in counters:
                x, y = counter.to_local(thing.pos)
                above = thing.pos[2] - thing.height / 2 - counter.surface_z
                if abs(x) < counter.width / 2 and abs(y) < counter.depth / 2 and abs(above) < 0.005:
                    assert footprint(thing) in standing_on(layout, counter, counter.surface_z), thing.name
                    found.add(thing.kind)
    assert {"box", "jar"} <= found, found


def test_groups_of_target_layouts(layouts: dict[int, Layout]) -> None:
    islands, dining = _with(layouts, FixtureType.ISLAND), _with(layouts, FixtureType.DINING_COUNTER)
    assert GROUPS[-4] == NO_ISLAND == tuple(i for i in range(1, 11) if i not in islands)
    assert GROUPS[-5] == ISLANDS == tuple(i for i in islands if i <= 10)
    assert GROUPS[-6] == DINING == tuple(i for i in dining if i <= 10)


def test_dining_counters_have_two_stools(layouts: dict[int, Layout]) -> None:
    for layout in layouts.values():
        if candidates(layout, "dining_counter"):
            assert len(candidates(layout, "stool")) >= 2, layout.layout_id


def test_every_plan_is_there() -> None:
    plans = Tally(layout_record(i)["plan"] for i in ALL)
    assert set(plans) == {"one_wall", "L", "U", "G", "galley", "peninsula", "island"}
    assert {layout_record(i)["plan"] for i in range(1, 11)} >= {"one_wall", "L", "U", "galley", "peninsula", "island"}


@pytest.mark.parametrize("layout_id", ALL)
def test_there_is_a_metre_before_everything_that_opens(layout_id: int, layouts: dict[int, Layout]) -> None:
    assert blocked_walkways(layouts[layout_id]) == []


@pytest.mark.parametrize("layout_id", ALL)
def test_filters_find_what_tasks_ask_for(layout_id: int, layouts: dict[int, Layout]) -> None:
    layout = layouts[layout_id]
    assert set(FILTERS) == set(FixtureType)
    found = {kind: candidates(layout, kind.name.lower()) for kind in FixtureType}
    for kind in ("CABINET", "CABINET_WITH_DOOR", "TOP_DRAWER", "DRAWER"):
        assert len(found[FixtureType[kind]]) >= 2, kind
    assert found[FixtureType.COUNTER_NON_DINING]
    assert not any("corner" in f.name for f in found[FixtureType.COUNTER])
    for kind in (FixtureType.CABINET_SINGLE_DOOR, FixtureType.CABINET_DOUBLE_DOOR):
        assert {f.name for f in found[kind]} <= {f.name for f in found[FixtureType.CABINET_WITH_DOOR]}
    assert {f.name for f in found[FixtureType.TOP_DRAWER]} <= {f.name for f in found[FixtureType.DRAWER]}
    for counter in found[FixtureType.COUNTER]:
        assert isinstance(counter, Counter)
        assert counter.surface_z == pytest.approx(0.92)


# Styles and splits


@pytest.mark.parametrize("style_id", ALL)
def test_a_style_says_everything(style_id: int) -> None:
    style = load_style(style_id)
    assert {style.panel, style.upper_panel} <= set(PANELS)
    assert style.handle in HANDLES
    assert style.hood in HOODS
    assert style.stool in STOOLS
    assert {kind: model_for(style, kind).model_id for kind in kinds()} == style.appliances
    for kind, model_id in style.appliances.items():
        assert model_of(model_id).kind == kind
        assert model_of(model_id).split == split_of(style_id)


def test_the_splits_share_no_texture_and_no_appliance_model() -> None:
    textures: dict[str, set[str]] = {"target": set(), "pretrain": set()}
    seeds: dict[str, set[tuple[str, int]]] = {"target": set(), "pretrain": set()}
    models: dict[str, set[str]] = {"target": set(), "pretrain": set()}
    for style_id in ALL:
        style, split = load_style(style_id), split_of(style_id)
        records = [surface.texture for surface in style.surfaces.values() if surface.texture is not None]
        textures[split] |= {record.file for record in records}
        seeds[split] |= {(record.kind, record.seed) for record in records}
        models[split] |= set(style.appliances.values())
    for found in (textures, seeds, models):
        assert found["target"]
        assert not found["target"] & found["pretrain"]
    assert all(surface.texture is None for surface in COMMON_SURFACES.values())


def test_styles_differ() -> None:
    looks = {i: tuple(str(load_style(i).surfaces[role]) for role in ("cabinet", "counter", "floor")) for i in ALL}
    for a, b in itertools.combinations(ALL, 2):
        assert looks[a] != looks[b]
    assert {load_style(i).panel for i in ALL} == set(PANELS) - {"glass"}
    assert {load_style(i).handle for i in ALL} == set(HANDLES)


# Which kitchens a split has


def test_pairs_of_the_splits() -> None:
    assert scene_ids("target") == [(i, i) for i in range(1, 11)]
    pretraining = scene_ids("pretrain")
    assert len(pretraining) == len(set(pretraining)) == 2500
    assert {i for pair in pretraining for i in pair} == set(range(11, 61))
    assert scene_ids("target", layouts=-4, styles=3) == [(i, 3) for i in NO_ISLAND]
    assert scene_ids("pretrain", layouts=[11, 15], styles=34) == [(11, 34), (15, 34)]
    assert len(scene_ids("pretrain", exclude=("oven",))) == 50 * len(
        [i for i in STOVETOPS if i > 10 and i not in (22, 28)]
    )
    assert without([(32, 1), (33, 1)], ("double_cab",)) == [(33, 1)]
    assert expand([-5, 2, 60], "layout") == (*ISLANDS, 60)


def test_fifty_pretraining_kitchens_are_kept_for_validation() -> None:
    kept, others = scene_ids("pretrain_val"), scene_ids("pretrain_train")
    assert kept == validation_kitchens()
    assert [len({pair[i] for pair in kept}) for i in (0, 1)] == [50, 50]
    assert sorted([*kept, *others]) == scene_ids("pretrain")
    assert not set(kept) & set(NAMED["5x5"]), "the scene diversity's kitchens are recorded in"
    layout, style = kept[0]
    assert scene_ids("pretrain_train", layouts=layout, styles=[style, style % 60 + 1]) == [(layout, style % 60 + 1)]
    assert [benchmark_split(name) for name in ("pretrain_train", "pretrain_val")] == ["pretrain", "pretrain"]


def test_wrong_kitchens_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="pretrain"):
        scene_ids("pretraining")
    with pytest.raises(UnknownNameError, match="61"):
        scene_ids("pretrain", layouts=61)
    with pytest.raises(UnknownNameError, match="island"):
        without([(1, 1)], ("iland",))
    with pytest.raises(UserError, match="none of 1 kitchens"):
        without([(1, 1)], ("island",))
