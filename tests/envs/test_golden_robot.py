"""The robot's numbers as RoboCasa 1.0.1 has them: tree, joints, actuators, options, initial pose.

The numbers stand here as data, read and measured in robocasa 1.0.1 and robosuite; nothing is imported to compare with.
Known disagreements are tests of their own: `test_known_...`, with the reason.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, arena_spec

from robocasa_lerobot import contract
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import SETTLE_STEPS, Scene
from robocasa_lerobot.envs.tasks.registry import get_task

BODY_TABLE = Path(__file__).parent / "golden" / "panda_omron_bodies.json"
BODY_ROWS: list[list[Any]] = json.loads(BODY_TABLE.read_text())
SPAWN = np.array([10.0, 10.0, 0.0])

FORWARD, SIDE, YAW = (f"mobilebase0_joint_mobile_{name}" for name in ("forward", "side", "yaw"))
TORSO = "mobilebase0_joint_torso_height"
ARM = tuple(f"robot0_joint{i}" for i in range(1, 8))
FINGERS = ("gripper0_right_finger_joint1", "gripper0_right_finger_joint2")
SLIDE, HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


@pytest.fixture(scope="module")
def kitchen() -> Scene:
    return build_scene(get_task("OpenDrawer"), "target", 0)


# --- tree ----------------------------------------------------------------------------------------------------------


def _same_rotation(quat: np.ndarray, expected: list[float]) -> None:
    wanted = np.array(expected) / np.linalg.norm(expected)
    assert abs(np.dot(quat, wanted)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("row", BODY_ROWS, ids=[row[0] for row in BODY_ROWS])
def test_body(model: mujoco.MjModel, row: list[Any]) -> None:
    name, parent, pos, quat, mass, com, inertia_quat, inertia = row
    body = model.body(name)
    assert model.body(body.parentid[0]).name == parent
    np.testing.assert_array_equal(body.pos, np.array(pos) + (SPAWN if parent == "world" else 0.0))
    _same_rotation(body.quat, quat)
    assert body.mass[0] == mass
    np.testing.assert_array_equal(body.ipos, com)
    _same_rotation(body.iquat, inertia_quat)
    np.testing.assert_array_equal(body.inertia, inertia)


def test_the_table_names_every_body(model: mujoco.MjModel) -> None:
    assert {model.body(i).name for i in range(1, model.nbody)} == {row[0] for row in BODY_ROWS}


def test_the_table_is_the_recorded_one(shared: Path) -> None:
    lines = (shared / "facts" / "panda_omron_bodies.jsonl").read_text().splitlines()
    assert BODY_ROWS == [list(json.loads(line).values()) for line in lines]


# Body: parent, position in it (m), rotation wxyz to four digits. The column and the hand; the arm's own offsets below.
TREE = {
    "mobilebase0_base": ("robot0_base", (0, 0, 0), (1, 0, 0, 0)),
    "mobilebase0_fixed_support": ("mobilebase0_base", (-0.05, 0, 0.5), (1, 0, 0, 0)),
    "mobilebase0_support": ("mobilebase0_fixed_support", (0.05, 0, 0.2), (1, 0, 0, 0)),
    "mobilebase0_wheeled_base": ("mobilebase0_base", (-0.20, 0, 0.192), (1, 0, 0, 0)),
    "robot0_link0": ("mobilebase0_support", (0, 0, 0), (1, 0, 0, 0)),
    "robot0_right_hand": ("robot0_link7", (0, 0, 0.1065), (0.92378, 0, 0, -0.38291)),
    "gripper0_right_right_gripper": ("robot0_right_hand", (0, 0, 0), (0.7071, 0, 0, -0.7071)),
    "gripper0_right_eef": ("gripper0_right_right_gripper", (0, 0, 0.097), (1, 0, 0, 0)),
}


@pytest.mark.parametrize("name", TREE)
def test_tree(model: mujoco.MjModel, name: str) -> None:
    parent, pos, quat = TREE[name]
    body = model.body(name)
    assert model.body(body.parentid[0]).name == parent
    np.testing.assert_allclose(body.pos, pos, atol=1e-12)
    np.testing.assert_allclose(body.quat, quat, atol=1e-4)


def test_masses_of_the_column_and_offsets_of_the_arm(model: mujoco.MjModel) -> None:
    assert model.body("mobilebase0_fixed_support").mass[0] == pytest.approx(18.1, abs=0.05)
    assert model.body("mobilebase0_support").mass[0] == pytest.approx(15.9, abs=0.05)
    offsets = [tuple(model.body(f"robot0_link{i}").pos) for i in range(1, 8)]
    assert offsets == [
        (0, 0, 0.333),
        (0, 0, 0),
        (0, -0.316, 0),
        (0.0825, 0, 0),
        (-0.0825, 0.384, 0),
        (0, 0, 0),
        (0.088, 0, 0),
    ]


@pytest.mark.parametrize(
    ("site", "body"),
    [
        ("mobilebase0_center", "mobilebase0_support"),
        ("robot0_right_center", "robot0_link0"),
        ("gripper0_right_grip_site", "gripper0_right_eef"),
    ],
)
def test_sites_sit_at_the_origin_of_their_bodies(model: mujoco.MjModel, site: str, body: str) -> None:
    assert model.body(model.site(site).bodyid[0]).name == body
    np.testing.assert_array_equal(model.site(site).pos, [0, 0, 0])


def test_the_arm_is_mounted_070_above_the_base_with_its_axes(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model, yaw=0.6, steps=0)
    arena.data.joint(TORSO).qpos[0] = 0.1
    mujoco.mj_forward(model, arena.data)
    base, link0 = arena.data.body("mobilebase0_base"), arena.data.body("robot0_link0")
    np.testing.assert_allclose(link0.xpos - base.xpos, [0, 0, 0.70 + 0.1], atol=1e-12)
    np.testing.assert_allclose(link0.xmat, base.xmat, atol=1e-12)
    np.testing.assert_allclose(link0.xmat.reshape(3, 3)[:, 0], [np.cos(0.6), np.sin(0.6), 0], atol=1e-12)


# --- joints and actuators ------------------------------------------------------------------------------------------

# Joint: type, axis, range or None, friction loss, damping, armature, in the order of recorded states.
JOINTS = {
    FORWARD: (SLIDE, (1, 0, 0), None, 250.0, 0.0, 0.0),
    SIDE: (SLIDE, (0, 1, 0), None, 250.0, 0.0, 0.0),
    YAW: (HINGE, (0, 0, 1), None, 250.0, 0.0, 0.0),
    TORSO: (SLIDE, (0, 0, 1), (0.0, 0.34), 1000.0, 0.01, 0.0),
    "robot0_joint1": (HINGE, (0, 0, 1), (-2.8973, 2.8973), 0.1, 0.1, 5.0),
    "robot0_joint2": (HINGE, (0, 0, 1), (-1.7628, 1.7628), 0.1, 0.1, 2.5),
    "robot0_joint3": (HINGE, (0, 0, 1), (-2.8973, 2.8973), 0.1, 0.1, 1.667),
    "robot0_joint4": (HINGE, (0, 0, 1), (-3.0718, -0.0698), 0.1, 0.1, 1.25),
    "robot0_joint5": (HINGE, (0, 0, 1), (-2.8973, 2.8973), 0.1, 0.1, 1.0),
    "robot0_joint6": (HINGE, (0, 0, 1), (-0.0175, 3.7525), 0.1, 0.01, 0.833),
    "robot0_joint7": (HINGE, (0, 0, 1), (-2.8973, 2.8973), 0.1, 0.01, 0.714),
    FINGERS[0]: (SLIDE, (0, 1, 0), (0.0, 0.04), 1.0, 100.0, 1.0),
    FINGERS[1]: (SLIDE, (0, 1, 0), (-0.04, 0.0), 1.0, 100.0, 1.0),
}


def test_joint_order(model: mujoco.MjModel) -> None:
    assert [model.joint(i).name for i in range(model.njnt)] == list(JOINTS)


@pytest.mark.parametrize("name", JOINTS)
def test_joint(model: mujoco.MjModel, name: str) -> None:
    kind, axis, limits, frictionloss, damping, armature = JOINTS[name]
    joint = model.joint(name)
    assert joint.type[0] == kind
    np.testing.assert_array_equal(joint.axis, axis)
    assert bool(joint.limited[0]) == (limits is not None)
    if limits is not None:
        np.testing.assert_allclose(joint.range, limits, atol=1e-12)
    assert (joint.frictionloss[0], joint.damping[0]) == (frictionloss, damping)
    assert joint.armature[0] == pytest.approx(armature, abs=5e-4)  # the facts' three digits of 5/i
    np.testing.assert_array_equal(joint.pos, [-0.21, 0, 0] if name == YAW else [0, 0, 0])


# Joint: gain kind ("motor", "velocity" or "position"), its gain, control range, force range or None.
ACTUATORS = {
    **dict.fromkeys(ARM[:5], ("motor", 1.0, 80.0, None)),
    **dict.fromkeys(ARM[5:], ("motor", 1.0, 12.0, None)),
    FORWARD: ("velocity", 1000.0, 1.0, 600.0),
    SIDE: ("velocity", 1000.0, 1.0, 600.0),
    YAW: ("velocity", 1500.0, 1.5, 600.0),
    TORSO: ("motor", 1.0, 1.0e5, None),
    FINGERS[0]: ("position", 1000.0, (0.0, 0.04), 20.0),
    FINGERS[1]: ("position", 1000.0, (-0.04, 0.0), 20.0),
}


def test_each_joint_has_one_actuator(model: mujoco.MjModel) -> None:
    driven = [model.joint(model.actuator(i).trnid[0]).name for i in range(model.nu)]
    assert sorted(driven) == sorted(ACTUATORS)


@pytest.mark.parametrize("joint", ACTUATORS)
def test_actuator(model: mujoco.MjModel, joint: str) -> None:
    kind, gain, control, force = ACTUATORS[joint]
    (actuator,) = [model.actuator(i) for i in range(model.nu) if model.actuator(i).trnid[0] == model.joint(joint).id]
    assert actuator.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT
    np.testing.assert_array_equal(actuator.gear, [1, 0, 0, 0, 0, 0])
    assert actuator.gainprm[0] == gain
    bias = {"motor": (0, 0, 0), "velocity": (0, 0, -gain), "position": (0, -gain, 0)}[kind]
    np.testing.assert_array_equal(actuator.biasprm[:3], bias)
    assert actuator.ctrllimited[0]
    np.testing.assert_array_equal(actuator.ctrlrange, control if isinstance(control, tuple) else (-control, control))
    assert bool(actuator.forcelimited[0]) == (force is not None)
    if force is not None:
        np.testing.assert_array_equal(actuator.forcerange, (-force, force))


def test_shapes_with_numbers_of_their_own(model: mujoco.MjModel) -> None:
    for number in (1, 2):
        np.testing.assert_array_equal(
            model.geom(f"gripper0_right_finger{number}_pad_collision").friction, [2.0, 0.05, 0.0001]
        )
    body = model.body("mobilebase0_wheeled_base").id
    boxes = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_contype[g]]
    assert len(boxes) == 1
    assert model.geom_type[boxes[0]] == mujoco.mjtGeom.mjGEOM_BOX
    np.testing.assert_array_equal(model.geom_size[boxes[0]], [0.35, 0.25, 0.19])
    np.testing.assert_array_equal(model.geom_pos[boxes[0]], [0, 0, 0])


# --- options -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("where", ["room", "kitchen"])
def test_simulation_options(model: mujoco.MjModel, kitchen: Scene, where: str) -> None:
    compiled = model if where == "room" else kitchen.model
    option = compiled.opt
    assert option.timestep == 0.002
    assert option.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert option.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert (option.impratio, option.iterations) == (20.0, 100)
    assert (option.density, option.viscosity) == (1.2, 2e-5)
    assert not option.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD
    np.testing.assert_array_equal(option.gravity, [0, 0, -9.81])
    assert compiled.vis.map.znear == pytest.approx(0.001)


def test_timing() -> None:
    assert contract.CONTROL_HZ == 20
    assert contract.SUBSTEPS == 25
    assert contract.SUBSTEPS * 0.002 * contract.CONTROL_HZ == pytest.approx(1.0)
    assert SETTLE_STEPS == 10


def test_known_disagreement_what_rests_in_our_kitchens_sleeps(kitchen: Scene) -> None:
    """RoboCasa leaves MuJoCo's sleeping islands off; ours are on, for speed (architecture, section 4)."""
    assert kitchen.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP


# --- initial state -------------------------------------------------------------------------------------------------

ARM_HOME = (-0.01612974, -1.03446714, -0.02397936, -2.27550888, 0.03932365, 1.51639493, 0.69615947)


def test_initial_pose(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    PANDA_OMRON.set_home(model, data)
    assert tuple(float(data.joint(name).qpos[0]) for name in ARM) == ARM_HOME
    assert data.joint(TORSO).qpos[0] == 0.0
    assert [float(data.joint(name).qpos[0]) for name in FINGERS] == [0.020833, -0.020833]
    assert not data.qvel.any()


def test_initial_noise_is_gaussian_of_002_rad_on_the_arm_alone_and_unclipped(model: mujoco.MjModel) -> None:
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    drawn = np.empty((3000, model.nq))
    for row in drawn:
        PANDA_OMRON.set_home(model, data, rng)
        row[:] = data.qpos
    arm = [int(model.joint(name).qposadr[0]) for name in ARM]
    noise = drawn[:, arm] - ARM_HOME
    np.testing.assert_allclose(noise.std(axis=0), 0.02, rtol=0.05)
    np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=5 * 0.02 / np.sqrt(len(noise)))
    # Of 21,000 normal numbers some two are beyond four deviations, and 4.6 % beyond two.
    assert np.abs(noise).max() > 3.5 * 0.02
    assert (np.abs(noise) > 0.04).mean() == pytest.approx(0.0455, rel=0.1)
    np.testing.assert_allclose(np.corrcoef(noise.T), np.eye(7), atol=0.1)
    others = np.delete(drawn, arm, axis=1)
    np.testing.assert_array_equal(others, np.broadcast_to(others[0], others.shape))


def test_the_robot_is_modelled_at_10_10_and_its_slides_carry_the_rest(kitchen: Scene) -> None:
    data, _ = kitchen.initial_data(np.random.default_rng(0))
    np.testing.assert_array_equal(kitchen.model.body("robot0_base").pos, SPAWN)
    yaw, robot = float(data.joint(YAW).qpos[0]), kitchen.robot_pose
    assert yaw == pytest.approx(robot.yaw, abs=1e-3)
    # The hinge turns the base about a point 0.21 m behind its centre.
    pivot = np.array([robot.x, robot.y]) - 0.21 * np.array([np.cos(yaw), np.sin(yaw)])
    slides = [float(data.joint(name).qpos[0]) for name in (FORWARD, SIDE)]
    np.testing.assert_allclose(slides, pivot - (SPAWN[:2] - [0.21, 0.0]), atol=1e-3)
    assert max(slides) < 0.0
