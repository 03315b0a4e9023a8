"""What every camera of every set shows in both presets: pictures, depth and segmentation agree with the scene."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import partial

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.surroundings import SURROUNDINGS
from robocasa_lerobot.envs.pictures import BACKGROUND
from robocasa_lerobot.envs.projection import back_project, camera_matrix, project
from robocasa_lerobot.envs.rendering import canvas
from robocasa_lerobot.envs.robots.camera_noise import CameraNoise
from robocasa_lerobot.envs.robots.cameras import apply_camera_configs, camera_configs
from robocasa_lerobot.envs.robots.panda_omron.bodies import BODIES
from robocasa_lerobot.envs.robots.panda_omron.cameras import CAMERA_SETS
from robocasa_lerobot.envs.scene.build import RENDER_PRESETS

pytestmark = pytest.mark.render

SIZE = 64
CAMERAS = tuple(camera.name for camera in CAMERA_SETS["default"])
LEFT, RIGHT, WRIST = contract.CAMERAS
LOOKS = [(camera_set, preset) for camera_set in CAMERA_SETS for preset in RENDER_PRESETS]


class Shown:
    """An env after a reset with seed 3, and what it showed."""

    def __init__(self, camera_set: str, preset: str) -> None:
        self.env = KitchenEnv(
            "PickPlaceCounterToSink",
            render_preset=preset,
            image_size=SIZE,
            cameras=CAMERAS,
            camera_set=camera_set,
            depth=True,
            segmentation=True,
        )
        self.observation, _ = self.env.reset(seed=4)
        self.owners = np.array(self.env.segmentation_names)

    def owner(self, camera: str) -> np.ndarray:
        return self.owners[self.observation["segmentation"][camera][..., 0]]

    def points(self, camera: str) -> np.ndarray:
        matrices = camera_matrix(self.env.model, self.env.data, camera, SIZE)
        return back_project(self.observation["depth"][camera], *matrices)


@pytest.fixture(scope="module", params=LOOKS, ids=[f"{s}-{p}" for s, p in LOOKS])
def shown(request: pytest.FixtureRequest) -> Iterator[Shown]:
    shown = Shown(*request.param)
    yield shown
    shown.env.close()


def test_observations_are_exactly_what_the_spaces_say(shown: Shown) -> None:
    space = shown.env.observation_space
    assert list(shown.observation) == ["pixels", "depth", "segmentation", "agent_pos"]
    assert shown.observation in space
    for key, shape, dtype in (
        ("pixels", (SIZE, SIZE, 3), np.uint8),
        ("depth", (SIZE, SIZE, 1), np.float32),
        ("segmentation", (SIZE, SIZE, 1), np.int32),
    ):
        assert list(shown.observation[key]) == list(CAMERAS)
        for camera in CAMERAS:
            array = shown.observation[key][camera]
            assert (array.shape, array.dtype) == (shape, dtype) == (space[key][camera].shape, space[key][camera].dtype)
            assert array.flags.c_contiguous


def test_no_picture_is_blank_and_no_two_are_alike(shown: Shown) -> None:
    pictures = [shown.observation["pixels"][camera].astype(float) for camera in CAMERAS]
    for index, picture in enumerate(pictures):
        assert picture.std() > 15
        for other in pictures[:index]:
            assert np.abs(picture - other).mean() > 10


def test_pictures_are_upright(shown: Shown) -> None:
    """Scene cameras: what is further up in the picture is higher in the room. Hand: the fingers are where they are."""
    for camera in CAMERAS:
        points, owners = shown.points(camera), shown.owner(camera)
        if camera == WRIST:
            fingers = np.isin(owners, ("gripper0_right_leftfinger", "gripper0_right_rightfinger"))
            assert fingers.sum() > 20
            assert np.argwhere(fingers)[:, 0].mean() > 0.6 * SIZE  # below
        else:
            assert points[: SIZE // 4, ..., 2].mean() > points[-SIZE // 4 :, ..., 2].mean() + 0.3
            arm = np.argwhere(np.char.startswith(owners, "robot0_link"))
            wall = np.char.startswith(owners, "wall") | np.char.startswith(owners, "splash")
            assert np.argwhere(wall)[:, 0].mean() < arm[:, 0].mean()


def test_left_and_right_cameras_are_not_exchanged(shown: Shown) -> None:
    """The left one stands to the left of the robot, so the arm is in the right half of its picture."""
    for camera, sign in ((LEFT, 1), (RIGHT, -1)):
        base = np.argwhere(np.char.startswith(shown.owner(camera), "robot0_link"))
        assert sign * (base[:, 1].mean() - (SIZE - 1) / 2) > 3


def test_depth_and_ids_are_what_rays_hit(shown: Shown) -> None:
    """Rays through the middles of pixels, cast by MuJoCo's collision code, against the rasterizer."""
    model, data = shown.env.model, shown.env.data
    groups = np.array([0, 1, 1, 0, 0, 0], dtype=np.uint8)  # what cameras draw
    for camera in CAMERAS:
        depth = shown.observation["depth"][camera][..., 0]
        assert np.isfinite(depth).all()
        assert 0.0 < depth.min()
        assert depth.max() <= model.vis.map.zfar * model.stat.extent * (1 + 1e-6)
        intrinsics, pose = camera_matrix(model, data, camera, SIZE)
        rays = back_project(np.ones((SIZE, SIZE), np.float32), intrinsics, pose) - pose[:3, 3]
        rays, places = rays.reshape(-1, 3)[::7], np.arange(SIZE * SIZE)[::7]
        hit, distance, found = np.full(len(rays), -1, np.int32), np.zeros(len(rays)), np.full((1, 1), -1, np.int32)
        for i, ray in enumerate(rays):  # not `mj_multiRay`: it misses meshes close to the camera (MuJoCo 3.17)
            distance[i] = mujoco.mj_ray(model, data, pose[:3, 3].copy(), ray, groups, True, -1, found)
            hit[i] = found[0, 0]
        seen = shown.observation["segmentation"][camera][..., 0].ravel()[places]
        assert (hit >= 0).mean() > 0.9
        # A few pixels on edges, and round shapes that are drawn with facets, differ.
        assert (seen == hit).mean() > 0.98
        same = (seen == hit) & (hit >= 0)
        error = np.abs(depth.ravel()[places] - distance)[same]  # rays of length 1 along the optical axis
        assert np.median(error) < 1e-4
        assert np.quantile(error, 0.95) < 0.004


def test_segmentation_finds_the_object_where_it_projects(shown: Shown) -> None:
    found = 0
    for camera in CAMERAS:
        mask = shown.owner(camera) == "obj"
        pixels, depth = project(
            shown.env.data.body("obj").xpos, *camera_matrix(shown.env.model, shown.env.data, camera, SIZE)
        )
        column, row = np.round(pixels).astype(int)
        if depth > 0 and 1 <= row < SIZE - 1 and 1 <= column < SIZE - 1 and mask[row, column]:
            found += 1
            assert np.abs(np.argwhere(mask).mean(axis=0) - pixels[::-1]).max() < 1.5
            surface = shown.points(camera)[row, column] - shown.env.data.body("obj").xpos
            assert np.linalg.norm(surface) < 0.08
    assert found >= 2


def test_names_of_ids(shown: Shown) -> None:
    names = shown.env.segmentation_names
    assert len(names) == shown.env.model.ngeom + 1
    assert names[-1] == BACKGROUND
    loose = {f"{name}_lid" for name in shown.env.scene.fixtures}  # parts that can be taken off
    known = {*shown.env.scene.fixtures, *loose, *shown.env.scene.objects, *(body.name for body in BODIES)}
    known.add(SURROUNDINGS)
    assert set(names[:-1]) <= known
    for name in ("obj", "sink", "floor", "robot0_link0"):
        assert any(name in shown.owner(camera) for camera in CAMERAS), name


def test_culling_changes_no_bit(shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the initial pose and with the arm elsewhere."""
    env, model = shown.env, shown.env.model
    renderer = env._open_renderer()

    def draw(camera: str) -> list[np.ndarray]:
        shadows = env.render_preset == "quality"  # from out of view, so nothing is left out
        return [*renderer.geometry(env.data, camera), *([] if shadows else [renderer.render(env.data, camera)])]

    home = env.data.qpos.copy()
    left_out = []
    for shift in (0.0, 0.8, -0.6):
        for joint in ("robot0_joint1", "robot0_joint4", "robot0_joint6"):
            address = model.joint(joint).qposadr[0]
            env.data.qpos[address] = home[address] + shift
        mujoco.mj_forward(model, env.data)
        for camera in CAMERAS:
            left_out.append(int((~canvas.in_view(model, env.data, model.camera(camera).id, 1.0)).sum()))
            culled = draw(camera)
            with monkeypatch.context() as patch:
                patch.setattr(canvas, "in_view", lambda drawn, *_: np.ones(drawn.ngeom, dtype=bool))
                whole = draw(camera)
            for a, b in zip(culled, whole, strict=True):
                np.testing.assert_array_equal(a, b)
    env.data.qpos[:] = home
    mujoco.mj_forward(model, env.data)
    assert min(left_out) > 20  # every camera, the wrist's lens too, leaves something out


def test_replayed_cameras_give_the_same_pictures() -> None:
    kwargs = {"image_size": 32, "cameras": CAMERAS}
    noisy = KitchenEnv("OpenDrawer", camera_noise=True, **kwargs)
    observation, _ = noisy.reset(seed=8)
    configs = noisy.scene.ep_meta()["cam_configs"]
    noisy.close()
    plain = KitchenEnv("OpenDrawer", **kwargs)
    before, _ = plain.reset(seed=8)
    np.testing.assert_array_equal(before["agent_pos"], observation["agent_pos"])
    apply_camera_configs(plain.model, configs)
    mujoco.mj_forward(plain.model, plain.data)
    for camera in CAMERAS:
        same = np.array_equal(before["pixels"][camera], observation["pixels"][camera])
        assert same == (camera == "robot0_frontview")
        np.testing.assert_array_equal(plain.render_camera(camera), observation["pixels"][camera])
    plain.close()


@pytest.mark.parametrize(("ours", "theirs"), [("default", "cotraining"), ("cotraining", "default")])
def test_cameras_of_another_set_apply_after_a_picture_was_drawn(ours: str, theirs: str) -> None:
    """Lenses too, which one of the sets has."""
    kwargs = {"image_size": 32, "cameras": (WRIST,)}
    other = KitchenEnv("OpenDrawer", camera_set=theirs, **kwargs)
    expected = other.reset(seed=8)[0]["pixels"][WRIST]
    configs = camera_configs(other.model, (WRIST,))
    other.close()
    env = KitchenEnv("OpenDrawer", camera_set=ours, **kwargs)
    before = env.reset(seed=8)[0]["pixels"][WRIST]
    assert not np.array_equal(before, expected)
    apply_camera_configs(env.model, configs)
    mujoco.mj_forward(env.model, env.data)
    np.testing.assert_array_equal(env.render_camera(WRIST), expected)
    env.close()


def test_more_noise_moves_pictures_more() -> None:
    pictures = []
    for noise in (False, CameraNoise(0.001, 0.05, 0.0, 0.0), True):
        env = KitchenEnv("OpenDrawer", image_size=32, cameras=(LEFT,), camera_noise=noise)
        pictures.append(env.reset(seed=1)[0]["pixels"][LEFT].astype(float))
        env.close()
    assert 0 < np.abs(pictures[1] - pictures[0]).mean() < np.abs(pictures[2] - pictures[0]).mean()


def test_depth_alone_and_no_cameras() -> None:
    env = KitchenEnv("OpenDrawer", image_size=16, cameras=(WRIST,), depth=True)
    observation, _ = env.reset(seed=0)
    assert list(observation) == ["pixels", "depth", "agent_pos"]
    assert set(observation) == set(env.observation_space)
    env.render_observations = False
    later, *_ = env.step(np.zeros(12, dtype=np.float32))
    np.testing.assert_array_equal(later["depth"][WRIST], observation["depth"][WRIST])  # the last ones are kept
    later["depth"][WRIST][:] = 0
    again, *_ = env.step(np.zeros(12, dtype=np.float32))
    np.testing.assert_array_equal(again["depth"][WRIST], observation["depth"][WRIST])
    env.close()
    env = KitchenEnv("OpenDrawer", image_size=16, cameras=(), segmentation=True)
    observation, _ = env.reset(seed=0)
    assert env._renderer is None
    assert observation in env.observation_space
    assert env.render().shape == (16, 16, 3)
    env.close()


@pytest.mark.costly
def test_gymnasium_checker_and_vector_env_carry_depth_and_segmentation() -> None:
    make = partial(
        KitchenEnv,
        "OpenDrawer",
        image_size=16,
        cameras=("robot0_agentview_center", WRIST),
        camera_set="cotraining",
        camera_noise=True,
        depth=True,
        segmentation=True,
    )
    single = make()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*(infinity|different render modes|spec).*")
        check_env(single, skip_render_check=True)
    expected, _ = single.reset(seed=4)
    single.close()
    vector = gymnasium.vector.AsyncVectorEnv([make], context="spawn")
    found, _ = vector.reset(seed=4)
    names = vector.call("segmentation_names")
    vector.close()
    for key in ("pixels", "depth", "segmentation"):
        for camera, array in expected[key].items():
            assert found[key][camera].dtype == array.dtype
            np.testing.assert_array_equal(found[key][camera][0], array)
    assert names[0][-1] == BACKGROUND
