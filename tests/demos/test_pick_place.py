"""Picking and placing: where an object is found to be, how it is grasped and put down there, and what is lost again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.demos.motion import Array, base_pose, floor_axes
from robocasa_lerobot.demos.planning.base_path import Room, wrap
from robocasa_lerobot.demos.planning.collision import CollisionChecker
from robocasa_lerobot.demos.skills.common import SkillError, stage_done
from robocasa_lerobot.demos.skills.pick_place.carrying.carry import OTHER_M, OTHER_RAD, in_reach, standing_pose_for
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import GraspStrategy, entry
from robocasa_lerobot.demos.skills.pick_place.graspable import contents_of, graspable, holder_of
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.strategies import grasp_strategy, in_the_open, place_strategy
from robocasa_lerobot.demos.skills.pick_place.verbs import pick_object, place_object
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.robot_poses import RobotPose
from robocasa_lerobot.envs.scene.spec import InsideOf, ObjectSpec, Placement
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.envs.tasks.typical import stages_of

CARRIED_M = 0.12  # from where it stood
REACH_M = 0.9  # on the floor, from the base's centre to a point that the arm is to reach
OBSTRUCTED = {"Microwave"}  # its open door stands where the robot would: `reach_in` drives around that
ENTRIES = ("up", "out", "across", "level", "along")


def moves_objects(name: str) -> bool:
    return any((stage.skill, stage.verb) == ("pick_place", "place") for stage in stages_of(get_task(name)))


# Scenes of composite tasks are many, and their places those of the atomic ones.
TASKS = [
    name if get_task(name).facts.kind == "atomic" else pytest.param(name, marks=pytest.mark.slow)
    for name in task_names()
    if moves_objects(name)
]


@pytest.fixture(scope="module", params=TASKS)
def env(request: pytest.FixtureRequest) -> Iterator[KitchenEnv]:
    """The kitchen of every task that moves objects, at reset."""
    kitchen = KitchenEnv(request.param, split="target", cameras=(), terminate_on_success=False)
    kitchen.reset(seed=0)
    yield kitchen
    kitchen.close()


def declared(env: KitchenEnv) -> Iterator[tuple[str, ObjectSpec]]:
    """Names of the scene's objects, with their declarations; those that several share, and containers, are left out."""
    for wanted in get_task(env.declaration.name).objects:
        if wanted.name in env.scene.objects:
            yield wanted.name, wanted


def handled(env: KitchenEnv) -> list[str]:
    """Names of the objects that the task's stages handle."""
    stages = env.declaration.stages
    names = [env.scene.fill(stage.object) for stage in stages if stage.skill == "pick_place" and stage.object]
    return [name for name in dict.fromkeys(names) if name in env.scene.objects]


def holders(env: KitchenEnv, name: str) -> Iterator[str]:
    """Objects that an object is declared to start in or on, the nearest first."""
    starts = {wanted.name: wanted.start for wanted in get_task(env.declaration.name).objects}
    start = starts.get(name)
    if isinstance(start, Placement) and start.object:
        holder = env.scene.fill(start.object)
        yield holder
        yield from holders(env, holder)
    elif f"{name}_container" in env.scene.objects:
        yield f"{name}_container"


def test_an_object_is_where_its_declaration_puts_it(env: KitchenEnv) -> None:
    starts = {name: wanted.start for name, wanted in declared(env)}
    for name, wanted in declared(env):
        on = list(holders(env, name))
        found = locate(env, name)
        assert found.holder == (on[0] if on else ""), name
        start = starts.get(on[-1], wanted.start) if on else wanted.start  # of what carries it in the end
        assert found.fixture is not None, name
        if isinstance(start, Placement | InsideOf):
            assert found.fixture.name == env.scene.roles[env.scene.fill(start.fixture)], name
            region = start.region.name if isinstance(start, Placement) else ""
            if region and region != "any" and not set("{:") & set(region):
                assert found.region.startswith(region), name
        else:
            assert isinstance(found.fixture, Counter), name
        assert (found.region == "") == isinstance(found.fixture, Counter), name


def test_contents_go_with_what_holds_them(env: KitchenEnv) -> None:
    for name in env.scene.objects:
        holder = holder_of(env, name)
        assert holder == next(holders(env, name), "")
        for other in env.scene.objects:
            assert (name in contents_of(env, other)) == (other in holders(env, name)), f"{name} in {other}"
        inside = graspable(env, name).contents
        bodies = {env.model.body(other).id for other in inside}
        assert bodies <= graspable(env, name).carried
        assert not graspable(env, name).carried & graspable(env, name).bodies


def test_every_place_has_a_grasp_strategy_and_every_target_a_place_strategy(env: KitchenEnv) -> None:
    free = GraspStrategy()  # no other one is the same object
    for stage in env.declaration.stages:
        if (stage.skill, stage.verb) != ("pick_place", "place"):
            continue
        obj = graspable(env, stage.object)
        grasp = grasp_strategy(env, obj, free)
        assert (grasp is free) == in_the_open(locate(env, obj.name))
        place = place_strategy(env, stage, obj)
        for entries in (grasp.entries, place.entries, place.grasp.entries):
            assert entries
            assert set(entries) <= set(ENTRIES)
        poses = place.poses()
        assert poses, stage
        assert np.isfinite([pose.point for pose in poses]).all()
        held_level = not obj.contents or max(place.leans) < np.deg2rad(31.0)
        assert held_level, "what an object holds would fall out"


def test_entries_lead_out_of_where_an_object_is(env: KitchenEnv) -> None:
    _, yaw = base_pose(env.data)
    for name in ("up", "out", "across", "level"):
        out = entry(env, name)
        assert np.linalg.norm(out) == pytest.approx(1.0)
        assert out[2] >= 0.0
        assert out @ floor_axes(yaw)[0] <= 1e-9


def stand_for(env: KitchenEnv, name: str, other_than: Sequence[RobotPose] = ()) -> RobotPose | None:
    """Where to stand for an object that a stage handles; None where nothing is free."""
    fixture = locate(env, name).fixture
    assert fixture is not None
    try:
        return standing_pose_for(env, fixture, env.data.body(name).xpos.copy(), other_than)
    except SkillError:
        return None


def test_a_standing_pose_is_free_and_near(env: KitchenEnv) -> None:
    for name in handled(env):
        x, y, _ = env.data.body(name).xpos
        first = stand_for(env, name)
        if type(locate(env, name).fixture).__name__ not in OBSTRUCTED:
            assert first is not None, name
        other = stand_for(env, name, [first]) if first is not None else None
        if first is not None and other is not None:
            apart = np.hypot(other.x - first.x, other.y - first.y)
            assert apart > OTHER_M or abs(wrap(other.yaw - first.yaw)) > OTHER_RAD
        for stand in filter(None, (first, other)):
            assert np.hypot(stand.x - x, stand.y - y) < REACH_M
            assert Room(env.scene).free(stand)
            at = np.array([[stand.x, stand.y, stand.yaw]])
            assert CollisionChecker(env.scene, env.data).free(at, np.array([PANDA_OMRON.home.arm])).all()


def reached(env: KitchenEnv, stand: RobotPose, point: Array) -> bool:
    """Whether a point is in reach of a robot that stands somewhere; then it is back where it was."""
    before = env.data.qpos.copy()
    PANDA_OMRON.place_base(env.model, env.data, stand.x, stand.y, stand.yaw)
    mujoco.mj_forward(env.model, env.data)
    found = in_reach(env, point)
    env.data.qpos[:] = before
    mujoco.mj_forward(env.model, env.data)
    return found


def test_what_a_robot_stands_before_is_in_reach_and_what_is_behind_it_is_not(env: KitchenEnv) -> None:
    for name in handled(env):
        point, stand = env.data.body(name).xpos.copy(), stand_for(env, name)
        if stand is None:
            continue
        assert reached(env, stand, point)
        assert not reached(env, RobotPose(stand.x, stand.y, stand.yaw + np.pi), point)
        ahead = floor_axes(stand.yaw)[0]
        assert not reached(env, stand, point + 3.0 * ahead)


def test_where_all_places_are_taken_there_is_none_to_stand() -> None:
    env = KitchenEnv("PickPlaceCounterToSink", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=0)
    point = env.data.body("obj").xpos.copy()
    fixture = locate(env, "obj").fixture
    assert fixture is not None
    around = np.arange(0.0, 2 * np.pi, np.pi / 8)
    spots = [point[:2] + d * np.array([np.cos(a), np.sin(a)]) for a in around for d in (0.5, 0.7, 0.9)]
    taken = [RobotPose(*spot, yaw) for spot in spots for yaw in np.arange(0.0, 2 * np.pi, OTHER_RAD)]
    with pytest.raises(SkillError, match="no room to stand"):
        standing_pose_for(env, fixture, point, taken)
    env.close()


def drop(env: KitchenEnv, name: str, qpos: Array) -> None:
    """Take an object out of the hand, to where it was."""
    joint = int(env.model.body(name).jntadr[0])
    address, dof = int(env.model.jnt_qposadr[joint]), int(env.model.jnt_dofadr[joint])
    env.data.qpos[address : address + 7] = qpos[address : address + 7]
    env.data.qvel[dof : dof + 6] = 0.0
    mujoco.mj_forward(env.model, env.data)


def test_what_is_lost_on_the_way_is_picked_up_again() -> None:
    """It is taken away as far from its place as a skill that picks alone never brings it."""
    env = KitchenEnv("PickPlaceCounterToSink", split="target", cameras=(), terminate_on_success=False)
    stage = Stage("pick_place", "place", "sink", object="obj")
    again = solved = 0
    for seed in range(3):
        env.reset(seed=seed)
        start, origin = env.data.qpos.copy(), env.data.body("obj").xpos.copy()
        times = 0  # that it was carried
        try:
            for action in place_object(env, stage):
                env.step(action)
                away = float(np.linalg.norm((env.data.body("obj").xpos - origin)[:2]))
                carried = is_held(env, "obj") and away > CARRIED_M
                if carried and not times:
                    drop(env, "obj", start)
                    times = 1
                elif carried:
                    times = 2
        except SkillError:
            continue
        again += times == 2
        solved += stage_done(env, stage)
    env.close()
    assert again >= 2
    assert solved >= 2


def test_what_is_picked_is_in_the_hand_and_off_its_place() -> None:
    env = KitchenEnv("PickPlaceCounterToSink", split="target", cameras=(), terminate_on_success=False)
    held = 0
    for seed in range(3):
        env.reset(seed=seed)
        height = float(env.data.body("obj").xpos[2])
        assert not is_held(env, "obj")
        try:
            for action in pick_object(env, Stage("pick_place", "pick", "counter", object="obj")):
                env.step(action)
        except SkillError:
            continue
        held += is_held(env, "obj") and env.data.body("obj").xpos[2] > height
    env.close()
    assert held >= 2
