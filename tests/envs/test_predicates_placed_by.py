"""Predicates of places by fixtures, beside others and on them, and of tilts: true where written, false nearby."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from goal_states import hold
from predicate_scenes import SINK, Change, check_hits_and_misses, shift, state

from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.predicates import (
    BeforeStools,
    Behind,
    Beside,
    Goal,
    HandlePoints,
    Higher,
    NearFixture,
    ObjectTilt,
    RestsOn,
)
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.registry import get_task


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(SINK, "target", 0)


def by_corner(name: str, across: float, up: float = 0.0) -> Change:
    """Put an object's origin to the right of the sink's upper front right corner, metres."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        sink = scene.fixture("sink")
        right, back = axes_of(sink.yaw)
        corner = np.asarray(sink.pos) + sink.width / 2 * right - sink.depth / 2 * back
        data.joint(f"{name}_joint0").qpos[:3] = corner + across * right + [0.0, 0.0, sink.height / 2 + up]

    return change


def axes_of(yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """To the right and to the back of a fixture."""
    return np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([-np.sin(yaw), np.cos(yaw), 0.0])


def with_gap(metres: float) -> Change:
    """Turn an object as the sink is and leave a gap between it and the sink's right side."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        sink = scene.fixture("sink")
        right, _ = axes_of(sink.yaw)
        free = data.joint("obj_joint0")
        aside = sink.width / 2 + scene.objects["obj"].item.size[0] / 2 + metres
        free.qpos[:3] = np.asarray(sink.pos) + aside * right
        free.qpos[3:] = [np.cos(sink.yaw / 2), 0.0, 0.0, np.sin(sink.yaw / 2)]

    return change


def seen_beside(across: float, along: float) -> Change:
    """Put an object to the right and to the back of another one, as seen from before the sink, metres."""

    def change(scene: Scene, data: mujoco.MjData) -> None:
        right, back = axes_of(scene.fixture("sink").yaw)
        data.joint("obj_joint0").qpos[:3] = data.body("distr_sink").xpos + across * right + along * back

    return change


def tilted(degrees: float) -> Change:
    def change(scene: Scene, data: mujoco.MjData) -> None:
        half = np.deg2rad(degrees) / 2
        data.joint("obj_joint0").qpos[3:] = [np.cos(half), 0.0, np.sin(half), 0.0]

    return change


# Predicate, what still counts, and what does not any more, each from a state in which it holds.
CASES: dict[str, tuple[Goal, list[Change], list[Change]]] = {
    "near a corner of a fixture": (
        NearFixture("obj", "sink", 0.35, to_corner=True),
        [by_corner("obj", 0.349), by_corner("obj", 0.2, 0.28)],
        [by_corner("obj", 0.351), by_corner("obj", 0.25, 0.25)],
    ),
    "near the box of a fixture": (
        NearFixture("obj", "sink", 0.2),
        [with_gap(0.199), with_gap(-0.02)],
        [with_gap(0.201)],
    ),
    "to the right": (
        Beside("obj", "distr_sink", "sink", across=0.25, along=0.1, side="right"),
        [seen_beside(0.249, 0.099), seen_beside(0.01, -0.099)],
        [seen_beside(0.251, 0.0), seen_beside(0.1, 0.101), seen_beside(-0.01, 0.0)],
    ),
    "to the left": (
        Beside("obj", "distr_sink", "sink", across=0.25, along=0.1, side="left"),
        [seen_beside(-0.249, 0.0)],
        [seen_beside(-0.251, 0.0), seen_beside(0.01, 0.0)],
    ),
    "at either side": (
        Beside("obj", "distr_sink", "sink", across=0.25, along=0.1),
        [seen_beside(-0.249, 0.0), seen_beside(0.249, 0.0)],
        [seen_beside(0.0, -0.101)],
    ),
    "behind": (
        Behind("obj", "distr_sink", "sink", by=0.1),
        [seen_beside(0.0, 0.101), seen_beside(-0.5, 0.4)],
        [seen_beside(0.0, 0.099), seen_beside(0.3, -0.2)],
    ),
    "rests on": (
        RestsOn("distr_counter", "obj"),
        [shift("distr_counter", x=0.01)],
        [shift("distr_counter", z=0.006), shift("distr_counter", x=0.1), shift("distr_counter", z=-0.07)],
    ),
    "rests on, higher": (RestsOn("distr_counter", "obj", higher=0.04), [], [shift("distr_counter", z=-0.02)]),
    "higher": (
        Higher("obj", "distr_counter"),
        [shift("obj", z=0.5), shift("obj", x=0.5)],
        [shift("obj", z=-0.011), shift("distr_counter", z=0.011)],
    ),
    "tilted": (
        ObjectTilt("obj", high=np.deg2rad(30.0)),
        [tilted(0.0), tilted(29.9), tilted(-29.9)],
        [tilted(30.1), tilted(-30.1), tilted(180.0)],
    ),
    "upside down": (ObjectTilt("obj", low=np.deg2rad(165.0)), [tilted(166.0)], [tilted(164.0), tilted(0.0)]),
}


@pytest.mark.parametrize("case", CASES)
def test_it_holds_in_its_state_and_in_no_near_miss(case: str, scene: Scene) -> None:
    check_hits_and_misses(scene, *CASES[case])


@pytest.mark.parametrize("case", CASES)
def test_it_is_the_same_in_a_state_that_was_set_again(case: str, scene: Scene) -> None:
    goal, hits, misses = CASES[case]
    for change in [*hits, *misses]:
        data, again = state(scene), state(scene)
        change(scene, data)
        held = hold(goal, scene, data)
        again.qpos[:] = data.qpos
        assert hold(goal, scene, again) == held


def test_who_sits_on_a_stool_looks_at_the_counter() -> None:
    """The right hand of somebody on a stool is at the left of who stands before the same counter from the stool's."""
    task = get_task("PortionHotDogs")
    scene = build_scene(task, "target", 100_000)
    data = state(scene)
    stool, plate = scene.fixture("stool1"), data.body("plate1").xpos
    ahead = -axes_of(stool.yaw)[1]
    assert (plate - np.asarray(stool.pos)) @ ahead > 0.0, "the stool looks at the counter"
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    for side, sign in (("right", 1.0), ("left", -1.0)):
        goal = Beside("sausage1", "plate1", "stool1", across=0.25, along=0.1, side=side)
        for way, held in ((sign, True), (-sign, False)):
            data.joint("sausage1_joint0").qpos[:3] = plate + way * 0.2 * right
            assert (hold(goal, scene, data) is None) == held


def test_every_object_has_a_stool_of_its_own() -> None:
    scene = build_scene(get_task("SetupBowls"), "target", 100_000)
    data = state(scene)
    first, second, *_ = scene.layout.of_type("stool")

    def put(name: str, stool: Fixture, across: float, along: float) -> None:
        right, back = axes_of(stool.yaw)
        data.joint(f"{name}_joint0").qpos[:3] = np.asarray(stool.pos) + across * right - along * back

    goal = BeforeStools(("bowl1", "bowl2"), across=0.15, along=0.3)
    for one, other in ((first, second), (second, first)):
        put("bowl1", one, 0.14, 0.29)
        put("bowl2", other, -0.14, 0.29)
        assert hold(goal, scene, data) is None
    for across, along in ((0.16, 0.2), (0.0, 0.31)):
        put("bowl2", first, across, along)
        assert hold(goal, scene, data)
    put("bowl1", first, 0.05, 0.2)
    put("bowl2", first, -0.05, 0.2)
    assert hold(goal, scene, data), "both before the same one"


@pytest.mark.parametrize("side", ["right", "left", "front", "back"])
def test_a_handle_points_to_a_side(side: str) -> None:
    scene = build_scene(get_task("OrganizeMugsByHandle"), "target", 100_000)
    data, cabinet = state(scene), scene.fixture("cabinet")
    goal = HandlePoints("mug_counter1", "cabinet", side, float(np.deg2rad(40.0)))
    middle = {"right": 0.0, "back": 90.0, "left": 180.0, "front": -90.0}[side]
    for off, held in ((-39.0, True), (39.0, True), (-41.0, False), (41.0, False), (180.0, False)):
        # Handles of mugs lie along +x.
        half = (cabinet.yaw + np.deg2rad(middle + off)) / 2
        data.joint("mug_counter1_joint0").qpos[3:] = [np.cos(half), 0.0, 0.0, np.sin(half)]
        assert (hold(goal, scene, data) is None) == held
