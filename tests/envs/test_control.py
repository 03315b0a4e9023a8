"""The controllers: directions, algebra and limits. RoboCasa's numbers are in the tests called `test_golden_...`."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, action, arena_spec

from robocasa_lerobot.contract import ContractError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.control_step import DivergedError
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.control import indices
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

TORSO = names.TORSO_JOINT
# RoboCasa's gains: stiffness per unit of mass, critically damped.
ARM_KP, NULLSPACE_KP = 150.0, 10.0
ARM_KD, NULLSPACE_KD = 2.0 * np.sqrt(ARM_KP), 2.0 * np.sqrt(NULLSPACE_KP)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


def _speed(arena: Arena, joint: str) -> float:
    return float(arena.data.joint(joint).qvel[0])


# --- base ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("yaw", [0.0, 0.9, -np.pi / 2, 2.5])
def test_forward_and_left_are_those_of_the_present_heading(model: mujoco.MjModel, yaw: float) -> None:
    for command, direction in (((1.0, 0, 0), yaw), ((0, 1.0, 0), yaw + np.pi / 2)):
        arena = Arena.settled(model, yaw=yaw, steps=1)
        before = arena.state()[:2]
        arena.run(action(1.0, base=command), 20)
        moved = arena.state()[:2] - before
        across = moved @ np.array((-np.sin(direction), np.cos(direction)))
        along = moved @ np.array((np.cos(direction), np.sin(direction)))
        assert along > 0.3
        # At a heading off the axes the friction of each slide takes its own share, so the course bends a little.
        assert abs(across) < 0.35 * along


# --- gripper -------------------------------------------------------------------------------------------------------


def test_gripper_holds_what_it_closes_on() -> None:
    spec = arena_spec()
    arena = Arena.settled(spec.compile(), steps=0)
    grip = arena.data.site(names.GRIP_SITE)
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, grip.xmat)
    # It floats until it is grasped.
    block = spec.worldbody.add_body(name="block", pos=grip.xpos.copy(), quat=quat, gravcomp=1.0)
    block.add_freejoint()
    block.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.015, 0.02, 0.015), mass=0.2)
    arena = Arena.settled(spec.compile(), steps=0)
    arena.run(action(gripper=1.0), 10)
    arena.model.body_gravcomp[:] = 0.0
    height = arena.data.body("block").xpos[2]
    arena.run(action(1.0, gripper=1.0, position=(0, 0, -0.5)), 10)
    arena.run(action(1.0, gripper=1.0), 10)
    offset = arena.data.body("block").xpos - arena.data.site(names.GRIP_SITE).xpos
    assert height - arena.data.body("block").xpos[2] == pytest.approx(0.25, abs=0.03)
    assert np.linalg.norm(offset) < 0.02
    touching = {arena.model.geom(g).name for contact in arena.data.contact for g in (contact.geom1, contact.geom2)}
    assert set(names.FINGER_PAD_GEOMS) <= touching


# --- arm -----------------------------------------------------------------------------------------------------------

DIRECTIONS = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]


@pytest.mark.parametrize(("axis", "sign"), DIRECTIONS)
def test_arm_translates_along_the_commanded_axis_of_the_base(model: mujoco.MjModel, axis: int, sign: float) -> None:
    arena = Arena.settled(model, yaw=0.8)
    start = arena.state()[7:10]
    command = np.zeros(3)
    command[axis] = 0.4 * sign
    arena.run(action(1.0, position=tuple(command)), 5)
    arena.run(action(1.0), 20)
    np.testing.assert_allclose(arena.state()[7:10] - start, 5 * 0.05 * command, atol=0.004)


@pytest.mark.parametrize(("axis", "sign"), DIRECTIONS)
def test_arm_rotates_about_the_commanded_axis_of_the_base(model: mujoco.MjModel, axis: int, sign: float) -> None:
    arena = Arena.settled(model, yaw=-0.5)
    start, before = arena.controller.goal_in_base()[1], arena.state()[7:10]
    command = np.zeros(3)
    command[axis] = 0.2 * sign
    arena.run(action(1.0, rotation=tuple(command)), 3)
    goal = arena.controller.goal_in_base()[1]
    arena.run(action(1.0), 25)
    angle = 3 * 0.5 * 0.2 * sign
    vector = np.array(_axial(goal @ start.T))
    np.testing.assert_allclose(vector, np.eye(3)[axis] * np.sin(angle), atol=1e-3)
    base, grip = arena.data.site(names.ARM_CENTER_SITE).xmat, arena.data.site(names.GRIP_SITE).xmat
    reached = base.reshape(3, 3).T @ grip.reshape(3, 3)
    assert np.linalg.norm(_axial(goal @ reached.T)) < np.radians(1.0)
    np.testing.assert_allclose(arena.state()[7:10], before, atol=0.01)


def _axial(matrix: np.ndarray) -> tuple[float, float, float]:
    return (
        0.5 * (matrix[2, 1] - matrix[1, 2]),
        0.5 * (matrix[0, 2] - matrix[2, 0]),
        0.5 * (matrix[1, 0] - matrix[0, 1]),
    )


def test_torques_agree_with_the_textbook_formula(model: mujoco.MjModel) -> None:
    """The controller's shortened algebra against explicit matrices, in a moving state off the goal."""
    arena = Arena.settled(model, yaw=0.3)
    arena.run(action(1.0, position=(0.8, -0.5, 0.3), rotation=(0.3, 0.4, -0.6), base=(0.7, 0.4, 0.5), torso=0.5), 3)
    data, controller = arena.data, arena.controller
    dofs = indices.joint_velocities(model, names.ARM_JOINTS)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    mass = full[np.ix_(dofs, dofs)]
    grip, base = model.site(names.GRIP_SITE).id, model.site(names.ARM_CENTER_SITE).id
    jacobians = {}
    for site in (grip, base):
        jacobians[site] = np.zeros((6, model.nv))
        mujoco.mj_jacSite(model, data, jacobians[site][:3], jacobians[site][3:], site)
    jacobian = jacobians[grip][:, dofs]
    velocity = (jacobians[base] - jacobians[grip]) @ data.qvel
    rotation = data.site_xmat[base].reshape(3, 3)
    goal_pos, goal_mat = controller.goal_in_base()
    present = data.site_xmat[grip].reshape(3, 3)
    error = 0.5 * np.cross(present.T, (rotation @ goal_mat).T).sum(axis=0)
    wanted = ARM_KD * velocity
    wanted[:3] += ARM_KP * (data.site_xpos[base] + rotation @ goal_pos - data.site_xpos[grip])
    wanted[3:] += ARM_KP * error
    inverse = np.linalg.inv(mass)
    force = np.linalg.inv(jacobian[:3] @ inverse @ jacobian[:3].T) @ wanted[:3]
    torque = np.linalg.inv(jacobian[3:] @ inverse @ jacobian[3:].T) @ wanted[3:]
    inertia = np.linalg.inv(jacobian @ inverse @ jacobian.T)
    nullspace = np.eye(7) - inverse @ jacobian.T @ inertia @ jacobian
    qpos, qvel = data.qpos[indices.joint_positions(model, names.ARM_JOINTS)], data.qvel[dofs]
    home = np.array([Arena.settled(model, steps=0).joint(name) for name in names.ARM_JOINTS])
    posture = mass @ (NULLSPACE_KP * (home - qpos) - NULLSPACE_KD * qvel)
    expected = jacobian.T @ np.concatenate((force, torque)) + nullspace.T @ posture + data.qfrc_bias[dofs]
    controller.apply()
    applied = data.ctrl[indices.actuators(model, names.ARM_ACTUATORS)]
    np.testing.assert_allclose(applied, expected, rtol=1e-8, atol=1e-8)


# --- actions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("index", "joints"),
    [(6, names.FINGER_JOINTS), (7, names.BASE_JOINTS[:1]), (8, names.BASE_JOINTS[1:2]), (9, names.BASE_JOINTS[2:])]
    + [(10, (TORSO,))]
    + [(i, names.ARM_JOINTS) for i in range(6)],
)
def test_each_action_component_drives_its_own_joints(
    model: mujoco.MjModel, index: int, joints: tuple[str, ...]
) -> None:
    command = action(1.0)
    command[index] = 1.0
    arena, idle = Arena.settled(model), Arena.settled(model)
    arena.run(command, 4)
    idle.run(action(1.0), 4)
    moved = {name: abs(arena.joint(name) - idle.joint(name)) for name in PANDA_OMRON.names.joints}
    driven = max(moved[name] for name in joints)
    groups = (names.ARM_JOINTS, names.FINGER_JOINTS, (TORSO,), *((name,) for name in names.BASE_JOINTS))
    for group in groups:
        if not set(group) & set(joints) and group is not names.ARM_JOINTS:  # the arm makes up for the base's jerk
            assert max(moved[name] for name in group) < 0.15 * driven
    assert driven > 0.003


def test_actions_beyond_one_are_clipped(model: mujoco.MjModel) -> None:
    states = []
    for size in (1.0, 50.0):
        arena = Arena.settled(model)
        arena.run(action(1.0, position=(size, 0, -size), base=(size, 0, 0), torso=size), 5)
        states.append(arena.state())
    np.testing.assert_array_equal(states[0], states[1])


def test_physics_that_is_lost_is_raised_and_leaves_no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    env = KitchenEnv("OpenDrawer", cameras=())
    env.reset(seed=0)
    env.data.qvel[:] = 1e12
    with pytest.raises(DivergedError):
        env.step(np.zeros(12, dtype=np.float32))
    env.close()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("bad", [np.zeros(11), np.zeros((1, 12)), np.full(12, np.nan), np.full(12, np.inf)])
def test_bad_actions_are_refused_and_change_nothing(model: mujoco.MjModel, bad: np.ndarray) -> None:
    arena = Arena.settled(model)
    before = arena.data.qpos.copy(), arena.data.time
    with pytest.raises(ContractError):
        arena.run(bad)
    np.testing.assert_array_equal(arena.data.qpos, before[0])
    assert arena.data.time == before[1]


def test_a_control_step_is_fifty_milliseconds_and_leaves_fresh_poses(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model, steps=0)
    arena.run(action(1.0, position=(1, 1, 1), base=(1, 0, 0)), 3)
    assert arena.data.time == pytest.approx(0.15)
    seen = arena.state()
    mujoco.mj_forward(model, arena.data)
    np.testing.assert_array_equal(arena.state(), seen)


def test_the_same_actions_give_the_same_bits(model: mujoco.MjModel) -> None:
    commands = np.random.default_rng(3).uniform(-1, 1, (15, 12))
    states = []
    for _ in range(2):
        arena = Arena.settled(model)
        for command in commands:
            arena.run(command)
        states.append(np.concatenate((arena.data.qpos, arena.data.qvel)))
    np.testing.assert_array_equal(*states)
