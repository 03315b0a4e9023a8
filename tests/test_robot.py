"""The robot's model against the facts: tree, masses, joints, actuators, cameras, poses and observations."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, arena_spec

from robocasa_lerobot import contract
from robocasa_lerobot.envs.cameras import CAMERA_SETS
from robocasa_lerobot.envs.scene import robot_names as names
from robocasa_lerobot.envs.scene.robot import QUALITIES, add_robot, mesh_bytes, place_base, set_home
from robocasa_lerobot.envs.scene.robot_bodies import BODIES
from robocasa_lerobot.errors import UnknownNameError


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


def test_bodies_match_the_recorded_table(model: mujoco.MjModel, shared: Path) -> None:
    table = shared / "facts" / "panda_omron_bodies.jsonl"
    rows = [json.loads(line) for line in table.read_text().splitlines()]
    assert {row["body"] for row in rows} == {body.name for body in BODIES}
    spawn = np.array([10.0, 10.0, 0.0])
    for row in rows:
        body = model.body(row["body"])
        assert model.body(body.parentid[0]).name == row["parent"]
        np.testing.assert_allclose(body.pos, np.array(row["pos"]) + (spawn if row["parent"] == "world" else 0))
        _same_rotation(body.quat, row["quat_wxyz"])
        assert body.mass[0] == row["mass_kg"]
        np.testing.assert_array_equal(body.ipos, row["com"])
        _same_rotation(body.iquat, row["inertia_quat_wxyz"])
        np.testing.assert_array_equal(body.inertia, row["inertia_diag"])


def _same_rotation(quat: np.ndarray, expected: list[float]) -> None:
    wanted = np.array(expected) / np.linalg.norm(expected)
    assert abs(np.dot(quat, wanted)) == pytest.approx(1.0, abs=1e-12)


def test_joints_come_in_the_order_of_recorded_states(model: mujoco.MjModel) -> None:
    assert tuple(model.joint(i).name for i in range(model.njnt)) == names.JOINTS


@pytest.mark.parametrize("number", range(1, 8))
def test_arm_joint_passives(model: mujoco.MjModel, number: int) -> None:
    joint = model.joint(f"robot0_joint{number}")
    assert joint.armature[0] == pytest.approx(5.0 / number)
    assert joint.frictionloss[0] == 0.1
    assert joint.damping[0] == (0.1 if number <= 5 else 0.01)
    assert joint.limited[0]


def test_joint_ranges_are_radians_whatever_the_unit_of_the_spec() -> None:
    ranges = []
    for degree in (False, True):
        spec = mujoco.MjSpec()
        spec.compiler.degree = degree
        add_robot(spec, "fast")
        ranges.append(spec.compile().joint("robot0_joint4").range)
    np.testing.assert_allclose(ranges[0], [-3.0718, -0.0698])
    np.testing.assert_allclose(ranges[1], ranges[0])


def test_base_torso_and_finger_joints(model: mujoco.MjModel) -> None:
    for name, axis in zip(names.BASE_JOINTS, ((1, 0, 0), (0, 1, 0), (0, 0, 1)), strict=True):
        joint = model.joint(name)
        np.testing.assert_array_equal(joint.axis, axis)
        assert joint.frictionloss[0] == 250.0
        assert not joint.limited[0]
        assert joint.damping[0] == 0.0
    assert model.joint(names.BASE_JOINTS[2]).pos[0] == -0.21
    torso = model.joint(names.TORSO_JOINT)
    assert (torso.frictionloss[0], torso.damping[0], tuple(torso.range)) == (1000.0, 0.01, (0.0, 0.34))
    for name, limits in zip(names.FINGER_JOINTS, ((0.0, 0.04), (-0.04, 0.0)), strict=True):
        joint = model.joint(name)
        assert tuple(joint.range) == limits
        assert (joint.damping[0], joint.armature[0], joint.frictionloss[0]) == (100.0, 1.0, 1.0)


def test_actuator_limits_and_gains(model: mujoco.MjModel) -> None:
    for name, torque in zip(names.ARM_ACTUATORS, [80.0] * 5 + [12.0] * 2, strict=True):
        assert tuple(model.actuator(name).ctrlrange) == (-torque, torque)
    for name, kv, speed in zip(names.BASE_ACTUATORS, (1000, 1000, 1500), (1.0, 1.0, 1.5), strict=True):
        actuator = model.actuator(name)
        assert (actuator.gainprm[0], actuator.biasprm[2]) == (kv, -kv)
        assert tuple(actuator.ctrlrange) == (-speed, speed)
        assert tuple(actuator.forcerange) == (-600.0, 600.0)
    for name in names.FINGER_ACTUATORS:
        actuator = model.actuator(name)
        assert actuator.gainprm[0] == 1000.0
        assert tuple(actuator.forcerange) == (-20.0, 20.0)


def test_simulation_options(model: mujoco.MjModel) -> None:
    option = model.opt
    assert option.timestep == contract.PHYSICS_TIMESTEP_S
    assert option.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert (option.impratio, option.iterations) == (20.0, 100)
    assert (option.density, option.viscosity) == (1.2, 2e-5)
    assert not option.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD


@pytest.mark.parametrize("camera_set", CAMERA_SETS)
def test_every_camera_set_has_the_contract_cameras(camera_set: str) -> None:
    spec = mujoco.MjSpec()
    add_robot(spec, "fast", camera_set=camera_set)
    compiled = spec.compile()
    for camera in CAMERA_SETS[camera_set]:
        added = compiled.camera(camera.name)
        assert compiled.body(added.bodyid[0]).name == camera.parent
        np.testing.assert_array_equal(added.pos, camera.pos)
        _same_rotation(added.quat, list(camera.quat))
        if camera.focal_pixel is None:
            assert added.fovy[0] == camera.fovy
    assert set(contract.CAMERAS) <= {camera.name for camera in CAMERA_SETS[camera_set]}


def test_cameras_of_the_default_set(model: mujoco.MjModel) -> None:
    assert [model.camera(name).fovy[0] for name in contract.CAMERAS] == [60.0, 60.0, 75.0]


def test_the_look_changes_nothing_physical() -> None:
    fast, full = (arena_spec(quality).compile() for quality in QUALITIES)

    def colliding(model: mujoco.MjModel) -> list[tuple]:
        rows = []
        for i in range(model.ngeom):
            if model.geom_contype[i]:
                points = 0
                if model.geom_dataid[i] >= 0:
                    points = int(model.mesh_vertnum[model.geom_dataid[i]])
                pose = (*model.geom_pos[i].round(12), *model.geom_quat[i].round(12), *model.geom_size[i].round(12))
                rows.append((model.geom(i).name, points, pose, tuple(model.geom_friction[i])))
        return rows

    assert colliding(fast) == colliding(full)
    np.testing.assert_array_equal(fast.body_mass, full.body_mass)
    np.testing.assert_array_equal(fast.dof_M0, full.dof_M0)
    assert full.nmeshface > 10 * fast.nmeshface


def test_shapes_carry_no_mass_and_visual_ones_do_not_collide(model: mujoco.MjModel) -> None:
    assert model.body_mass.sum() == pytest.approx(sum(body.mass for body in BODIES))
    for i in range(model.ngeom):
        name = model.geom(i).name
        if name.endswith("_visual"):
            assert model.geom_group[i] == 1
            assert not model.geom_contype[i]
            assert not model.geom_conaffinity[i]
        elif name.endswith("_collision"):
            assert model.geom_group[i] == 0
            assert model.geom_contype[i]


def test_finger_pads_grip_hard_and_meet_when_closed(model: mujoco.MjModel) -> None:
    data = mujoco.MjData(model)
    set_home(model, data)
    for name in names.FINGER_JOINTS:
        data.joint(name).qpos[0] = 0.0
    mujoco.mj_forward(model, data)
    grip = data.site(names.GRIP_SITE).xpos
    pads = [data.geom(name).xpos for name in names.FINGER_PAD_GEOMS]
    for name in names.FINGER_PAD_GEOMS:
        np.testing.assert_array_equal(model.geom(name).friction, [2.0, 0.05, 0.0001])
    np.testing.assert_allclose((pads[0] + pads[1]) / 2, grip, atol=1e-6)
    assert np.linalg.norm(pads[0] - pads[1]) == pytest.approx(0.008, abs=1e-3)


def test_home_touches_nothing(model: mujoco.MjModel) -> None:
    assert Arena.settled(model, steps=0).data.ncon == 0


def test_noise_free_initial_observations(model: mujoco.MjModel) -> None:
    observations = Arena.settled(model, steps=0).observations()
    expected = {
        "robot0_base_pos": (0, 0, 0.70),
        "robot0_base_quat": (0, 0, 0, 1),
        "robot0_base_to_eef_pos": (0.2471, -0.00426, 0.59611),
        "robot0_base_to_eef_quat": (-0.98957, -0.0327, -0.13869, 0.02136),
        "robot0_base_to_eef_quat_site": (0.6766, 0.7229, 0.1132, 0.0830),
        "robot0_gripper_qpos": (0.020833, -0.020833),
    }
    for key, value in expected.items():
        np.testing.assert_allclose(observations[key], value, atol=1e-3, err_msg=key)
    # The facts give the world quaternion with the other sign: the same rotation, before the rule w >= 0.
    relative = np.array((0.98957, 0.0327, 0.13869, -0.02136))
    assert abs(observations["robot0_eef_quat"] @ relative) == pytest.approx(1.0, abs=1e-5)
    assert all(observations[key][3] >= 0 for key in observations if "quat" in key)


def test_observation_sizes(model: mujoco.MjModel) -> None:
    observations = Arena.settled(model, steps=0).observations()
    sizes = {key: value.size for key, value in observations.items()}
    assert sizes["robot0_joint_pos"] == sizes["robot0_joint_vel"] == sizes["robot0_joint_pos_cos"] == 7
    assert sizes["robot0_gripper_qpos"] == sizes["robot0_gripper_qvel"] == 2
    assert set(contract.STATE_PART_HDF5_KEYS.values()) <= set(sizes)
    assert all(value.dtype == np.float64 for value in observations.values())


def test_state_is_the_contract_vector_and_not_a_view(model: mujoco.MjModel) -> None:
    arena = Arena.settled(model, steps=0)
    state = arena.state()
    assert state.shape == (contract.STATE_SIZE,)
    parts, observations = contract.split_state(state), arena.observations()
    for part, key in contract.STATE_PART_HDF5_KEYS.items():
        np.testing.assert_array_equal(parts[part], observations[key])
    before = state.copy()
    arena.data.qpos[:] += 0.01
    mujoco.mj_forward(model, arena.data)
    np.testing.assert_array_equal(state, before)


@pytest.mark.parametrize(
    ("x", "y", "yaw"), [(0.0, 0.0, 0.0), (1.5, -2.0, 0.7), (-3.0, 0.4, -np.pi / 2), (2.0, 1.0, 3.0)]
)
def test_place_base(model: mujoco.MjModel, x: float, y: float, yaw: float) -> None:
    data = mujoco.MjData(model)
    set_home(model, data)
    place_base(model, data, x, y, yaw)
    mujoco.mj_forward(model, data)
    site = data.site(names.BASE_CENTER_SITE)
    np.testing.assert_allclose(site.xpos, [x, y, 0.7], atol=1e-12)
    forward = site.xmat.reshape(3, 3)[:, 0]
    np.testing.assert_allclose(forward, [np.cos(yaw), np.sin(yaw), 0.0], atol=1e-12)


def test_home_noise_is_seeded_and_on_the_arm_only(model: mujoco.MjModel) -> None:
    poses = []
    for seed in (0, 0, 1, None):
        data = mujoco.MjData(model)
        set_home(model, data, None if seed is None else np.random.default_rng(seed))
        poses.append(data.qpos.copy())
    np.testing.assert_array_equal(poses[0], poses[1])
    assert not np.array_equal(poses[0], poses[2])
    different = np.flatnonzero(poses[0] != poses[3])
    np.testing.assert_array_equal(different, np.arange(4, 11))
    assert np.abs(poses[0] - poses[3]).max() < 0.1


@pytest.mark.parametrize("quality", QUALITIES)
def test_written_xml_loads_with_portable_asset_names(quality: str) -> None:
    spec = arena_spec(quality)
    model = spec.compile()
    assets = mesh_bytes("fast") | (mesh_bytes("quality") if quality == "quality" else {})
    assert all(name.startswith("gymnasium_robotics/envs/assets/") for name in assets)
    # By MjSpec: a dictionary for `MjModel.from_xml_string` may not have the same file name in two folders.
    reloaded = mujoco.MjSpec.from_string(spec.to_xml(), assets=assets).compile()
    np.testing.assert_allclose(reloaded.body_mass, model.body_mass, rtol=1e-5)
    assert tuple(reloaded.joint(i).name for i in range(reloaded.njnt)) == names.JOINTS
    np.testing.assert_allclose(reloaded.jnt_range, model.jnt_range, rtol=1e-5)


def test_misspelt_names_get_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'quality'"):
        add_robot(mujoco.MjSpec(), "qualty")
    with pytest.raises(UnknownNameError, match="Did you mean 'cotraining'"):
        add_robot(mujoco.MjSpec(), "fast", camera_set="cotrain")


@pytest.mark.render
def test_cameras_see_workspace_and_fingers(model: mujoco.MjModel) -> None:
    """Every camera sees a block in front; the wrist camera sees the fingers."""
    spec = arena_spec()
    spec.worldbody.add_geom(
        name="block",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(0.05, 0.05, 0.05),
        pos=(0.6, 0.0, 0.9),
        contype=0,
        conaffinity=0,
    )
    arena = Arena.settled(spec.compile(), steps=0)
    fingers = {"gripper0_right_finger1_visual", "gripper0_right_finger2_visual"}
    wanted = {contract.CAMERAS[0]: {"block"}, contract.CAMERAS[1]: {"block"}, contract.CAMERAS[2]: {"block"} | fingers}
    option = mujoco.MjvOption()
    option.geomgroup[:] = (0, 1, 0, 0, 0, 0)
    option.geomgroup[0] = 1
    with mujoco.Renderer(arena.model, 96, 96) as renderer:
        renderer.enable_segmentation_rendering()
        for camera, seen in wanted.items():
            renderer.update_scene(arena.data, camera=camera, scene_option=option)
            ids = renderer.render()[:, :, 0]
            visible = {arena.model.geom(i).name for i in np.unique(ids) if i >= 0}
            assert seen <= visible, camera
