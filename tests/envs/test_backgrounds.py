"""Pictures that are joined from kept backgrounds equal full drawings bit for bit."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import pytest
import task_selection
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.planning.errors import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer, backgrounds
from robocasa_lerobot.envs.rendering.depth_join import join_by_depth
from robocasa_lerobot.envs.rendering.view_grid import GRID_M, GRID_QUATERNION, on_grid

PIXELS = 64
# Behind glass, with water that begins to run, and with a burner that begins to glow.
FAST = ("CloseDrawer", "TurnOnSinkFaucet", "TurnOnStove")
SEED = 7


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of each picture that was joined whether that was certain; joining pays on every device."""
    found: list[bool] = []

    def noted(*arrays: Any) -> tuple[NDArray[np.uint8], bool]:
        picture, certain = join_by_depth(*arrays)
        found.append(certain)
        return picture, certain

    monkeypatch.setattr(backgrounds, "join_by_depth", noted)
    monkeypatch.setattr(backgrounds.Backgrounds, "_compare", lambda self, plan, background, place: None)
    monkeypatch.setattr(backgrounds, "_joining_pays", {})
    return found


def walk(env: KitchenEnv, seed: int) -> Iterator[None]:
    """A demonstration, step by step, be it solved or not."""
    env.reset(seed=seed)
    with contextlib.suppress(SkillError):
        for action in demonstrate(env):
            *_, truncated, info = env.step(action.astype(np.float32))
            yield
            if truncated or info["success"]:
                return


@pytest.mark.costly
@pytest.mark.parametrize("task", task_selection.demonstrated(fast=FAST))
def test_a_joined_picture_is_the_full_drawing(task: str, joined: list[bool]) -> None:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    renderers: list[SceneRenderer] = []
    steps = 0
    for _ in walk(env, SEED):
        steps += 1
        if not renderers:
            renderers = [
                SceneRenderer(env.model, PIXELS, PIXELS, opengl=True, keeps_backgrounds=keeps)
                for keeps in (False, True)
            ]
        full, keeping = (renderer.pictures(env.data, contract.CAMERAS) for renderer in renderers)
        pairs = zip(contract.CAMERAS, full, keeping, strict=True)
        assert [name for name, one, other in pairs if not np.array_equal(one, other)] == []
    for renderer in renderers:
        renderer.close()
    env.close()
    assert steps > 0
    if task in FAST:  # in others the base drives, or glass moves
        assert sum(joined) > 0.1 * len(contract.CAMERAS) * steps, "backgrounds were used"


def test_a_picture_does_not_depend_on_what_was_drawn_before(joined: list[bool]) -> None:
    env = KitchenEnv("OpenDrawer", cameras=(), terminate_on_success=False)
    states = [(env.data.qpos.copy(), env.data.qvel.copy()) for _ in walk(env, SEED)]
    shuffled = np.random.default_rng(0).permutation(np.repeat(np.arange(len(states)), 2))
    renderer = SceneRenderer(env.model, PIXELS, PIXELS, opengl=True)
    drawn: dict[int, list[NDArray[np.uint8]]] = {}
    for number in [*range(len(states)), *shuffled.tolist()]:
        env.data.qpos[:], env.data.qvel[:] = states[number]
        mujoco.mj_forward(env.model, env.data)
        pictures = renderer.pictures(env.data, contract.CAMERAS)
        first = drawn.setdefault(number, pictures)
        assert all(np.array_equal(*two) for two in zip(first, pictures, strict=True))
    assert sum(joined) > len(states) > 0
    renderer.close()
    env.close()


def test_the_grid_moves_a_camera_by_half_a_step() -> None:
    rng = np.random.default_rng(1)
    positions = rng.uniform(-5.0, 5.0, (200, 3))
    rotations = Rotation.random(200, random_state=2).as_matrix().reshape(-1, 9)
    places, turned = on_grid(positions, rotations)
    assert np.abs(places - positions).max() <= GRID_M / 2 + 1e-12
    between = Rotation.from_matrix(turned.reshape(-1, 3, 3)) * Rotation.from_matrix(rotations.reshape(-1, 3, 3)).inv()
    assert between.magnitude().max() <= 2.0 * GRID_QUATERNION  # four components, each off by half a step at most
    nudged, _ = on_grid(places + 0.4 * GRID_M, rotations)
    np.testing.assert_array_equal(nudged, places)


def test_what_is_nearer_is_seen_and_doubts_are_told() -> None:
    far, near = np.full((2, 2, 3), 10, np.uint8), np.full((2, 2, 3), 200, np.uint8)
    kept = np.array([[0.5, 0.5], [0.5, 0.0]], np.float32)
    drawn = np.array([[0.4, 0.6], [0.0, 0.0]], np.float32)  # behind, before, and twice nothing
    picture, certain = join_by_depth(far, kept, near, drawn)
    assert certain
    np.testing.assert_array_equal(picture[..., 0], [[10, 200], [10, 10]])
    veil = np.zeros((2, 2), np.float32)
    assert join_by_depth(far, kept, near, drawn, veil)[1]
    veil[0, 1] = 0.7  # glass before what is drawn
    assert not join_by_depth(far, kept, near, drawn, veil)[1]
    drawn[1, 0] = 0.5  # at one depth
    assert not join_by_depth(far, kept, near, drawn)[1]


def test_pixels_of_several_samples_are_not_joined(joined: list[bool]) -> None:
    env = KitchenEnv("OpenDrawer", cameras=(), terminate_on_success=False)
    env.reset(seed=SEED)
    env.model.vis.quality.offsamples = 4
    renderer = SceneRenderer(env.model, PIXELS, PIXELS, opengl=True)
    for _ in range(4):
        renderer.pictures(env.data, contract.CAMERAS)
    assert joined == []
    renderer.close()
    env.close()
