"""The robot's model: shapes, cameras, looks, placing it. RoboCasa's numbers are in `test_golden_robot.py`."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, arena_spec

from robocasa_lerobot import contract
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import BODIES
from robocasa_lerobot.envs.robots.panda_omron.cameras import CAMERA_SETS
from robocasa_lerobot.envs.robots.panda_omron.model import QUALITIES, mesh_bytes
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.errors import UnknownNameError


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return arena_spec().compile()


def _same_rotation(quat: np.ndarray, expected: list[float]) -> None:
    wanted = np.array(expected) / np.linalg.norm(expected)
    assert abs(np.dot(quat, wanted)) == pytest.approx(1.0, abs=1e-12)


def test_joint_ranges_are_radians_whatever_the_unit_of_the_spec() -> None:
    ranges = []
    for degree in (False, True):
        spec = mujoco.MjSpec()
        spec.compiler.degree = degree
        PANDA_OMRON.add_to(spec, "fast")
        ranges.append(spec.compile().joint("robot0_joint4").range)
    np.testing.assert_allclose(ranges[0], [-3.0718, -0.0698])
    np.testing.assert_allclose(ranges[1], ranges[0])


@pytest.mark.parametrize("camera_set", CAMERA_SETS)
def test_every_camera_set_has_the_contract_cameras(camera_set: str) -> None:
    spec = mujoco.MjSpec()
    PANDA_OMRON.add_to(spec, "fast", camera_set)
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
    PANDA_OMRON.set_home(model, data)
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
    PANDA_OMRON.set_home(model, data)
    PANDA_OMRON.place_base(model, data, x, y, yaw)
    mujoco.mj_forward(model, data)
    site = data.site(names.BASE_CENTER_SITE)
    np.testing.assert_allclose(site.xpos, [x, y, 0.7], atol=1e-12)
    forward = site.xmat.reshape(3, 3)[:, 0]
    np.testing.assert_allclose(forward, [np.cos(yaw), np.sin(yaw), 0.0], atol=1e-12)


def test_home_noise_is_seeded_and_on_the_arm_only(model: mujoco.MjModel) -> None:
    poses = []
    for seed in (0, 0, 1, None):
        data = mujoco.MjData(model)
        PANDA_OMRON.set_home(model, data, None if seed is None else np.random.default_rng(seed))
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
    assert tuple(reloaded.joint(i).name for i in range(reloaded.njnt)) == PANDA_OMRON.names.joints
    np.testing.assert_allclose(reloaded.jnt_range, model.jnt_range, rtol=1e-5)


def test_misspelt_names_get_a_suggestion() -> None:
    with pytest.raises(UnknownNameError, match="Did you mean 'quality'"):
        PANDA_OMRON.add_to(mujoco.MjSpec(), "qualty")
    with pytest.raises(UnknownNameError, match="Did you mean 'cotraining'"):
        PANDA_OMRON.cameras("cotrain")


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
