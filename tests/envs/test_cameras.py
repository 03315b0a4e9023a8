"""The robot's cameras: their numbers, poses, noise and records, as RoboCasa has them."""

from __future__ import annotations

import copy
import json

import mujoco
import numpy as np
import pytest
from robot_arena import Arena, arena_spec

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.projection import back_project, camera_matrix, project, raw_depth
from robocasa_lerobot.envs.robots.camera_noise import CameraNoise, add_camera_noise
from robocasa_lerobot.envs.robots.cameras import add_cameras, apply_camera_configs, camera_configs, check_camera_names
from robocasa_lerobot.envs.robots.panda_omron.cameras import CAMERA_NOISE, CAMERA_SETS
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UnknownNameError, UserError

LEFT, RIGHT, WRIST = contract.CAMERAS
CENTER, FRONT = "robot0_agentview_center", "robot0_frontview"
SUPPORT, HAND = "mobilebase0_support", "robot0_right_hand"
LENS = "606 606 pixels of 640 480 on 5.5 3"
# Position, quaternion wxyz, body, vertical field of view: RoboCasa's numbers (docs/robocasa.md, section 3).
_SHARED = {
    CENTER: ((-0.6, 0, 1.15), (0.6369459, 0.33251855, -0.31992382, -0.61755961), SUPPORT, 60),
    FRONT: ((-0.5, 0, 0.95), (0.60889369, 0.38146779, -0.36739075, -0.59055454), SUPPORT, 60),
}
GOLDEN = {
    "default": {
        LEFT: ((-0.5, 0.35, 1.05), (0.55623853, 0.29935253, -0.37678665, -0.6775092), SUPPORT, 60),
        RIGHT: ((-0.5, -0.35, 1.05), (0.67750919, 0.37678668, -0.29935256, -0.55623859), SUPPORT, 60),
        WRIST: ((0.05, 0, 0), (0, 0.707107, 0.707107, 0), HAND, 75),
        **_SHARED,
    },
    "cotraining": {
        LEFT: ((-0.35, 0.4, 0.85), (90, -110, -28), SUPPORT, 65),
        RIGHT: ((-0.35, -0.35, 0.85), (90, -65, -28), SUPPORT, 65),
        WRIST: ((-0.029, 0, 0.05), (-0.116144, -0.6975031, 0.6975031, 0.1161439), HAND, LENS),
        **_SHARED,
    },
}
NUMBERS = [(camera_set, name) for camera_set, cameras in GOLDEN.items() for name in cameras]


def turned(x: float, y: float, x2: float) -> np.ndarray:
    """Quaternion of turns in degrees about x, then y, then x, each in the turned frame."""
    out = np.array([1.0, 0, 0, 0])
    for axis, angle in (((1, 0, 0), x), ((0, 1, 0), y), ((1, 0, 0), x2)):
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(axis, float), np.deg2rad(angle))
        mujoco.mju_mulQuat(out, out.copy(), turn)
    return out


def same_rotation(found: np.ndarray, expected: np.ndarray) -> None:
    expected = np.asarray(expected) / np.linalg.norm(expected)
    assert abs(float(found @ expected)) == pytest.approx(1.0, abs=1e-12)


@pytest.fixture(scope="module", params=CAMERA_SETS)
def kitchen(request: pytest.FixtureRequest) -> tuple[str, Scene]:
    return request.param, scene(request.param)


def scene(camera_set: str = "default", seed: int = 5, noise: CameraNoise | None = None) -> Scene:
    return build_scene(get_task("OpenDrawer"), "target", seed, "fast", camera_set, noise)


def test_all_sets_have_the_same_cameras_and_the_contracts() -> None:
    for name, cameras in CAMERA_SETS.items():
        assert [camera.name for camera in cameras] == list(GOLDEN[name])
        assert set(contract.CAMERAS) <= {camera.name for camera in cameras}
    assert set(CAMERA_NOISE) == set(CAMERA_SETS) == set(GOLDEN)


def test_every_number_of_the_facts(kitchen: tuple[str, Scene]) -> None:
    camera_set, built = kitchen
    model = built.model
    for name, (pos, quat, body, view) in GOLDEN[camera_set].items():
        camera = model.camera(name)
        np.testing.assert_allclose(camera.pos, pos, atol=1e-15)
        same_rotation(camera.quat, np.array(quat) if len(quat) == 4 else turned(*quat))
        assert model.body(int(camera.bodyid[0])).name == body
        assert model.cam_mode[camera.id] == mujoco.mjtCamLight.mjCAMLIGHT_FIXED
        if view != LENS:
            assert camera.fovy[0] == view
            assert not model.cam_sensorsize[camera.id].any()
        else:
            assert tuple(model.cam_resolution[camera.id]) == (640, 480)
            assert tuple(model.cam_sensorsize[camera.id]) == (5.5, 3.0)
            np.testing.assert_allclose(model.cam_intrinsic[camera.id], (606 * 5.5 / 640, 606 * 3 / 480, 0, 0))
            assert camera.fovy[0] == pytest.approx(np.rad2deg(2 * np.arctan(480 / 2 / 606)))  # 43.2


@pytest.mark.parametrize(("camera_set", "name"), NUMBERS)
def test_poses_in_the_world_follow_their_bodies(camera_set: str, name: str) -> None:
    """At the noise-free initial pose with the base at the origin, and with the torso raised by 0.2 m."""
    spec = mujoco.MjSpec()
    apply_simulation_options(spec)
    PANDA_OMRON.add_to(spec, "fast", camera_set)
    arena = Arena.settled(spec.compile(), steps=0)
    pos, _, body, _ = GOLDEN[camera_set][name]
    low = arena.data.camera(name).xpos.copy()
    if body == SUPPORT:
        np.testing.assert_allclose(low, np.add(pos, (0, 0, 0.70)), atol=1e-12)
    else:  # the initial hand looks down: its x axis is the base's, the other two are turned over
        hand = arena.data.body(HAND)
        np.testing.assert_allclose(low, hand.xpos + hand.xmat.reshape(3, 3) @ pos, atol=1e-12)
        assert arena.data.camera(name).xmat.reshape(3, 3)[2, 2] > 0.8  # cameras look along their -z
    forward = -arena.data.camera(name).xmat.reshape(3, 3)[:, 2]
    assert forward[2] < 0.0
    if body == SUPPORT:
        assert forward[0] > 0.5  # ahead of the robot
        assert {LEFT: -1, RIGHT: 1}.get(name, 0) == pytest.approx(np.sign(round(forward[1], 1)))
        assert arena.data.camera(name).xmat.reshape(3, 3)[2, 1] > 0.5  # pictures are upright
    arena.data.joint("mobilebase0_joint_torso_height").qpos[0] = 0.2
    mujoco.mj_forward(arena.model, arena.data)
    np.testing.assert_allclose(arena.data.camera(name).xpos - low, (0, 0, 0.2), atol=1e-12)


def test_noise_follows_from_the_seed_and_changes_nothing_else() -> None:
    plain, noisy, again = scene(), scene(noise=CAMERA_NOISE["default"]), scene(noise=CAMERA_NOISE["default"])
    other = scene(seed=6, noise=CAMERA_NOISE["default"])
    np.testing.assert_array_equal(noisy.model.cam_pos, again.model.cam_pos)
    np.testing.assert_array_equal(noisy.model.cam_quat, again.model.cam_quat)
    for name in GOLDEN["default"]:
        index = plain.model.camera(name).id
        moved = not np.array_equal(plain.model.cam_pos[index], noisy.model.cam_pos[index])
        turned_ = not np.array_equal(plain.model.cam_quat[index], noisy.model.cam_quat[index])
        assert (moved, turned_) == (name != FRONT, name != FRONT)
        if name != FRONT:
            assert not np.array_equal(noisy.model.cam_pos[index], other.model.cam_pos[index])
        assert noisy.model.cam_fovy[index] == plain.model.cam_fovy[index]
    without, with_noise = plain.ep_meta(), noisy.ep_meta()
    assert without.pop("cam_configs") != with_noise.pop("cam_configs")
    assert without == with_noise
    states = [s.initial_data(np.random.default_rng(0))[0] for s in (plain, noisy)]
    np.testing.assert_array_equal(states[0].qpos, states[1].qpos)
    np.testing.assert_array_equal(states[0].qvel, states[1].qvel)


@pytest.mark.parametrize("camera_set", CAMERA_SETS)
def test_noise_has_the_distribution_of_the_facts(camera_set: str) -> None:
    spec = mujoco.MjSpec()
    for body in (SUPPORT, HAND):
        spec.worldbody.add_body(name=body)
    add_cameras(spec, PANDA_OMRON.cameras(camera_set))
    rng = np.random.default_rng(1)
    shifts: dict[str, list[np.ndarray]] = {name: [] for name in GOLDEN[camera_set]}
    angles: dict[str, list[np.ndarray]] = {name: [] for name in GOLDEN[camera_set]}
    for _ in range(4000):
        add_camera_noise(spec, PANDA_OMRON.cameras(camera_set), CAMERA_NOISE[camera_set], rng)
        for camera in PANDA_OMRON.cameras(camera_set):
            found = spec.camera(camera.name)
            shifts[camera.name].append(found.pos - camera.pos)
            quat = np.array(camera.quat) / np.linalg.norm(camera.quat)
            difference, angle = np.empty(4), np.empty(3)
            mujoco.mju_mulQuat(difference, quat * (1, -1, -1, -1), found.quat)
            mujoco.mju_quat2Vel(angle, difference, 1.0)  # about the camera's own axes
            angles[camera.name].append(np.rad2deg(angle))
    position, degrees = (0.10, 6.0) if camera_set == "default" else (0.025, 0.75)
    for name in (LEFT, RIGHT, CENTER):
        shift, angle = np.array(shifts[name]), np.array(angles[name])
        np.testing.assert_allclose(shift.std(axis=0), position, rtol=0.05)
        np.testing.assert_allclose(shift.mean(axis=0), 0.0, atol=0.06 * position)
        np.testing.assert_allclose(angle.std(axis=0), degrees, rtol=0.05)
        assert np.abs(np.corrcoef(np.hstack([shift, angle]).T) - np.eye(6)).max() < 0.07
    shift, angle = np.array(shifts[WRIST]), np.array(angles[WRIST])
    np.testing.assert_allclose(angle.std(axis=0), 0.75, rtol=0.05)
    assert shift[:, 0].max() == pytest.approx(0.0, abs=1e-12)
    assert (shift[:, 0] > -1e-9).mean() == pytest.approx(0.100, abs=0.02)  # the share beyond 8 mm / 6.25 mm
    assert np.median(shift[:, 0]) == pytest.approx(-0.008, abs=4e-4)
    if camera_set == "default":  # never into the hand, whose front is 0.016 m away
        assert shift[:, 0].min() == pytest.approx(-0.016)
    else:
        assert shift[:, 0].std() == pytest.approx(0.0058, rel=0.05)
    assert shift[:, 1].std() == pytest.approx(0.00625, rel=0.05)
    assert shift[:, 2].max() == pytest.approx(0.00125)
    assert (shift[:, 2] > 0.00125 - 1e-9).mean() == pytest.approx(0.309, abs=0.03)  # the share beyond half a deviation
    assert np.quantile(shift[:, 2], 0.1587) == pytest.approx(-0.0025, abs=2e-4)  # one deviation down
    assert not np.any(shifts[FRONT])
    assert np.abs(angles[FRONT]).max() < 1e-9


@pytest.mark.parametrize("camera_set", CAMERA_SETS)
@pytest.mark.parametrize("noisy", [False, True])
def test_configs_apply_to_models_and_specs_bit_for_bit(camera_set: str, noisy: bool) -> None:
    recorded = scene(camera_set, noise=CAMERA_NOISE[camera_set] if noisy else None)
    configs = json.loads(json.dumps(recorded.ep_meta()["cam_configs"]))
    assert list(configs) == list(GOLDEN[camera_set])
    other = scene("cotraining" if camera_set == "default" else "default")
    apply_camera_configs(other.spec, configs)
    from_spec = other.spec.compile()
    model = scene("cotraining" if camera_set == "default" else "default").model
    apply_camera_configs(model, configs)
    for found in (from_spec, model):
        for field in ("cam_pos", "cam_quat", "cam_sensorsize", "cam_resolution", "cam_bodyid"):
            np.testing.assert_array_equal(getattr(found, field), getattr(recorded.model, field), field)
        has_lens = recorded.model.cam_sensorsize.any(axis=1)
        np.testing.assert_array_equal(found.cam_fovy[~has_lens], recorded.model.cam_fovy[~has_lens])
        # Of a lens it is only for information: MuJoCo computes it from lengths in single precision.
        np.testing.assert_allclose(found.cam_fovy, recorded.model.cam_fovy, rtol=1e-7)
        np.testing.assert_array_equal(found.cam_intrinsic[has_lens], recorded.model.cam_intrinsic[has_lens])
        assert camera_configs(found, GOLDEN["default"]) == camera_configs(recorded.model, GOLDEN["default"])


def test_configs_in_robocasas_own_words() -> None:
    model = arena_spec().compile()
    apply_camera_configs(
        model,
        {
            LEFT: {"pos": [0, 0, 1], "quat": [2, 0, 0, 0], "parent_body": SUPPORT, "camera_attribs": {"fovy": "65"}},
            RIGHT: {"pos": [0, 0, 1], "quat": [1, 0, 0, 0], "parent_body": SUPPORT},
            WRIST: {
                "pos": [0, 0, 0],
                "quat": [0, 1, 0, 0],
                "camera_attribs": {"focalpixel": "606 606", "resolution": "640 480", "sensorsize": "5.5 3"},
            },
        },
    )
    assert model.camera(LEFT).fovy[0] == 65.0
    assert tuple(model.camera(LEFT).quat) == (1, 0, 0, 0)
    assert model.camera(RIGHT).fovy[0] == 60.0
    golden = scene("cotraining").model
    np.testing.assert_array_equal(
        model.cam_intrinsic[model.camera(WRIST).id], golden.cam_intrinsic[golden.camera(WRIST).id]
    )
    assert model.camera(WRIST).fovy[0] == pytest.approx(golden.camera(WRIST).fovy[0], rel=1e-7)


_POSE = {"pos": [0, 0, 1], "quat": [1, 0, 0, 0]}


@pytest.mark.parametrize(
    ("name", "config", "error", "words"),
    [
        ("robot0_agentview_lft", _POSE, UnknownNameError, LEFT),
        (LEFT, _POSE | {"parent_body": HAND}, UserError, f"expected '{SUPPORT}'"),
        (LEFT, {"pos": [0, 0, 1]}, UserError, "expected 4 finite"),
        (LEFT, _POSE | {"pos": [0, 0, float("nan")]}, UserError, "expected 3 finite"),
        (LEFT, _POSE | {"pos": "here"}, UserError, "expected 3 finite"),
        (LEFT, _POSE | {"quat": [0, 0, 0, 0]}, UserError, "rotation"),
        (LEFT, _POSE | {"camera_attribs": {"fovi": "60"}}, UnknownNameError, "fovy"),
        (LEFT, _POSE | {"camera_attribs": {"fovy": "180"}}, UserError, "no camera"),
        (LEFT, _POSE | {"camera_attribs": {"sensorsize": "5 3"}}, UserError, "expected fovy, or"),
    ],
)
def test_wrong_configs_change_nothing(name: str, config: dict, error: type[Exception], words: str) -> None:
    model = arena_spec().compile()
    before = copy.deepcopy(camera_configs(model, GOLDEN["default"]))
    with pytest.raises(error, match=words):
        apply_camera_configs(model, {RIGHT: _POSE, name: config})
    assert camera_configs(model, GOLDEN["default"]) == before


@pytest.mark.parametrize(
    ("kwargs", "error", "words"),
    [
        ({"cameras": ["robot0_agentview_centre"]}, UnknownNameError, CENTER),
        ({"cameras": LEFT}, UserError, "list of names"),
        ({"cameras": [LEFT, LEFT]}, UserError, "each camera once"),
        ({"camera_set": "cotrain"}, UnknownNameError, "cotraining"),
        ({"camera_set": "cotrain", "camera_noise": True}, UnknownNameError, "cotraining"),
        ({"camera_noise": "yes"}, UserError, "True, False or a CameraNoise"),
    ],
)
def test_mistakes_are_found_when_the_env_is_made(kwargs: dict, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        KitchenEnv("OpenDrawer", **kwargs)


def test_noise_below_zero_is_none() -> None:
    with pytest.raises(UserError, match="wrist_angle_deg"):
        CameraNoise(wrist_angle_deg=-1.0)
    assert check_camera_names(list(GOLDEN["default"]), PANDA_OMRON.cameras("default")) == tuple(GOLDEN["default"])


def test_projection_of_known_points() -> None:
    """A camera 1 m above the floor that looks along world x, and the squeezed picture of a 4:3 sensor."""
    spec = mujoco.MjSpec()
    looks_along_x = {"pos": (0, 0, 1), "quat": (0.5, 0.5, -0.5, -0.5)}
    spec.worldbody.add_camera(name="fovy", fovy=90, **looks_along_x)
    lens = spec.worldbody.add_camera(name="lens", **looks_along_x)
    lens.focal_pixel, lens.resolution, lens.sensor_size = (320, 240), (640, 480), (4, 3)
    spec.worldbody.add_camera(name="flat", proj=mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ahead, corner = np.array([2.0, 0.0, 1.0]), np.array([2.0, 2.0, 3.0])  # straight ahead; upper left corner
    for camera, size in (("fovy", 100), ("lens", 100), ("lens", (50, 200))):
        intrinsics, pose = camera_matrix(model, data, camera, size)
        height, width = (size, size) if isinstance(size, int) else size
        pixels, depth = project(np.stack([ahead, corner]), intrinsics, pose)
        np.testing.assert_allclose(pixels, [[(width - 1) / 2, (height - 1) / 2], [-0.5, -0.5]], atol=1e-6)
        np.testing.assert_allclose(depth, 2.0)
        points = back_project(np.full((height, width, 1), 2.0, np.float32), intrinsics, pose)
        pixels, depth = project(points, intrinsics, pose)
        np.testing.assert_allclose(pixels, np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1), atol=1e-6)
    wide, _ = camera_matrix(model, data, "fovy", (50, 200))
    assert wide[0, 0] == pytest.approx(wide[1, 1]) == pytest.approx(25.0)
    with pytest.raises(UnknownNameError, match="lens"):
        camera_matrix(model, data, "lense", 10)
    with pytest.raises(UserError, match="orthographic"):
        camera_matrix(model, data, "flat", 10)


def test_raw_depth_is_opengls() -> None:
    model = scene().model
    near, far = model.vis.map.znear * model.stat.extent, model.vis.map.zfar * model.stat.extent
    metres = np.array([near, 0.5, 2.0, far], dtype=np.float32)
    raw = raw_depth(metres, model)
    assert raw.dtype == np.float32
    assert (raw[0], raw[-1]) == (pytest.approx(0.0, abs=1e-6), 1.0)
    np.testing.assert_allclose(near / (1 - raw[1:3].astype(float) * (1 - near / far)), metres[1:3], rtol=1e-3)
