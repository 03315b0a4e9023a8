"""Buttons and doors in kitchens where the plain way to hold the hand, or the plain place to stand, does not do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.recorder import Recording, record_episode
from robocasa_lerobot.demos.skills import arc_motion
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart
from robocasa_lerobot.demos.skills.knobs import raise_knob
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.predicates import DoorsOpen
from robocasa_lerobot.envs.scene.spec import InitialOpenness, Placement
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import Stage, Task


def demonstration(task: str | Task, split: str, seed: int) -> Recording:
    env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
    try:
        return record_episode(env, seed, varied=True)
    finally:
        env.close()


@pytest.mark.parametrize(("split", "seed"), [("target", 100_002), ("pretrain", 100_009)])
def test_a_low_button_beside_a_doors_handle_is_pressed_at_once(split: str, seed: int) -> None:
    # Level hands meet the handle: without hands turned to the side, every press misses.
    recording = demonstration("TurnOffMicrowave", split, seed)
    assert recording.success, recording.reason
    assert len(recording.actions) < 150


@pytest.mark.parametrize(("split", "seed"), [("target", 100_002), ("pretrain", 100_011)])
def test_a_door_before_an_island_is_lifted_from_beside_it(split: str, seed: int) -> None:
    # The arm, solved from its home pose alone, does not get down to the edge from there.
    recording = demonstration("CloseDishwasher", split, seed)
    assert recording.success, recording.reason


def every_door_of_a_fridge() -> Task:
    """OpenFridge with the freezer's door as well, and something in either compartment; no task of the benchmark."""
    task = get_task("OpenFridge")
    inside, *beside = task.objects
    return replace(
        task,
        objects=(replace(inside, start=Placement("fxtr", size=(0.3, 0.3), pos=(None, -1.0))), *beside),
        initial=(InitialOpenness("fxtr", 0.0, 0.0),),
        goal=DoorsOpen("fxtr"),
        stages=(Stage("doors", "open", "fxtr"),),
    )


@pytest.mark.parametrize(("split", "seed"), [("target", 100_006), ("pretrain", 100_003)])
def test_a_freezer_below_is_opened_with_the_arm_let_down(split: str, seed: int) -> None:
    recording = demonstration(every_door_of_a_fridge(), split, seed)
    assert recording.success, recording.reason


@pytest.mark.parametrize(
    ("task", "split", "seed"),
    [
        ("TurnOnToaster", "pretrain", 100_400),  # the palm would lie on the toaster's case
        ("TurnOnToaster", "pretrain", 100_403),
        ("CloseElectricKettleLid", "pretrain", 100_402),  # below wall cabinets
    ],
)
def test_what_is_low_or_under_a_cabinet_is_pressed_by_a_turned_hand(task: str, split: str, seed: int) -> None:
    recording = demonstration(task, split, seed)
    assert recording.success, recording.reason


def test_food_that_falls_into_a_bowl_leaves_both_fingers() -> None:
    # Between open fingers of different heights it would hang on the lower one.
    recording = demonstration("PickPlaceCounterToStandMixer", "pretrain", 100_401)
    assert recording.success, recording.reason


def test_a_hand_that_knocks_a_door_back_goes_no_farther(monkeypatch: pytest.MonkeyPatch) -> None:
    # It would push on from outside until its steps are used up.
    led: list[float] = []

    def knock(env: KitchenEnv, joints: object, gripper: float) -> Iterator[Array]:
        door.angle -= 2 * arc_motion.KNOCKED_RAD
        return iter(())

    def lead(*_: object, **__: object) -> Iterator[Array]:
        led.append(door.angle)
        return iter(())

    door = SimpleNamespace(name="door", angle=1.0)
    plan = SimpleNamespace(cost=0.0, joints=None, path=SimpleNamespace(waypoints=(), contact=0))
    for name, value in {
        "arm_bends": lambda *_: None,
        "plan_contact": lambda *_, **__: plan,
        "spots": lambda *_: None,
        "take_stance": lambda *_: iter(()),
        "draw_back": lambda *_: iter(()),
        "follow_joint_path": knock,
        "follow_arc": lead,
    }.items():
        monkeypatch.setattr(arc_motion, name, value)
    env = cast(KitchenEnv, SimpleNamespace(data=None))
    part = cast(ArticulatedPart, door)
    assert list(arc_motion.push_arc(env, part, [], [], 1.5)) == []  # opened: it was knocked shut
    assert led == []
    assert list(arc_motion.push_arc(env, part, [], [], 0.0)) == []  # shut: it was knocked on its way
    assert len(led) == 1


def test_a_knob_at_the_side_of_a_mixer_is_turned_from_its_front() -> None:
    env = KitchenEnv("MakeCheesecakeFilling", split="target", cameras=(), terminate_on_success=False)
    env.render_observations = False
    try:
        env.reset(seed=140_001)
        for action in raise_knob(env, env.declaration.stages[-1]):
            env.step(action.astype("float32"))
        assert env.scene.fixture("stand_mixer", Appliance).share(env.data, "knob_speed") > 0.2
    finally:
        env.close()
