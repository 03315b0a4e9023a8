"""A new appliance is a class and a record: here two kinds that no file of the package knows of, in built kitchens."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, ClassVar

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.checks.soundness import blocked_walkways, overlaps
from robocasa_lerobot.envs.kitchens import layout as layout_module
from robocasa_lerobot.envs.kitchens.appliances import catalogue
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Standing, take_effect
from robocasa_lerobot.envs.kitchens.appliances.kind_record import Kind
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.appliances.records import Family
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, SweptBox
from robocasa_lerobot.envs.kitchens.fixtures.swept import open_doors
from robocasa_lerobot.envs.kitchens.layout import layout_record, load_layout
from robocasa_lerobot.envs.kitchens.materials import load_style, split_of, style_ids
from robocasa_lerobot.envs.predicates import DoorsClosed, DoorsOpen
from robocasa_lerobot.envs.scene.assembly import bare_kitchen
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.roles import candidates, ground_fixture
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.errors import UnknownNameError, UserError

WALL_M = 0.02


@dataclass
class AirFryer(Appliance):
    """A box with a door at its front, which stands on counters."""

    @property
    def doors(self) -> tuple[str, ...]:
        """The door."""
        return ("door",)

    @property
    def regions(self) -> dict[str, Region]:
        """Its inside."""
        half = np.array(self.size) / 2 - WALL_M
        return {"interior": Region.between(self.name, -half, half)}

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its programmes."""
        return {"fish": {name: "fish programme"}, "chips": {name: "chips programme"}}

    def swept_areas(self) -> tuple[SweptBox, ...]:
        """Its open door."""
        return open_doors(self, ("left",), self.width)

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add the case and the door."""
        width, depth, height = self.size
        half = np.array(self.size) / 2
        parts.shell(root, -half + [0, WALL_M, 0], half, WALL_M, self.record["finish"], "lining", open_side="front")
        pos, middle = (-width / 2, -depth / 2 + WALL_M, 0.0), (width / 2, -WALL_M / 2, 0.0)
        size = (width, WALL_M, height)
        door = parts.hinge(root, "door", pos, (0, 0, 1), (-np.pi / 2, 0.0), mass=1.0, size=size, center=middle)
        parts.box(door, middle, (width - 0.004, WALL_M - 0.004, height - 0.004), self.record["finish"])


@dataclass
class WineCooler(AirFryer):
    """The same, as high as a man, on the floor."""

    standing: ClassVar[Standing] = Standing("floor")


def kind_of(name: str, made_by: type[Appliance], low: tuple[float, float, float], **more: Any) -> Kind:
    families = (Family("plain", low, tuple(1.05 * side for side in low), ("black", "steel")),)  # type: ignore[arg-type]
    return Kind(name, name, more.get("count", 12), more.get("target", 4), families, made_by=made_by)


FRYER = kind_of("test_air_fryer", AirFryer, (0.28, 0.28, 0.30))
COOLER = kind_of("test_wine_cooler", WineCooler, (0.56, 0.60, 1.70))


@pytest.fixture(autouse=True)
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """The two kinds in the catalogue, and in layout 1: one on the counter, one at the end of its row."""
    monkeypatch.setattr(catalogue, "_KINDS", dict(catalogue._KINDS))
    for kind in (FRYER, COOLER):
        catalogue.register(kind)
    record = copy.deepcopy(layout_record(1))
    record["back"]["counter"] = [{"test_air_fryer": 5.4}, {"microwave": 0.9}]
    record["back"]["base"].append({"test_wine_cooler": 0.62})
    record["room"]["width"] += 0.7
    monkeypatch.setattr(layout_module, "layout_record", lambda layout_id: record)


def scene_with(kind: str, style_id: int) -> Scene:
    task = Task(
        name="CloseTheNewOne",
        summary="It is shut.",
        fixtures=(FixtureSpec("new", kind),),
        robot_start=RobotStart("new"),
        choices=(Choice("programme", of="new"),),
        objects=(ObjectSpec("obj", ("lime",), Placement("new", size=(0.2, 0.2))),),
        initial=(InitialOpenness("new", 0.9, 1.0),),
        goal=DoorsClosed("new"),
        stages=(Stage("doors", "close", "new"),),
        instruction="Close the {doors} of the {new} for its {programme}.",
    )
    return build_scene(task, split_of(style_id), 3, kitchens=[(1, style_id)])


@pytest.mark.parametrize("kind", ["test_air_fryer", "test_wine_cooler"])
def test_a_kitchen_is_built_with_it_and_a_task_asks_for_it(kind: str) -> None:
    scene = scene_with(kind, 1)
    fixture = scene.fixture("new", AirFryer)
    data, _ = scene.initial_data(np.random.default_rng(0))
    word = kind.replace("_", " ")
    assert scene.instruction in {f"Close the door of the {word} for its {p} programme." for p in ("fish", "chips")}
    assert DoorsOpen("new", 0.85).holds(scene, data)
    assert fixture.regions["interior"].contains(data, data.body("obj").xpos)
    fixture.set_openness(data, 0.0)
    take_effect(scene.model, data)
    assert DoorsClosed("new").holds(scene, data)
    # The robot stands before what is on the floor, and before the counter of what is on one.
    ground = ground_fixture(scene.layout, fixture)
    assert (ground is fixture) == (kind == "test_wine_cooler")


@pytest.mark.parametrize("style_id", [1, 30])
def test_the_kitchen_is_sound(style_id: int) -> None:
    layout = load_layout(1, style_id)
    assert [f.name for f in candidates(layout, "test_air_fryer")] == ["test_air_fryer"]
    assert [f.name for f in candidates(layout, "test_wine_cooler")] == ["test_wine_cooler"]
    model = bare_kitchen(layout)[0].compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert overlaps(model, data, layout.fixtures) == []
    assert not any("test_" in fault for fault in blocked_walkways(layout))


def test_every_style_draws_a_model_of_its_split_and_always_the_same() -> None:
    drawn = {}
    for style_id in style_ids():
        style = load_style(style_id)
        assert FRYER.name not in style.appliances
        drawn[style_id] = catalogue.model_for(style, FRYER.name)
        assert drawn[style_id] == catalogue.model_for(load_style(style_id), FRYER.name)
        assert drawn[style_id].split == split_of(style_id)
    assert {model.model_id for model in drawn.values()} == {m.model_id for m in catalogue.models_of(FRYER.name)}


def test_mistakes_with_kinds_are_named() -> None:
    with pytest.raises(UserError, match="another name"):
        catalogue.register(FRYER)
    catalogue.register(kind_of("test_only_pretrain", AirFryer, (0.28, 0.28, 0.30), target=0))
    with pytest.raises(UserError, match="target split"):
        catalogue.model_for(load_style(1), "test_only_pretrain")
    with pytest.raises(UnknownNameError, match="test_air_fryer"):
        candidates(load_layout(1), "test_air_frier")
