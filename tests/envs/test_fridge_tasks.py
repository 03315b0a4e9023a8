"""Tasks at a fridge leave its freezer alone, unless they name it, and use the shelves that the arm reaches."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.appliances.catalogue import build_appliance, kinds, models_of
from robocasa_lerobot.envs.kitchens.appliances.kinds.fridge import Fridge
from robocasa_lerobot.envs.kitchens.fixtures.regions import LEVELS
from robocasa_lerobot.envs.kitchens.layout import layout_ids, load_layout
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style
from robocasa_lerobot.envs.predicates import DoorsClosed, DoorsOpen
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of

FREEZER_DOOR_KINDS = ("fridge_side_by_side", "fridge_bottom_freezer")
MODELS = [record.model_id for kind in FREEZER_DOOR_KINDS for record in models_of(kind)]
# Their blueprints say of the freezer's door, too, that it starts open.
OPENS_BOTH = {"MoveFreezerToFridge", "MoveFridgeToFreezer", "MoveToFreezerDrawer"}
# Of atomic tasks, what starts on a shelf.
ON_SHELVES = {
    "OpenFridge": ("door_obj",),
    "CloseFridge": ("door_obj",),
    "OpenFridgeDrawer": ("distr_shelf",),
    "CloseFridgeDrawer": ("distr_shelf",),
    "PickPlaceFridgeShelfToDrawer": ("obj", "distr"),
    "PickPlaceFridgeDrawerToShelf": ("distr",),
}


def alone(model_id: str) -> tuple[Fridge, Scene, mujoco.MjData]:
    """A fridge with nothing round it, and as much of a scene as goals of doors ask for."""
    fridge = cast(Fridge, build_appliance(model_id, "it", (0.0, 0.0, 0.0)))
    spec = mujoco.MjSpec()
    fridge.build(spec, MaterialPalette(spec, load_style(1), textures=False))
    scene = SimpleNamespace(fixture=lambda role: fridge, fill=lambda text: text)
    return fridge, cast(Scene, scene), mujoco.MjData(spec.compile())


def test_these_are_all_fridges_with_a_door_to_their_freezer() -> None:
    assert MODELS
    for kind in (kind for kind in kinds() if kind.startswith("fridge")):
        for record in models_of(kind):
            fridge = build_appliance(record.model_id, "it", (0.0, 0.0, 0.0))
            assert ("freezer" in fridge.compartments) == (record.model_id in MODELS)


@pytest.mark.parametrize("model_id", MODELS)
@pytest.mark.parametrize("name", ["OpenFridge", "CloseFridge"])
def test_the_freezer_stays_shut_and_does_not_count(name: str, model_id: str) -> None:
    fridge, scene, data = alone(model_id)
    task, wanted = get_task(name), float(name == "OpenFridge")
    goal, (start,), (stage,) = goal_of(task), task.initial, stages_of(task)
    assert isinstance(goal, DoorsOpen | DoorsClosed)
    assert isinstance(start, InitialOpenness)
    assert fridge.doors_of(stage.part) == ("fridge_door",)
    fridge.set_openness(data, start.high, start.part)
    assert fridge.door_shares(data, "freezer") == pytest.approx([0.0])
    assert not goal.holds(scene, data)
    for freezer in (0.0, 1.0):
        fridge.set_openness(data, freezer, "freezer")
        fridge.set_openness(data, wanted, "fridge")
        assert goal.holds(scene, data)
        fridge.set_openness(data, 1.0 - wanted, "fridge")
        assert not goal.holds(scene, data)


def test_only_tasks_of_both_compartments_open_both() -> None:
    found = set()
    for name in task_names():
        task = get_task(name)
        fridges = {fixture.role for fixture in task.fixtures if fixture.kind.startswith("fridge")}
        openings = [entry for entry in task.initial if isinstance(entry, InitialOpenness)]
        found |= {name for entry in openings if entry.fixture in fridges and not entry.part}
    assert found == OPENS_BOTH


@pytest.mark.parametrize("kind", FREEZER_DOOR_KINDS)
@pytest.mark.parametrize("name", ["BuildAppetizerPlate", "CloseFridge", "CloseFridgeDrawer"])
def test_the_freezer_is_shut_where_the_fridge_starts_open(name: str, kind: str) -> None:
    task = get_task(name)
    (role,) = (fixture.role for fixture in task.fixtures if fixture.kind.startswith("fridge"))
    pairs = [(number, 1) for number in layout_ids() if load_layout(number).of_type(kind)]
    scene = build_scene(task, "target", 0, kitchens=pairs)
    data, _ = scene.initial_data(np.random.default_rng(0))
    assert "freezer" in scene.fixture(role).compartments
    assert DoorsOpen(role, 0.85, part="fridge").holds(scene, data)
    assert DoorsClosed(role, part="freezer").holds(scene, data)


@pytest.mark.parametrize("name", ON_SHELVES)
def test_what_starts_on_a_shelf_is_within_reach(name: str) -> None:
    task = get_task(name)
    for seed in range(3):
        scene = build_scene(task, "target", seed)
        fridge, data = scene.fixture(task.fixtures[0].role, Fridge), mujoco.MjData(scene.model)
        mujoco.mj_kinematics(scene.model, data)
        usable = fridge.usable_shelves("fridge")
        for thing in ON_SHELVES[name]:
            at = np.asarray(scene.objects[thing].pos)
            assert any(fridge.regions[shelf].contains(data, at) for shelf in usable), (seed, thing)
        if name == "PickPlaceFridgeShelfToDrawer":
            shelf = usable[-LEVELS[scene.choices["level"]]]
            assert fridge.regions[shelf].contains(data, np.asarray(scene.objects["obj"].pos))
