"""Scenes start sound: what is placed lies within where it belongs, and nothing stands in anything else."""

from __future__ import annotations

import dataclasses
from typing import Literal

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.checks.soundness import moved
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.kitchens.footprints import Area, Footprint
from robocasa_lerobot.envs.kitchens.layout import load_layout
from robocasa_lerobot.envs.predicates import ObjectOn
from robocasa_lerobot.envs.scene import build
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.placement.at_rest import ask_for_rest, fell
from robocasa_lerobot.envs.scene.placement.counter_areas import standing_on
from robocasa_lerobot.envs.scene.placement.overlaps import robot_touches, sunk_in
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.spec import ObjectSpec, OnCounter, Placement
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UserError

type Scale = float | tuple[float, float, float]


def scene_in(task: str, layout: int, style: int) -> Scene:
    return build_scene(get_task(task), "pretrain", 100 * layout + style, kitchens=[(layout, style)])


def touches(scene: Scene, data: mujoco.MjData, one: str, other: str) -> bool:
    first, second = scene.subtree(one), scene.subtree(other)
    bodies = scene.model.geom_bodyid[data.contact.geom]
    return bool((first[bodies[:, 0]] & second[bodies[:, 1]] | first[bodies[:, 1]] & second[bodies[:, 0]]).any())


def test_no_robot_starts_in_a_drawer_that_stands_open() -> None:
    scene = scene_in("PickPlaceDrawerToCounter", 40, 21)
    data, _ = scene.initial_data(np.random.default_rng(0))
    drawer = scene.fixture("drawer", Drawer)
    assert drawer.openness(data) == pytest.approx(1.0, abs=0.01)
    assert not touches(scene, data, "robot0_base", drawer.name)


@pytest.mark.parametrize("split", ["target", "pretrain"])
def test_no_robot_pushes_a_drawer_that_is_partly_out(split: str) -> None:
    scene = build_scene(get_task("ClusterUtensilsInDrawer"), split, 150_002)
    data, _ = scene.initial_data(np.random.default_rng(150_002))
    drawer = scene.fixture("drawer", Drawer)
    assert drawer.openness(data) == pytest.approx(scene.openness[drawer.name, ""], abs=0.01)


def test_a_door_that_moves_by_itself_is_found() -> None:
    scene = scene_in("PickPlaceDrawerToCounter", 40, 21)
    data, _ = scene.initial_data(np.random.default_rng(0))
    drawer = scene.fixture("drawer", Drawer)
    assert max(moved(scene, data).values()) < 0.01
    data.joint(drawer.joint).qvel[:] = 0.5
    assert moved(scene, data)[f"{drawer.name}_box"] > 0.01


def test_a_pan_stands_with_its_round_part_on_the_burner() -> None:
    scene = scene_in("PickPlaceCounterToStove", 58, 23)
    pan = scene.objects["container"]
    assert pan.item.interior is not None
    footprint = pan.footprint
    middle = np.array(pan.pos[:2]) + np.array(pan.item.interior.center[:2]) @ footprint.axes()
    regions = scene.fixture("stove", Hob).regions
    burners = [scene.fixture("stove").to_world(r.center)[:2] for name, r in regions.items() if name != "interior"]
    assert min(np.hypot(*(middle - at)) for at in burners) < 0.02
    assert min(np.hypot(*(np.array(pan.pos[:2]) - at)) for at in burners) > 0.02


@pytest.mark.parametrize(("task", "layout", "style"), [("SweetenHotChocolate", 52, 22), ("TransportCookware", 46, 43)])
def test_no_pan_tips_over_the_edge_of_a_grate(task: str, layout: int, style: int) -> None:
    scene = scene_in(task, layout, style)
    data, _ = scene.initial_data(np.random.default_rng(0))
    assert scene.fixture("stove", Hob).record["hob"] == "gas"
    assert data.body("saucepan" if task == "SweetenHotChocolate" else "pan").xmat[8] > 0.985


def test_middles_are_drawn_into_areas_that_hold_no_whole_footprints() -> None:
    area = Area(-0.01, 0.01, -0.01, 0.01, (2.0, 1.0), 0.7, 0.9, inside=False)
    rng = np.random.default_rng(0)
    for _ in range(20):
        x, y, yaw = area.sample(rng, (0.2, 0.1), middle=(0.05, 0.02))[0].tolist()
        found = Footprint(x, y, yaw, (0.2, 0.1))
        x, y = np.array([found.x, found.y]) + np.array([0.05, 0.02]) @ found.axes()
        assert area.holds(Footprint(float(x), float(y), 0.7, (0.0, 0.0)))
        assert not area.holds(found)


@pytest.mark.parametrize(("layout", "style"), [(57, 55), (51, 32)])
def test_what_lies_in_a_basin_touches_no_wall_at_first(layout: int, style: int) -> None:
    """Placemats as large as the basin started in its walls, and were pressed through its floor."""
    scene = scene_in("TurnSinkSpout", layout, style)
    data, _ = scene.initial_data(np.random.default_rng(0))
    thing = scene.objects["distr_sink"]
    assert abs(data.body("distr_sink").xpos[2] - thing.pos[2]) < 0.02


def test_faucets_are_in_the_way_behind_the_basin() -> None:
    layout = load_layout(29, 59)
    sink = next(iter(layout.of_type("sink")))
    counter = next(f for f in layout.of_type("counter") if abs(f.to_local(sink.pos)[0]) < f.width / 2)
    behind = sink.to_world((0.0, sink.depth / 2 + 0.055, 0.0))
    spot = Footprint(float(behind[0]), float(behind[1]), 0.0, (0.01, 0.01))
    marks = standing_on(layout, counter, sink.pos[2] + sink.height / 2)
    assert any(mark.overlaps(spot) for mark in marks)


# As composite tasks ask for them: a wider and lower box, and cutlery made high enough to be held.
@pytest.mark.parametrize(
    ("group", "scale"), [("tupperware", (1.5, 1.5, 1.0)), ("fork", (1.0, 1.0, 2.0)), ("bowl", 1.25)]
)
def test_objects_start_scaled_by_axis_with_what_is_in_them(group: str, scale: Scale) -> None:
    base = dataclasses.replace(get_task("PickPlaceCounterToCabinet"), instruction="Look.", paraphrases=())
    start = OnCounter("cab", size=(0.6, 0.4))
    found = {}
    for factors in (1.0, scale):
        item = ObjectSpec("item", (group,), start, scale=factors)
        inside = ObjectSpec("food", ("lime",), Placement(object="item"))
        objects = (item, inside) if group != "fork" else (item,)
        scene = build_scene(dataclasses.replace(base, objects=objects), "target", 3)
        found[factors] = scene.objects["item"].item
        data, _ = scene.initial_data(np.random.default_rng(0))
        assert abs(data.body("item").xpos[2] - scene.objects["item"].pos[2]) < 0.02  # it has not fallen
        if len(objects) == 2:
            assert ObjectOn("food", "item").holds(scene, data)
    assert found[scale].model == found[1.0].model
    ratio = np.asarray(found[scale].size) / np.asarray(found[1.0].size)
    assert ratio == pytest.approx(np.broadcast_to(scale, 3), rel=1e-3)


@pytest.mark.parametrize(("split", "seed"), [("target", 100_200), ("target", 100_201), ("pretrain", 100_200)])
def test_a_bowl_is_not_thrown_off_by_what_is_too_wide_for_it(split: Literal["target", "pretrain"], seed: int) -> None:
    scene = build_scene(get_task("WaffleReheat"), split, seed)
    data, _ = scene.initial_data(np.random.default_rng(0))
    bowl = data.body("waffle_container").xpos
    assert np.linalg.norm(bowl - scene.objects["waffle_container"].pos) < 0.03
    assert ObjectOn("waffle", "waffle_container").holds(scene, data)


@pytest.mark.parametrize(
    ("task", "split", "seed"),
    [
        ("LoadFridgeByType", "pretrain", 1),  # a fish and a beet, each longer than its bowl is wide, others on them
        ("MicrowaveCorrectMeal", "pretrain", 2),  # a lobster, skewers
        ("ReturnHeatedFood", "pretrain", 0),
        ("CountertopCleanup", "pretrain", 2),
        ("MeatSkewerAssembly", "target", 11),  # the rim of the plate threw the skewers off
        ("HeatKebabSandwich", "pretrain", 12),
    ],
)
def test_what_does_not_fit_into_a_vessel_lies_on_its_rim_and_not_in_its_walls(
    task: str, split: Literal["target", "pretrain"], seed: int
) -> None:
    scene = build_scene(get_task(task), split, seed)
    data, _ = scene.initial_data(np.random.default_rng(seed))
    assert sunk_in(scene.model, data) == []
    holders = {
        wanted.name: wanted.start.object for wanted in scene_objects(task) if wanted.start.object in scene.objects
    }
    assert holders
    for name, holder in holders.items():
        aside = data.body(name).xpos - data.body(holder).xpos
        assert np.hypot(*aside[:2]) < max(scene.objects[holder].item.size[:2]) / 2 + 0.03  # it leans on the rim
        assert aside[2] > -scene.objects[holder].item.size[2] / 2
    assert not {name: by for name, by in fell(scene, data).items() if by > 0.02}


def scene_objects(task: str) -> list[ObjectSpec]:
    return [wanted for wanted in get_task(task).objects if isinstance(wanted.start, Placement)]


def test_a_scale_of_two_factors_is_refused() -> None:
    base = get_task("PickPlaceCounterToCabinet")
    item = ObjectSpec("item", ("bowl",), OnCounter("cab"), scale=(1.5, 1.5))  # type: ignore[arg-type]
    with pytest.raises(UserError, match="three of them"):
        build_scene(dataclasses.replace(base, objects=(item,)), "target", 0)


def test_what_starts_in_a_drawer_lies_in_it_altogether(monkeypatch: pytest.MonkeyPatch) -> None:
    """A knife as long as the drawer is deep was turned into its wall; another angle, or another knife, is drawn."""

    def in_walls() -> bool:
        scene = build_scene(get_task("SetUpCuttingStation"), "pretrain", 3)
        data, _ = scene.initial_data(np.random.default_rng(0))
        return any("knife" in pair for pair in sunk_in(scene.model, data))

    assert not in_walls()
    monkeypatch.setattr(Drawer, "holds_all_of_it", False)
    monkeypatch.setattr(Area, "pushed_in", lambda *_: None)  # nor is it mended in the two ways that other things are
    monkeypatch.setattr(build, "ask_for_room", lambda _: None)
    assert in_walls()


@pytest.mark.parametrize(
    ("task", "layout", "style"),
    [
        ("ScalePortioning", 33, 49),  # an open door of the freezer, drawn where the base stands
        ("DistributeChicken", 19, 11),  # the handle of a pan
        ("CandleCleanup", 58, 31),  # a placemat in a cabinet that is too narrow for it
        ("TransportCookware", 14, 25),  # a pan in an oven's door
    ],
)
def test_what_would_start_in_something_else_is_drawn_again(task: str, layout: int, style: int) -> None:
    scene = scene_in(task, layout, style)
    data, _ = scene.initial_data(np.random.default_rng(100 * layout + style))
    assert sunk_in(scene.model, data) == []
    assert robot_touches(scene, data) == []


def test_a_tray_lies_on_its_rack_and_not_in_the_door_of_the_oven() -> None:
    scene = scene_in("CoolBakedCookies", 34, 34)
    (rack,) = scene.regions("oven", "{rack}")
    oven = scene.fixture("oven")
    corners = np.array([oven.to_local(corner) for corner in scene.objects["oven_tray"].footprint.corners()])
    # The rack itself is 7 mm before the middle of the oven.
    assert (np.abs(corners - rack.center[:2]).max(axis=0) <= np.array(rack.half[:2]) + 0.008).all()


def test_footprints_are_pushed_in_by_as_little_as_it_takes() -> None:
    area = Area(-0.2, 0.2, -0.1, 0.1, (1.0, 2.0), np.pi / 2, 0.0)
    pushed = area.pushed_in(Footprint(1.15, 2.0, 0.0, (0.05, 0.05)))
    assert pushed is not None
    assert (pushed.x, pushed.y) == pytest.approx((1.05, 2.0))
    assert area.pushed_in(Footprint(1.0, 2.0, 0.0, (0.11, 0.05))) is None


@pytest.mark.costly
@pytest.mark.parametrize(
    ("task", "layout", "style"),
    [("PortionHotDogs", 22, 31), ("LoadFridgeByType", 28, 15), ("SteamVeggiesWithWater", 42, 41)],
)
def test_what_rolls_off_a_heap_is_drawn_again(task: str, layout: int, style: int) -> None:
    scene = scene_in(task, layout, style)
    data, _ = scene.initial_data(np.random.default_rng(100 * layout + style))
    assert max(fell(scene, data).values()) <= 0.02
    assert max(moved(scene, data)[name] for name in scene.objects) <= 0.01


def test_only_what_was_piled_up_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    """An apple beside a bowl rests where it was put down: its scene costs no simulation."""
    scene = scene_in("PickPlaceCounterToSink", 22, 31)
    monkeypatch.setattr(Scene, "placed_data", None)
    ask_for_rest(scene)


def test_noise_that_leads_the_arm_into_a_handle_is_drawn_again() -> None:
    task = get_task("PrepFridgeForCleaning")
    scene = build_scene(task, "pretrain", 3_458, kitchens=[(34, 58)])
    first = scene.placed_data(np.random.default_rng(3_458))
    mujoco.mj_forward(scene.model, first)
    assert scene.robot_touches(first) == ["fridge_fridge_right_door"]
    data, _ = scene.initial_data(np.random.default_rng(3_458))
    assert not robot_touches(scene, data)
