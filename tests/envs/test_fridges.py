"""One compartment of a fridge: opened and shut alone, with objects on its shelves, which have levels."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.skills.doors import doors
from robocasa_lerobot.demos.stages import StageLog, carry_out
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import take_effect
from robocasa_lerobot.envs.kitchens.appliances.catalogue import build_appliance, kinds, models_of
from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import Fridge
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, yaw_quat
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import HingeCabinet
from robocasa_lerobot.envs.kitchens.fixtures.regions import ANY_LEVEL, LEVELS, USABLE_SHELF, region_names
from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import Layout, layout_ids, load_layout
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.kitchens.splits import EXCLUDED
from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, DoorsOpen, GripperFar, OnShelf
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.roles import candidates
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.errors import UnknownNameError, UserError

PARTS = ("fridge", "freezer")


def food_in(compartment: str, *, kind: str = "fridge_with_freezer", opened: str = "") -> Task:
    """Food on a shelf of a compartment, of which the door stands open; not a task of the benchmark."""
    return Task(
        name=f"FoodIn{compartment.title()}",
        summary="The compartment is shut.",
        fixtures=(FixtureSpec("fridge", kind),),
        robot_start=RobotStart("fridge", setback=0.3),
        objects=(
            ObjectSpec(
                "obj",
                ("vegetable", "fruit"),
                Placement(
                    "fridge",
                    region=SampleRegion(name=f"{compartment}_shelf", height=(1.0, 1.5)),
                    size=(0.3, 0.2),
                    pos=(0.0, -1.0),
                ),
            ),
        ),
        initial=(InitialOpenness("fridge", 0.9, 1.0, part=opened or compartment),),
        goal=DoorsClosed("fridge", part=compartment),
        stages=(Stage("doors", "close_large", "fridge", part=compartment),),
        instruction=f"Close the {compartment} {{{compartment}_doors}}.",
    )


def settled(task: Task, split: str = "target", seed: int = 0) -> tuple[Scene, mujoco.MjData]:
    scene = build_scene(task, split, seed)
    data, _ = scene.initial_data(np.random.default_rng(seed))
    return scene, data


def holds(goal: object, scene: Scene, data: mujoco.MjData) -> bool:
    return goal.evaluate(scene, data, {})  # type: ignore[attr-defined]


@pytest.mark.parametrize("split", ["target", "pretrain"])
@pytest.mark.parametrize("part", PARTS)
def test_a_compartment_stands_open_alone_with_an_object_on_its_shelf(part: str, split: str) -> None:
    other = next(name for name in PARTS if name != part)
    for seed in range(3):
        scene, data = settled(food_in(part), split, seed)
        assert scene.instruction == f"Close the {part} door."
        assert holds(DoorsOpen("fridge", 0.85, part=part), scene, data)
        assert holds(DoorsClosed("fridge", part=other), scene, data)
        assert not holds(DoorsClosed("fridge"), scene, data)
        assert not holds(DoorsOpen("fridge", 0.85), scene, data)
        fridge = scene.fixture("fridge")
        at = data.body("obj").xpos
        assert any(
            region.contains(data, at)
            for name, region in fridge.regions.items()  # type: ignore[attr-defined]
            if name in fridge.usable_shelves(part)
        )


def test_each_compartment_is_asked_for_alone() -> None:
    scene, data = settled(food_in("freezer"))
    fridge = scene.fixture("fridge")
    for open_one, shut in (PARTS, PARTS[::-1]):
        for part, share in ((open_one, 1.0), (shut, 0.0)):
            fridge.set_openness(data, share, part)
        take_effect(scene.model, data)
        for goal in (DoorsOpen("fridge", part=open_one), DoorsClosed("fridge", part=shut)):
            assert holds(goal, scene, data)
        for goal in (DoorsClosed("fridge", part=open_one), DoorsOpen("fridge", part=shut)):
            assert not holds(goal, scene, data)
        # Just short of the bound.
        fridge.set_openness(data, 0.89, open_one)
        fridge.set_openness(data, 0.006, shut)
        take_effect(scene.model, data)
        assert not holds(DoorsOpen("fridge", part=open_one), scene, data)
        assert not holds(DoorsClosed("fridge", part=shut), scene, data)


def test_terms_of_compartments_have_names_of_their_own() -> None:
    names = [DoorsClosed("fridge", part=part).name for part in ("", *PARTS)]
    assert names == ["fridge_closed", "fridge_fridge_closed", "fridge_freezer_closed"]
    assert DoorsOpen("fridge", part="freezer").name == "fridge_freezer_open"


def test_skills_take_the_doors_of_their_part() -> None:
    env = KitchenEnv(food_in("freezer"), cameras=(), horizon=1)
    env.reset(seed=0)
    found = {
        part: {door.name for door in doors(env, Stage("doors", "open", "fridge", part=part))} for part in ("", *PARTS)
    }
    env.close()
    assert found["fridge"]
    assert found["freezer"]
    assert not found["fridge"] & found["freezer"]
    assert found[""] == found["fridge"] | found["freezer"]


@pytest.mark.parametrize(("part", "verb"), [("fridge", "close_large"), ("freezer", "open")])
def test_the_demonstrator_moves_the_doors_of_one_compartment(part: str, verb: str) -> None:
    task = food_in(part)
    if verb == "open":
        task = dataclasses.replace(task, goal=DoorsOpen("fridge", part=part), initial=())
    task = dataclasses.replace(task, stages=(Stage("doors", verb, "fridge", part=part),))
    other = next(name for name in PARTS if name != part)
    done = []
    for split in ("target", "pretrain"):
        env = KitchenEnv(task, split=split, cameras=(), horizon=600)
        env.reset(seed=0)
        for action in carry_out(env, StageLog()):
            env.step(action)
        done.append(holds(task.goal, env.scene, env.data))
        assert holds(DoorsClosed("fridge", part=other), env.scene, env.data)
        env.close()
    assert any(done)


@pytest.mark.parametrize(("verb", "kind"), [("open", DoorsOpen), ("close", DoorsClosed), ("close_large", DoorsClosed)])
def test_a_stage_at_a_compartment_is_done_with_that_compartment(verb: str, kind: type) -> None:
    task = food_in("freezer")
    stage = Stage("doors", verb, "fridge", part="freezer")
    two = dataclasses.replace(task, stages=(stage, Stage("doors", "open", "fridge", part="fridge")))
    assert stage_condition(two, stage) == kind("fridge", part="freezer")


def test_a_french_door_fridge_has_no_door_to_its_freezer(layouts: dict[int, Layout]) -> None:
    for layout in layouts.values():
        for fridge in layout.of_type("fridge_french_door"):
            assert fridge.compartments == ("fridge",)
            assert len(fridge.doors_of("fridge")) == 2
            with pytest.raises(UnknownNameError, match="freezer"):
                fridge.doors_of("freezer")


def test_a_start_that_a_fridge_has_no_door_for_takes_another_kitchen() -> None:
    task = food_in("fridge", kind="fridge", opened="freezer")
    for seed in range(8):
        scene = build_scene(task, "target", seed)
        assert "freezer" in scene.fixture("fridge").compartments


def test_a_reachable_freezer_is_that_of_a_side_by_side_fridge(layouts: dict[int, Layout]) -> None:
    """In 3 of the 10 target kitchens, and in 12 of the 50 layouts of pretraining, in every style."""
    reachable = {number for number, layout in layouts.items() if candidates(layout, "fridge_with_freezer")}
    assert reachable == {number for number, layout in layouts.items() if layout.of_type("fridge_side_by_side")}
    assert reachable == set(layouts) - set(EXCLUDED["freezer"])
    assert len(reachable & set(range(1, 11))) == 3
    assert len(reachable) == 15


def test_a_cabinet_without_doors_is_shut(layouts: dict[int, Layout]) -> None:
    found = [f for layout in layouts.values() for f in layout.of_type("open_cabinet") if isinstance(f, HingeCabinet)]
    assert found
    scene = SimpleNamespace(fixture=lambda role: found[0], fill=lambda text: text)
    data = cast(mujoco.MjData, None)
    assert DoorsClosed("cabinet").holds(cast(Scene, scene), data)


# Shelves by level -----------------------------------------------------------------------------------------------


def on_level(level: str, compartment: str) -> Task:
    """Food that starts on the shelf of a level."""
    task = food_in(compartment)
    region = SampleRegion(name=f"{compartment}_shelf:{level}")
    start = Placement("fridge", region=region, size=(0.3, 0.2), pos=(0.0, -1.0))
    wanted = dataclasses.replace(task.objects[0], start=start, max_height=0.12)
    return dataclasses.replace(task, objects=(wanted,), goal=OnShelf("obj", "fridge", level, compartment))


def lay(scene: Scene, data: mujoco.MjData, at: np.ndarray) -> None:
    """Put the object's middle to a place in the room, level, along the fridge's sides."""
    data.joint("obj_joint0").qpos[:] = [*at, *yaw_quat(scene.fixture("fridge").yaw)]
    mujoco.mj_forward(scene.model, data)


@pytest.mark.parametrize("compartment", PARTS)
@pytest.mark.parametrize("level", [*LEVELS, ANY_LEVEL])
def test_placement_predicate_and_skill_mean_the_same_shelf(level: str, compartment: str) -> None:
    for split in ("target", "pretrain"):
        for seed in range(3):
            task = on_level(level, compartment)
            scene, data = settled(task, split, seed)
            assert holds(task.goal, scene, data), (split, seed)
            fridge = cast(Fridge, scene.fixture("fridge"))
            skill = scene.part("fridge", f"{compartment}_shelf:{level}")
            at = data.body("obj").xpos
            meant = [name for name, region in fridge.regions.items() if name.startswith(skill)]
            assert any(fridge.regions[name].contains(data, at) for name in meant)
            if level != ANY_LEVEL:
                assert meant == [fridge.usable_shelves(compartment)[-LEVELS[level]]]


def test_levels_may_be_drawn_and_both_compartments_start_open() -> None:
    base = on_level("{_source}", "freezer")
    levels = {"up": ("second_highest", "highest"), "down": ("highest", "second_highest")}
    options = {name: {"_source": source, "_target": target} for name, (source, target) in levels.items()}
    task = dataclasses.replace(
        base,
        choices=(Choice("direction", options),),
        initial=tuple(InitialOpenness("fridge", 0.9, 1.0, part=part) for part in PARTS),
        goal=OnShelf("obj", "fridge", "{_target}", "freezer"),
    )
    drawn = set()
    for seed in range(6):
        scene, data = settled(task, "target", seed)
        drawn.add(scene.choices["direction"])
        assert OnShelf("obj", "fridge", "{_source}", "freezer").holds(scene, data)
        assert not holds(task.goal, scene, data)
        shelf = scene.part("fridge", "freezer_shelf:{_target}")
        assert shelf in scene.fixture("fridge").usable_shelves("freezer")[-2:]
        assert all(holds(DoorsOpen("fridge", 0.85, part=part), scene, data) for part in PARTS)
    assert drawn == set(levels)


def test_levels_of_shelves_exclude_each_other_and_near_misses() -> None:
    scene, data = settled(on_level("highest", "fridge"))
    fridge = cast(Fridge, scene.fixture("fridge"))
    half = np.asarray(scene.objects["obj"].item.size) / 2
    goals = {level: OnShelf("obj", "fridge", level) for level in (*LEVELS, ANY_LEVEL)}
    usable = fridge.usable_shelves("fridge")
    for index, shelf in enumerate(reversed(usable), start=1):
        region = fridge.regions[shelf]
        floor = -region.half[2] + half[2]
        lay(scene, data, region.world(data, (0.0, 0.0, floor)))
        held = {level for level, goal in goals.items() if holds(goal, scene, data)}
        assert held == {ANY_LEVEL} | {level for level, number in LEVELS.items() if number == index}
        # A corner may stand out by 0.05 m, and not farther, and the middle not at all.
        front = -region.half[1] + half[1] - min(0.05, half[1])
        lay(scene, data, region.world(data, (0.0, front + 0.004, floor)))
        assert holds(goals[ANY_LEVEL], scene, data)
        lay(scene, data, region.world(data, (0.0, front - 0.004, floor)))
        assert not holds(goals[ANY_LEVEL], scene, data)
        # Its middle is in the lower nine tenths of the room.
        if half[2] < 0.05:
            lay(scene, data, region.world(data, (0.0, 0.0, 0.79 * region.half[2])))
            assert holds(goals[ANY_LEVEL], scene, data)
            lay(scene, data, region.world(data, (0.0, 0.0, 0.81 * region.half[2])))
            assert not holds(goals[ANY_LEVEL], scene, data)
    # The freezer's shelf at the same height is none of the fridge's.
    freezer = fridge.regions[fridge.usable_shelves("freezer")[-1]]
    lay(scene, data, freezer.world(data, (0.0, 0.0, -freezer.half[2] + half[2])))
    assert not holds(goals[ANY_LEVEL], scene, data)
    assert holds(OnShelf("obj", "fridge", ANY_LEVEL, "freezer"), scene, data)


@pytest.mark.parametrize("kind", [k for k in kinds() if k.startswith("fridge")])
def test_usable_shelves_are_within_reach_and_have_room(kind: str) -> None:
    low, high, room = USABLE_SHELF
    for record in models_of(kind):
        fridge = cast(Fridge, build_appliance(record.model_id, "it", (0.0, 0.0, record.size[2] / 2)))
        for compartment in PARTS:
            shelves = [name for name in fridge.regions if name.startswith(f"{compartment}_shelf")]
            usable = fridge.usable_shelves(compartment)
            for name in shelves:
                region = fridge.regions[name]
                floor = region.center[2] - region.half[2] + fridge.pos[2]
                fits = low <= floor <= high and 2 * region.half[2] >= room - 1e-9
                assert fits == (name in usable)
            heights = [fridge.regions[name].center[2] for name in usable]
            assert heights == sorted(heights)
        # The second highest is one of its own in every model, so that two levels can be told apart.
        assert len(fridge.usable_shelves("fridge")) >= 2
        assert (len(fridge.usable_shelves("freezer")) >= 2) == (kind == "fridge_side_by_side")


def test_a_level_falls_back_to_the_highest_and_mistakes_are_named() -> None:
    one = cast(Fixture, SimpleNamespace(name="fridge", usable_shelves=lambda compartment: ("fridge_shelf2",)))
    none = cast(Fixture, SimpleNamespace(name="fridge", usable_shelves=lambda compartment: ()))
    assert region_names(one, "fridge_shelf:second_highest") == ("fridge_shelf2",)
    assert region_names(one, "fridge_shelf") == ("fridge_shelf",)
    with pytest.raises(PlacementError, match="fridge_with_freezer"):
        region_names(none, "freezer_shelf:highest")
    with pytest.raises(UnknownNameError, match="second_highest"):
        region_names(one, "fridge_shelf:second")


def test_a_stage_that_names_a_level_is_done_on_that_shelf() -> None:
    stage = Stage("pick_place", "place", "fridge", object="obj", part="freezer_shelf:{rack}")
    task = dataclasses.replace(food_in("freezer"), stages=(stage, stage))
    condition = stage_condition(task, stage)
    assert isinstance(condition, AllOf)
    assert condition.parts == (OnShelf("obj", "fridge", "{rack}", "freezer"), GripperFar("obj"))
    assert OnShelf("obj", "fridge", "highest", "freezer").name == "obj_on_highest_freezer_shelf"


@pytest.fixture(scope="module")
def layouts() -> dict[int, Layout]:
    return {number: load_layout(number) for number in layout_ids()}


@pytest.mark.parametrize("model", [record.model_id for record in models_of("fridge_side_by_side")])
def test_a_freezer_is_fitted_with_drawers_for_the_tasks_that_ask_for_them(model: str) -> None:
    usual, fitted = (cast(Fridge, build_appliance(model, "fridge", (0.0, 0.0, 0.0))) for _ in range(2))
    assert not any("freezer_drawer" in name for name in usual.regions)
    fitted.fit("freezer_drawers")
    spec = mujoco.MjSpec()
    fitted.build(spec, MaterialPalette(spec, load_style(1), textures=False))
    built = spec.compile()
    data = mujoco.MjData(built)
    upper = fitted.regions["freezer_drawer1"]
    for share in (0.0, 1.0):
        fitted.set_share(data, "freezer_drawer1", share)
        mujoco.mj_kinematics(built, data)
        floor = upper.world(data, (0.0, 0.0, -upper.half[2]))
        assert 0.5 <= floor[2] + fitted.height / 2 <= 1.05
    assert -fitted.depth / 2 - floor[1] + upper.half[1] > 0.2, "it comes out before the front"
    assert not set(fitted.usable_shelves("freezer")) & {"freezer_drawer0", "freezer_drawer1"}
    with pytest.raises(UserError, match="cannot be fitted"):
        fitted.fit("ovens")


def test_no_other_scene_has_drawers_in_its_freezer() -> None:
    with_drawers = build_scene(get_task("MoveToFreezerDrawer"), "target", 0)
    pair = with_drawers.layout_id, with_drawers.style_id
    other = build_scene(get_task("MoveFridgeToFreezer"), "target", 0, kitchens=(pair,))
    assert with_drawers.fixture("fridge", Fridge).freezer_drawers
    assert not other.fixture("fridge", Fridge).freezer_drawers
