"""Scenes in which predicates are tried, and changes of their states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np
from goal_states import hold, put_object, write

from robocasa_lerobot.envs.predicates.logic import Goal
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InsideOf,
    ObjectSpec,
    OnCounter,
    Placement,
    RobotStart,
    SampleRegion,
)

_HOB_Z_M = (0.7, 1.2)  # not the oven
_BURNER = Placement(
    "stove", region=SampleRegion(name="any", height=_HOB_Z_M), size=(0.02, 0.02), pos=(0.0, 0.0), ensure_inside=False
)
STOVE = SceneSpec(
    name="TwoOnAStove",
    fixtures=(FixtureSpec("stove", "stove"),),
    robot_start=RobotStart("stove"),
    objects=(ObjectSpec("pan", ("pan",), _BURNER), ObjectSpec("pot", ("pot",), _BURNER)),
    instruction="Cook.",
)
SINK = SceneSpec(
    name="OneInASink",
    fixtures=(FixtureSpec("sink", "sink"),),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("obj", ("sponge",), OnCounter("sink", loc="left_right", size=(0.30, 0.30))),
        ObjectSpec("distr_counter", ("apple",), OnCounter("sink", loc="left_right", size=(0.30, 0.40))),
        ObjectSpec("distr_sink", ("bowl",), InsideOf("sink", size=(0.25, 0.25), at=1.0)),
    ),
    instruction="Wash.",
)
PLATE = SceneSpec(
    name="OneBesideAPlate",
    fixtures=(FixtureSpec("sink", "sink"),),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("plate", ("plate",), OnCounter("sink", loc="left_right", size=(0.40, 0.40))),
        ObjectSpec("obj", ("apple",), OnCounter("sink", loc="left_right", size=(0.40, 0.40))),
    ),
    instruction="Serve.",
)
TOASTER_OVEN = SceneSpec(
    name="OneAtAToasterOven",
    fixtures=(FixtureSpec("toaster_oven", "toaster_oven_with_two_racks"),),
    robot_start=RobotStart("toaster_oven"),
    objects=(ObjectSpec("obj", ("sugar_cube",), OnCounter("toaster_oven", loc="left_right", size=(0.30, 0.30))),),
    instruction="Toast.",
)
type Change = Callable[[Scene, mujoco.MjData], Any]


def state(scene: Scene) -> mujoco.MjData:
    return scene.initial_data(np.random.default_rng(0))[0]


def shift(name: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Change:
    """Move an object, metres."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        put_object(scene, data, name, middle_of(scene, data, name) + np.array([x, y, z]))

    return change


def beside(name: str, other: str, x: float, z: float = 0.0) -> Change:
    """Put an object's origin beside another's, metres."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        data.joint(f"{name}_joint0").qpos[:3] = data.body(other).xpos + np.array([x, 0.0, z])

    return change


def check_hits_and_misses(scene: Scene, goal: Goal, hits: Sequence[Change], misses: Sequence[Change]) -> None:
    """A goal holds in the state that is written for it and after the hits, but after none of the misses."""
    data = state(scene)
    write(goal, scene, data)
    assert hold(goal, scene, data) is None
    for number, change in enumerate([*hits, *misses]):
        data = state(scene)
        write(goal, scene, data)
        hold(goal, scene, data)  # positions are evaluated, which changes start from
        change(scene, data)
        assert (hold(goal, scene, data) is None) == (number < len(hits)), f"change {number}"
