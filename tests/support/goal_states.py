"""Writes states in which goals hold: one function for each predicate that can be reached without physics.

A new predicate is registered here, among what holds at the start, or among what only physics brings about.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import singledispatch

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, take_effect
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    BeforeStools,
    Behind,
    Beside,
    BurnerLevel,
    DoorsClosed,
    DoorsOpen,
    DrawerClosed,
    DrawerOpen,
    Exactly,
    ForEach,
    Goal,
    Grasped,
    GripperFar,
    GripperFarFromPart,
    GripperTouches,
    HandlePoints,
    Higher,
    MovedSince,
    Near,
    NearerThan,
    NearFixture,
    Never,
    Not,
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectOnRack,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
    OnBurner,
    Once,
    OnOneSide,
    OverBasin,
    PartTurned,
    PartWithin,
    RestsOn,
    StandsBefore,
    StandsNear,
    StateIs,
    StepsWhile,
    Strokes,
    UnderWater,
    When,
    WithMemory,
)
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.predicates.placed_by import handle_direction
from robocasa_lerobot.envs.scene.initial_states import initial_share
from robocasa_lerobot.envs.scene.scene import Scene

AWAKE = -(1 + 10)  # of `tree_asleep`: and 10 quiet steps (mjMINAWAKE) away from sleep
# What holds as long as nothing was done; and what moves objects or the robot to where they stay, which the
# demonstrators' tests do.
AT_START = (GripperFar, GripperFarFromPart, Never)
MOVED = (
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
    StandsBefore,
    StandsNear,
)


def leaves(goal: Goal) -> Iterator[Goal]:
    """The single conditions of a goal; what has memory is one."""
    if isinstance(goal, WithMemory) or not goal.inner:
        yield goal
        return
    for part in goal.inner:
        yield from leaves(part)


def can_be_written(kind: type[Goal]) -> bool:
    """Whether `write` knows a predicate."""
    return write.dispatch(kind) is not write.dispatch(object)


def evaluate(scene: Scene, data: mujoco.MjData) -> None:
    """Evaluate a state that was written, with everything awake: sleeping things may have been put onto others."""
    data.tree_asleep[:] = AWAKE
    take_effect(scene.model, data)


def hold(goal: Goal, scene: Scene, data: mujoco.MjData) -> dict[str, bool] | None:
    """Evaluate a state that was written; the terms where the goal does not hold, for messages."""
    evaluate(scene, data)
    terms: dict[str, bool] = {}
    return None if goal.evaluate(scene, data, terms) else terms


def put_object(scene: Scene, data: mujoco.MjData, name: str, middle: NDArray[np.float64]) -> None:
    """Move the middle of an object, or of where it holds things, to a point of the room, as it is turned."""
    mujoco.mj_kinematics(scene.model, data)  # it may have been moved before
    free = data.joint(f"{name}_joint0")
    free.qpos[:3] += middle - middle_of(scene, data, name)
    free.qvel[:] = 0.0


@singledispatch
def write(goal: Goal, scene: Scene, data: mujoco.MjData) -> None:
    """Write the state that a goal asks for; positions are to be evaluated afterwards."""
    assert isinstance(goal, AT_START), f"{goal}: nobody knows how to write it"


@write.register
def _all(goal: AllOf, scene: Scene, data: mujoco.MjData) -> None:
    for part in goal.parts:
        write(part, scene, data)


@write.register
def _any(goal: AnyOf, scene: Scene, data: mujoco.MjData) -> None:
    write(goal.parts[0], scene, data)


@write.register
def _exactly(goal: Exactly, scene: Scene, data: mujoco.MjData) -> None:
    for part in goal.parts[: goal.n]:
        write(part, scene, data)


@write.register
def _each(goal: ForEach, scene: Scene, data: mujoco.MjData) -> None:
    write(goal.bound(scene), scene, data)


@write.register
def _not(goal: Not, scene: Scene, data: mujoco.MjData) -> None:
    """What is not wanted does not hold by itself."""


@write.register
def _when(goal: When, scene: Scene, data: mujoco.MjData) -> None:
    write(goal.goals[scene.choices[goal.choice]], scene, data)


@write.register(DoorsOpen)
@write.register(DrawerOpen)
def _open(goal: DoorsOpen | DrawerOpen, scene: Scene, data: mujoco.MjData) -> None:
    scene.fixture(goal.fixture).set_openness(data, 1.0, getattr(goal, "part", ""))


@write.register(DoorsClosed)
@write.register(DrawerClosed)
def _closed(goal: DoorsClosed | DrawerClosed, scene: Scene, data: mujoco.MjData) -> None:
    scene.fixture(goal.fixture).set_openness(data, 0.0, getattr(goal, "part", ""))


@write.register
def _part_within(goal: PartWithin, scene: Scene, data: mujoco.MjData) -> None:
    low, high = max(goal.low, 0.0), min(goal.high, 1.0)
    scene.fixture(goal.fixture, Appliance).set_share(data, scene.fill(goal.part), (low + high) / 2)


@write.register
def _part_turned(goal: PartTurned, scene: Scene, data: mujoco.MjData) -> None:
    share = initial_share(scene, goal.fixture, goal.part) + 1.2 * goal.by
    scene.fixture(goal.fixture, Appliance).set_share(data, goal.part, share)


@write.register
def _burner_level(goal: BurnerLevel, scene: Scene, data: mujoco.MjData) -> None:
    scene.fixture(goal.fixture, Hob).set_burner(data, scene.fill(goal.location), goal.level)


@write.register
def _state_is(goal: StateIs, scene: Scene, data: mujoco.MjData) -> None:
    fixture, key = scene.fixture(goal.fixture), scene.fill(goal.key)
    if key == "water_on":
        scene.fixture(goal.fixture, Sink).set_water(data, goal.value)
    elif key.endswith("_on"):
        scene.fixture(goal.fixture, Hob).set_burner(data, key.removesuffix("_on"), "on" if goal.value else "off")
    elif key in ("left", "right"):
        scene.fixture(goal.fixture, Appliance).set_position(data, "spout", 1.0 if key == "right" else -1.0)
    elif key == "lid":
        assert isinstance(fixture, Blender)
        assert goal.value
        fixture.set_lid(data)
    else:
        assert key == "on", (fixture.name, key)
        scene.fixture(goal.fixture, Appliance).set_share(data, "power", float(goal.value))


@write.register
def _under_water(goal: UnderWater, scene: Scene, data: mujoco.MjData) -> None:
    sink = scene.fixture(goal.fixture, Sink)
    sink.set_water(data, True)
    put_object(scene, data, scene.fill(goal.object), data.site(f"{sink.name}_water").xpos - [0.0, 0.0, 0.15])


@write.register
def _on_burner(goal: OnBurner, scene: Scene, data: mujoco.MjData) -> None:
    """On the burner asked for, on the one that it has been put on already, or on the first that is off."""
    hob, name = scene.fixture(goal.fixture, Hob), scene.fill(goal.object)
    mujoco.mj_kinematics(scene.model, data)
    nearest, apart = hob.nearest_burner(data, middle_of(scene, data, name))
    others = [location for location in hob.burners if hob.burner_level(data, location) == "off"]
    burner = scene.fill(goal.burner) or (nearest if apart < 0.01 else others[0])
    top = data.site(f"{hob.name}_burner_on_{burner}").xpos
    put_object(scene, data, name, np.array([*top[:2], 0.0]))
    # A hair into the grate, so that they touch.
    data.joint(f"{name}_joint0").qpos[2] = top[2] - scene.objects[name].item.bottom_offset - 0.0005
    if goal.lit is not None:
        hob.set_burner(data, burner, "on" if goal.lit else "off")


@write.register
def _on_rack(goal: ObjectOnRack, scene: Scene, data: mujoco.MjData) -> None:
    """A hair into the highest rack, so that they touch."""
    fixture, name = scene.fixture(goal.fixture, Racked), scene.fill(goal.object)
    room = fixture.regions[fixture.racks[-1]]
    floor = room.world(data, (0.0, 0.0, -room.half[2]))
    put_object(scene, data, name, floor)
    data.joint(f"{name}_joint0").qpos[2] = floor[2] - scene.objects[name].item.bottom_offset - 0.0005


@write.register
def _near(goal: Near, scene: Scene, data: mujoco.MjData) -> None:
    other = goal.other if isinstance(goal.other, str) else goal.other[0]
    beside = data.body(scene.fill(other)).xpos + np.array([0.9 * goal.within, 0.0, 0.0])
    data.joint(f"{scene.fill(goal.object)}_joint0").qpos[:3] = beside


@write.register
def _nearer(goal: NearerThan, scene: Scene, data: mujoco.MjData) -> None:
    names = [goal.objects] if isinstance(goal.objects, str) else [*goal.objects]
    first = goal.to if isinstance(goal.to, str) else goal.to[0]
    for number, name in enumerate((name for name in names if name != first), start=1):
        data.joint(f"{name}_joint0").qpos[:3] = data.body(first).xpos + np.array([0.0, 0.0, 0.01 * number])


@write.register
def _on_one_side(goal: OnOneSide, scene: Scene, data: mujoco.MjData) -> None:
    yaw = scene.fixture(goal.fixture).yaw
    across = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    for number, name in enumerate(goal.objects):
        beside = data.body(scene.fill(goal.of)).xpos + across * (goal.apart + 0.1 + 0.01 * number)
        data.joint(f"{scene.fill(name)}_joint0").qpos[:3] = beside


@write.register
def _near_fixture(goal: NearFixture, scene: Scene, data: mujoco.MjData) -> None:
    """To the right of the fixture, at its front, in the middle of its height, or at the upper corner there."""
    fixture, name = scene.fixture(goal.fixture), scene.fill(goal.object)
    turn = np.array([[np.cos(fixture.yaw), -np.sin(fixture.yaw)], [np.sin(fixture.yaw), np.cos(fixture.yaw)]])
    size = scene.objects[name].item.size
    aside = 0.0 if goal.to_corner else float(np.linalg.norm(size[:2])) / 2
    out = turn @ np.array([fixture.width / 2 + aside + 0.5 * goal.within, -fixture.depth / 2])
    high = fixture.height / 2 if goal.to_corner else 0.0
    data.joint(f"{name}_joint0").qpos[:3] = np.asarray(fixture.pos) + np.array([*out, high])


@write.register
def _beside(goal: Beside, scene: Scene, data: mujoco.MjData) -> None:
    fixture = scene.fixture(goal.fixture)
    right = np.array([np.cos(fixture.yaw), np.sin(fixture.yaw), 0.0])
    to_left = (scene.fill(goal.side) == "left") != (scene.layout.types[fixture.name] == "stool")
    aside = (-0.9 if to_left else 0.9) * min(goal.across, 0.3) * right
    data.joint(f"{scene.fill(goal.object)}_joint0").qpos[:3] = data.body(scene.fill(goal.other)).xpos + aside


@write.register
def _before_stools(goal: BeforeStools, scene: Scene, data: mujoco.MjData) -> None:
    for name, stool in zip(goal.objects, scene.layout.of_type("stool"), strict=False):
        ahead = np.array([-np.sin(stool.yaw), np.cos(stool.yaw)]) * 0.5 * goal.along
        data.joint(f"{scene.fill(name)}_joint0").qpos[:2] = np.asarray(stool.pos)[:2] - ahead


@write.register
def _handle(goal: HandlePoints, scene: Scene, data: mujoco.MjData) -> None:
    name = scene.fill(goal.object)
    along = handle_direction(scene, name)
    side = {"right": 0.0, "back": 0.5, "left": 1.0, "front": -0.5}[goal.to] * np.pi
    yaw = scene.fixture(goal.fixture).yaw + side + 0.9 * goal.within - np.arctan2(along[1], along[0])
    data.joint(f"{name}_joint0").qpos[3:] = [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]


@write.register
def _behind(goal: Behind, scene: Scene, data: mujoco.MjData) -> None:
    yaw = scene.fixture(goal.fixture).yaw
    back = (1.1 * goal.by + 0.01) * np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    data.joint(f"{scene.fill(goal.object)}_joint0").qpos[:3] = data.body(scene.fill(goal.other)).xpos + back


@write.register
def _higher(goal: Higher, scene: Scene, data: mujoco.MjData) -> None:
    name, other = scene.fill(goal.object), scene.fill(goal.other)
    high = scene.objects[other].item.size[2] / 2 + 0.01
    data.joint(f"{name}_joint0").qpos[:3] = data.joint(f"{other}_joint0").qpos[:3] + np.array([0.0, 0.0, high])


@write.register
def _over_basin(goal: OverBasin, scene: Scene, data: mujoco.MjData) -> None:
    region = scene.fixture(goal.fixture, Sink).regions[scene.fill(goal.basin)]
    data.joint(f"{scene.fill(goal.object)}_joint0").qpos[:3] = region.world(data, (0.0, 0.0, 0.0))


@write.register
def _rests_on(goal: RestsOn, scene: Scene, data: mujoco.MjData) -> None:
    """A hair into it, so that they touch."""
    name, other = scene.fill(goal.object), scene.fill(goal.other)
    lower, upper = scene.objects[other].item, scene.objects[name].item
    free, under = data.joint(f"{name}_joint0"), data.joint(f"{other}_joint0")
    high = lower.size[2] + lower.bottom_offset - upper.bottom_offset - 0.002
    free.qpos[:3] = under.qpos[:3] + np.array([0.0, 0.0, high])
    free.qpos[3:] = under.qpos[3:] = [1.0, 0.0, 0.0, 0.0]


@write.register
def _tilt(goal: ObjectTilt, scene: Scene, data: mujoco.MjData) -> None:
    angle = (goal.low + min(goal.high, np.pi)) / 2
    data.joint(f"{scene.fill(goal.object)}_joint0").qpos[3:] = [np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0]


@write.register(Grasped)
@write.register(GripperTouches)
def _grasped(goal: Grasped | GripperTouches, scene: Scene, data: mujoco.MjData) -> None:
    """A small object between the fingers, which open along the site's x, its narrower side towards them, pressed."""
    name, grip = scene.fill(goal.object), data.site(scene.robot.names.grip_site)
    size = scene.objects[name].item.size
    turn = np.eye(3) if size[0] <= size[1] else np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    free = data.joint(f"{name}_joint0")
    free.qpos[:3] = grip.xpos
    mujoco.mju_mat2Quat(free.qpos[3:], (grip.xmat.reshape(3, 3) @ turn).ravel())
    for joint in scene.robot.names.finger_joints:
        low, high = scene.model.joint(joint).range
        data.joint(joint).qpos[0] = np.clip(np.sign(low + high) * min(size[:2]) * 0.3, low, high)


@write.register
def _steps(goal: StepsWhile, scene: Scene, data: mujoco.MjData) -> None:
    scene.memory.write(data, goal.name, goal.n_steps)


@write.register
def _once(goal: Once, scene: Scene, data: mujoco.MjData) -> None:
    scene.memory.write(data, goal.name, 1.0)


@write.register
def _moved(goal: MovedSince, scene: Scene, data: mujoco.MjData) -> None:
    if goal.since == "step":
        scene.memory.write(data, goal.name, [*goal.begin(scene, data)[:-1], 1.0])
        return
    free = data.joint(f"{scene.fill(goal.object)}_joint0")
    if goal.by_m is not None:
        free.qpos[0] += 1.1 * goal.by_m
        return
    assert goal.by_rad is not None
    turn = np.array([np.cos(0.55 * goal.by_rad), 0.0, 0.0, np.sin(0.55 * goal.by_rad)])
    mujoco.mju_mulQuat(free.qpos[3:], turn, free.qpos[3:].copy())


@write.register
def _strokes(goal: Strokes, scene: Scene, data: mujoco.MjData) -> None:
    places = np.linspace(0.0, 1.1 * goal.span_m, goal.n_places)
    kept = [[place, 0.0] for place in places]
    scene.memory.write(data, goal.name, [goal.n_places, 0.0, 0.0, places[-1], 0.0, *np.ravel(kept)])
