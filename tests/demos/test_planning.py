"""The planner: what it takes for touching is what MuJoCo does, it goes round obstacles, and it repeats itself."""

from __future__ import annotations

import copy
import gc
import itertools
import weakref
from collections.abc import Iterator
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import UP, Array, HandTarget, grip_position, hand_rotation, rotation_about
from robocasa_lerobot.demos.planning.articulated import ContactPath, Waypoint, plan_contact
from robocasa_lerobot.demos.planning.base_path import Space, base_now, find_path
from robocasa_lerobot.demos.planning.base_room import between
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held, MovingPart
from robocasa_lerobot.demos.planning.connect import connect
from robocasa_lerobot.demos.planning.errors import NoPlanError
from robocasa_lerobot.demos.planning.follow import CLOSELY, hand_poses
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.demos.planning.motion_planner import MotionPlanner, WaypointPath, plan_near
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import HAND, MOBILE_BASE
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.bodies import is_loose
from robocasa_lerobot.envs.scene.robot_poses import RobotPose


@pytest.fixture(scope="module")
def cabinet() -> Iterator[KitchenEnv]:
    env = KitchenEnv("PickPlaceCounterToCabinet", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=3)
    yield env
    env.close()


@pytest.fixture(scope="module")
def dishwasher() -> Iterator[KitchenEnv]:
    env = KitchenEnv("CloseDishwasher", split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=0)
    yield env
    env.close()


def contacts(env: KitchenEnv, data: mujoco.MjData, mine: NDArray[np.bool_]) -> set[int]:
    """Bodies that `mine` enter, and of the robot's own base those that its hand enters, by MuJoCo's contacts."""
    model, scene = env.model, env.scene
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    hand = scene.subtree(HAND) | (mine & ~scene.subtree(MOBILE_BASE))
    base = scene.subtree(MOBILE_BASE) & ~scene.subtree("robot0_link1")
    found = set()
    pairs = model.geom_bodyid[data.contact.geom][data.contact.dist < 0.0]
    for a, b in [*pairs.tolist(), *pairs[:, ::-1].tolist()]:
        if (mine[a] and not mine[b]) or (hand[a] and base[b]):
            found.add(b)
    return found


def random_configurations(checker: CollisionChecker, count: int) -> tuple[Array, Array]:
    rng = np.random.default_rng(5)
    low, high = checker.arm.ranges.T
    joints = np.clip(checker.present_joints + rng.normal(size=(count, 7)) * 0.7, low, high)
    return checker.present_base + rng.normal(size=(count, 3)) * [0.3, 0.3, 0.2], joints


@pytest.mark.parametrize("carries", [False, True])
def test_what_is_touched_is_what_mujoco_finds_in_contact(cabinet: KitchenEnv, carries: bool) -> None:
    model, data = cabinet.model, copy.copy(cabinet.data)
    name = next(iter(cabinet.scene.objects))
    held = Held(name, np.array([0.01, 0.0, 0.03]), rotation_about(np.array([0.0, 1.0, 0.0]), 0.4)) if carries else None
    checker = CollisionChecker(cabinet.scene, cabinet.data)
    bases, joints = random_configurations(checker, 150)
    found = checker.touched(bases, joints, held=held, most=60)
    mine = cabinet.scene.subtree(MOBILE_BASE) | (cabinet.scene.subtree(name) if carries else False)
    several = 0
    for base, angles, count, bodies in zip(bases, joints, found.counts, found.bodies, strict=True):
        data.qpos[:] = cabinet.data.qpos
        data.qpos[checker.arm.addresses] = angles
        PANDA_OMRON.place_base(model, data, *base.tolist())
        mujoco.mj_kinematics(model, data)
        if held is not None:
            hand, quat = hand_rotation(data), np.empty(4)
            mujoco.mju_mat2Quat(quat, np.ascontiguousarray(hand @ held.rotation).reshape(9))
            data.joint(f"{name}_joint0").qpos[:] = [*(grip_position(data) + hand @ held.position), *quat]
        expected = contacts(cabinet, data, mine)
        assert set(bodies[:count].tolist()) == expected
        several += len(expected) > 1
    assert several > 20  # else it proves little
    assert np.array_equal(checker.free(bases, joints, held=held), found.counts == 0)


def test_a_part_that_moves_is_where_its_joint_takes_it(dishwasher: KitchenEnv) -> None:
    model, data = dishwasher.model, copy.copy(dishwasher.data)
    joint = next(model.joint(i).name for i in range(model.njnt) if "dishwasher_door" in model.joint(i).name)
    low, high = model.joint(joint).range
    values = np.linspace(low, high, 4)
    part = MovingPart(model, dishwasher.data, joint, values)
    assert len(part.shapes.geoms)
    for state, value in enumerate(values):
        data.qpos[:] = dishwasher.data.qpos
        data.joint(joint).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        assert np.allclose(part.positions[state], data.geom_xpos[part.shapes.geoms], atol=1e-9)
        assert np.allclose(part.rotations[state].reshape(-1, 9), data.geom_xmat[part.shapes.geoms], atol=1e-9)


def test_allowed_bodies_and_margins_and_links(dishwasher: KitchenEnv) -> None:
    checker = CollisionChecker(dishwasher.scene, dishwasher.data)
    bases, joints = random_configurations(checker, 100)
    plain = checker.touched(bases, joints, most=12)
    assert plain.all()
    assert (checker.touched(bases, joints, most=12, margin_m=0.05).counts >= plain.counts).all()
    assert checker.touched(bases, joints, margin_m=0.05).counts.sum() > checker.touched(bases, joints).counts.sum()
    assert (checker.touched(bases, joints, most=12, links=(0,)).counts <= plain.counts).all()
    excused = CollisionChecker(dishwasher.scene, dishwasher.data, allowed=plain.all())
    assert not excused.touched(bases, joints, most=12).all()
    for body in plain.all():
        checker.allow_hand(body)
    pardoned = checker.touched(bases, joints, most=12, hand_may=np.ones(100, dtype=np.bool_))
    assert 0 < pardoned.counts.sum() < plain.counts.sum()
    assert np.array_equal(checker.touched(bases, joints, most=12).counts, plain.counts)


def test_what_the_arm_leans_on_is_no_obstacle_as_it_leaves_but_is_not_gone_through(cabinet: KitchenEnv) -> None:
    model, data = cabinet.model, copy.copy(cabinet.data)
    checker = CollisionChecker(cabinet.scene, cabinet.data)
    bases, joints = random_configurations(checker, 150)
    found = checker.touched(bases, joints, most=60)
    base = checker.touched(bases, joints, most=60, links=(0,))
    robot, passes = cabinet.scene.subtree(MOBILE_BASE), 0
    for row in np.flatnonzero((found.counts > 0) & (found.counts <= 2) & (base.counts == 0))[:12]:
        leant_on = frozenset(found.bodies[row, : found.counts[row]].tolist())
        if any(is_loose(model, body) for body in leant_on) or any(robot[body] for body in leant_on):
            continue
        data.qpos[:] = cabinet.data.qpos
        data.qpos[checker.arm.addresses] = joints[row]
        PANDA_OMRON.place_base(model, data, *bases[row].tolist())
        mujoco.mj_kinematics(model, data)
        leaning = CollisionChecker(cabinet.scene, data)
        assert leaning.touched(leaning.present_base, leaning.present_joints).all() == leant_on
        leaning.allow_present()
        assert not leaning.touched(leaning.present_base, leaning.present_joints).all()
        passes += bool(leaning.touched(bases, joints, most=60).all() & leant_on)
    assert passes > 2


LOW, HIGH = np.full(2, -2.0), np.full(2, 2.0)


def beside_a_wall(points: Array) -> NDArray[np.bool_]:
    """Free but for a wall across the straight line, open at one end."""
    return np.asarray(~((np.abs(points[:, 0]) < 0.1) & (points[:, 1] < 1.0)))


def test_a_path_goes_round_a_wall_and_is_a_function_of_its_generator() -> None:
    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    paths = [
        connect(start, goal, beside_a_wall, LOW, HIGH, np.random.default_rng(seed), iterations=500)
        for seed in (0, 0, 1)
    ]
    for path in paths:
        assert path is not None
        ends = np.vstack([start, path])
        assert np.array_equal(ends[-1], goal)
        assert len(path) > 1
        shares = np.linspace(0.0, 1.0, 50)[:, None]
        for one, other in itertools.pairwise(ends):
            points = one + shares * (other - one)
            assert not ((np.abs(points[:, 0]) < 0.04) & (points[:, 1] < 0.94)).any()  # lines are tested in steps
    assert paths[0] is not None
    assert paths[2] is not None
    assert np.array_equal(paths[0], paths[1])
    assert paths[0].shape != paths[2].shape or not np.allclose(paths[0], paths[2])


def test_a_search_for_a_path_ends() -> None:
    asked = 0

    def shut_in(points: Array) -> NDArray[np.bool_]:
        nonlocal asked
        asked += len(points)
        return np.asarray(np.abs(points[:, 0]) > 0.1)

    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    assert connect(start, goal, shut_in, LOW, HIGH, np.random.default_rng(0), iterations=20) is None
    assert asked < 20 * 200
    asked = 0
    assert connect(start, np.zeros(2), shut_in, LOW, HIGH, np.random.default_rng(0)) is None
    assert asked == 1  # a goal that is not free is not searched for
    free = connect(
        start, goal, lambda points: np.ones(len(points), dtype=np.bool_), LOW, HIGH, np.random.default_rng(0)
    )
    assert free is not None
    assert np.array_equal(free, goal[None])


def before_the_dishwasher(env: KitchenEnv) -> tuple[RobotPose, RobotPose]:
    """Poses to both sides of it, so near that a straight line between them leads through its open door."""
    fixture = env.scene.fixture("fxtr")
    ends = [fixture.to_world((side * 1.1, -fixture.depth / 2 - 0.6, 0.0)).tolist() for side in (-1, 1)]
    one, other = (RobotPose(x, y, fixture.yaw + np.pi / 2) for x, y, _ in ends)
    return one, other


def test_the_base_goes_round_an_open_door(dishwasher: KitchenEnv) -> None:
    env = dishwasher
    one, other = before_the_dishwasher(env)
    assert len(find_path(env.scene, None, one, other).poses) == 1  # straight, as with all doors shut
    path = find_path(env.scene, env.data, one, other).poses
    assert len(path) > 1
    checker = CollisionChecker(env.scene, env.data)
    for before, after in zip([one, *path[:-1]], path, strict=True):
        for pose in (*between(before, after, 0.05, 0.1), after):  # it turns on the way
            assert checker.free(np.array([pose.x, pose.y, pose.yaw]), checker.present_joints)[0]


def test_the_base_goes_round_more_with_something_long_in_the_hand(cabinet: KitchenEnv) -> None:
    """An object that reaches out below the counter's top meets what the robot alone does not."""
    env = cabinet
    name = next(iter(env.scene.objects))
    hand, goal = hand_rotation(env.data), base_now(env.data)
    ahead = np.array([np.cos(goal.yaw), np.sin(goal.yaw), 0.0])
    start = RobotPose(float(goal.x - 0.4 * ahead[0]), float(goal.y - 0.4 * ahead[1]), goal.yaw)
    held = Held(name, hand.T @ (0.3 * ahead - 0.25 * UP), hand.T)
    checker = CollisionChecker(env.scene, env.data)
    alone, loaded = (Space(env.scene, checker, start, goal, what, None, 0.0) for what in (None, held))
    assert alone.free(start)
    assert loaded.free(start)
    assert alone.free(goal)
    assert not loaded.free(goal)
    assert find_path(env.scene, env.data, start, goal).poses == [goal]
    path = find_path(env.scene, env.data, start, goal, held).poses
    assert path[-1] != goal
    assert loaded.free(path[-1])


def test_where_the_base_cannot_go_there_is_no_path(dishwasher: KitchenEnv) -> None:
    start = base_now(dishwasher.data)
    with pytest.raises(NoPlanError, match="no path for the base"):
        find_path(dishwasher.scene, dishwasher.data, start, RobotPose(start.x + 30.0, start.y, start.yaw))
    assert issubclass(NoPlanError, SkillError)


def test_angles_that_are_solved_for_give_the_pose_and_the_hand_is_led_there(cabinet: KitchenEnv) -> None:
    arm = Arm(cabinet.model, cabinet.data, cabinet.scene.robot)
    rng = np.random.default_rng(2)
    start = np.array(PANDA_OMRON.home.arm)
    goals = np.clip(start + rng.normal(size=(60, 7)) * 0.3, *arm.ranges.T)
    positions, rotations = arm.forward(goals)
    found = arm.solve(positions, rotations, np.tile(start, (60, 1)))
    solved = (found.position_error < 0.005) & (found.rotation_error < 0.05)
    assert solved.mean() > 0.8
    reached, _ = arm.forward(found.joints)
    assert np.allclose(np.linalg.norm(positions - reached, axis=1), found.position_error)
    goal = found.joints[solved][0]
    went = arm.along(start, *arm.forward(start + np.linspace(0.1, 1.0, 10)[:, None] * (goal - start)))
    end, _ = arm.forward(went[-1:])
    assert np.linalg.norm(end[0] - reached[solved][0]) < 0.01


def test_what_is_upright_at_both_ends_of_a_level_path_is_upright_between(cabinet: KitchenEnv) -> None:
    arm = Arm(cabinet.model, cabinet.data, cabinet.scene.robot)
    start = arm.home
    (position,), (turn,) = arm.forward(start[None])
    aside = position[None] + np.array([[0.1, -0.25, 0.1]])
    end = arm.solve(aside, (rotation_about(UP, -1.0) @ turn)[None], start[None]).joints[0]
    upright = turn.T @ UP  # of something in the hand
    tilts = []
    for level in (False, True):
        positions, turns = hand_poses(arm, start, end[None], CLOSELY, level=level)
        assert np.allclose(positions[-1], arm.forward(end[None])[0][0])
        assert np.allclose(turns[-1], arm.forward(end[None])[1][0])
        tilts.append(float(np.arccos(np.clip((turns @ upright)[:, 2], -1.0, 1.0)).max()))
    assert tilts[1] < 0.03
    assert tilts[1] < tilts[0]


def paths_down(env: KitchenEnv) -> list[WaypointPath]:
    """Down to the counter's object from above, the hand turned in several ways."""
    point = env.data.body(next(iter(env.scene.objects))).xpos
    down = np.diag([1.0, -1.0, -1.0])
    found = []
    for angle in np.linspace(0.0, np.pi, 6):
        turn = rotation_about(np.array([0.0, 0.0, 1.0]), float(angle)) @ down
        heights = (0.25, 0.15, 0.08)
        found.append(WaypointPath(tuple(HandTarget(point + up * UP, turn) for up in heights)))
    return found


def test_a_plan_is_the_same_twice_and_its_cost_is_the_least(cabinet: KitchenEnv) -> None:
    before = cabinet.data.qpos.copy()
    start = base_now(cabinet.data)
    bases = [None, RobotPose(start.x, start.y - 0.1, start.yaw)]
    plans = [MotionPlanner(cabinet, paths_down(cabinet), 2).best(bases) for _ in range(2)]
    assert plans[0]
    assert [plan.cost for plan in plans[0]] == sorted(plan.cost for plan in plans[0])
    for one, other in zip(*plans, strict=True):
        assert one.cost == other.cost
        assert one.base == other.base
        assert np.array_equal(one.joints, other.joints)
    assert np.array_equal(cabinet.data.qpos, before)
    alone = MotionPlanner(cabinet, [plans[0][0].path], 2).best([plans[0][0].base])
    assert alone[0].cost == pytest.approx(plans[0][0].cost)


def test_what_was_tried_is_not_tried_again(cabinet: KitchenEnv) -> None:
    rows = [path.targets for path in paths_down(cabinet)]
    first = plan_near(cabinet, rows, [(0.0, 0.0)])
    second = plan_near(cabinet, rows, [(0.0, 0.0)], tried=[first.targets[-1].rotation])
    assert np.trace(first.targets[-1].rotation.T @ second.targets[-1].rotation) < 2.5
    every = [row[-1].rotation for row in rows]
    assert plan_near(cabinet, rows, [(0.0, 0.0)], tried=every).cost == first.cost  # there are no others


def test_a_path_that_begins_where_the_hand_is_already_is_planned(cabinet: KitchenEnv) -> None:
    """There is no line to its first pose on which anything could be tested."""
    data, model = cabinet.data, cabinet.model
    joint = next(name for i in range(model.njnt) if (name := model.joint(i).name).endswith("door_joint"))
    here = HandTarget(grip_position(data), hand_rotation(data))
    there = HandTarget(here.position - 0.05 * here.rotation[:, 2], here.rotation)
    path = ContactPath((Waypoint(0.0, here), Waypoint(0.0, there, 1.0)), 1, lambda _: here)
    part = SimpleNamespace(
        name=joint, body=int(model.joint(joint).bodyid[0]), angle=0.0, joint_value=lambda angle: float(angle)
    )
    plan = plan_contact(cabinet, part, [path], [((0.0, 0.0), (0.0, 0.0))])
    assert plan.path is path
    present = data.qpos[Arm(model, data, cabinet.scene.robot).addresses]
    assert np.abs(plan.joints[-1] - present).max() < 0.05


def test_nothing_keeps_a_scene_alive_after_its_demonstration() -> None:
    """Thousands of demonstrations are recorded by one process, each in a kitchen of some megabytes."""
    env = KitchenEnv("NavigateKitchen", cameras=(), terminate_on_success=False)
    recording = record_episode(env, 3)
    assert len(recording.actions)
    models = weakref.WeakSet([env.model])
    env.close()
    del env
    gc.collect()
    assert len(models) == 0
