"""Perturbations of the episode's start and of its wording: they follow from the seed and change nothing else."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from task_selection import every_task

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene import reset_noise
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise, add_initial_noise, touched
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, in_room, is_free
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UserError

SEEDS = range(6)


def starts(**kwargs: object) -> list[tuple[np.ndarray, np.ndarray, str]]:
    """Base pose (x, y, yaw), arm joints before settling, and instruction of each seed."""
    env = KitchenEnv("OpenDrawer", cameras=(), **kwargs)  # type: ignore[arg-type]
    out = []
    for seed in SEEDS:
        env.reset(seed=seed)
        robot = env.scene.robot_pose
        assert is_free(env.scene.layout, robot, PANDA_OMRON.shape)
        arm = np.array([env.data.joint(f"robot0_joint{i}").qpos[0] for i in range(1, 8)])
        out.append((np.array([robot.x, robot.y, robot.yaw]), arm, env.scene.instruction))
    return out


@pytest.mark.costly
def test_each_noise_moves_what_it_names() -> None:
    plain = starts()
    assert all(np.array_equal(a[1], b[1]) for a, b in zip(plain, starts(), strict=True))
    joints = starts(initial_noise=InitialNoise(arm_rad=0.1))
    base = starts(initial_noise=InitialNoise(base_position_m=0.1, base_yaw_deg=10.0))
    for one, arm, moved in zip(plain, joints, base, strict=True):
        assert np.array_equal(one[0], arm[0])
        assert not np.array_equal(one[0], moved[0])
        assert one[2] == arm[2] == moved[2]
        # The same draw, five times as large; the controller has held the arm for half a second since.
        scaled = (arm[1] - np.array(PANDA_OMRON.home.arm)) / (one[1] - np.array(PANDA_OMRON.home.arm))
        assert np.median(scaled) == pytest.approx(5.0, rel=0.2)
    shifts = np.array([moved[0] - one[0] for one, moved in zip(plain, base, strict=True)])
    assert 0.02 < np.abs(shifts[:, :2]).mean() < 0.25
    assert 2.0 < np.rad2deg(np.abs(shifts[:, 2])).mean() < 25.0


def test_the_base_starts_anywhere_within_a_distance_and_at_any_heading() -> None:
    plain, within = starts(), starts(initial_noise=InitialNoise(base_within_m=1.5))
    shifts = np.array([moved[0] - one[0] for one, moved in zip(plain, within, strict=True)])
    far = np.hypot(*shifts[:, :2].T)
    assert far.max() <= 1.5
    assert far.mean() > 0.5
    assert np.abs(np.sin(shifts[:, 2])).max() > 0.8
    assert np.cos(shifts[:, 2]).min() < 0.0


@pytest.mark.costly
@pytest.mark.parametrize("novel", [False, True])
def test_the_side_that_an_instruction_names_is_that_of_where_the_base_starts(novel: bool) -> None:
    """As seen by somebody at its place who faces the counter, as the task has it start."""
    noise = InitialNoise(base_within_m=1.5)
    plain = KitchenEnv("OpenDrawer", cameras=(), novel_language=novel)
    moved = KitchenEnv("OpenDrawer", cameras=(), novel_language=novel, initial_noise=noise)
    named = []
    for seed in range(12):
        plain.reset(seed=seed)
        _, info = moved.reset(seed=seed)
        facing, start = plain.scene.robot_pose.yaw, moved.scene.robot_pose
        drawer = moved.scene.fixtures[moved.scene.roles["drawer"]]
        ahead, left = drawer.pos[0] - start.x, drawer.pos[1] - start.y
        side = "left" if -np.sin(facing) * ahead + np.cos(facing) * left > 0 else "right"
        assert side in moved.scene.instruction
        assert moved.scene.instruction == info["instruction"] == moved.task_description
        assert len(moved.scene.paraphrases) == len(plain.scene.paraphrases)
        named.append(moved.scene.instruction == plain.scene.instruction)
    assert 0 < sum(named) < len(named), "some starts are on the other side of the drawer"


@pytest.mark.costly
def test_the_base_starts_in_no_open_door_and_within_the_room() -> None:
    env = KitchenEnv("CloseFridge", cameras=(), initial_noise=InitialNoise(base_within_m=1.5))
    moved = 0
    for seed in range(12):
        env.reset(seed=seed)
        scene = env.scene
        assert max(scene.openness.values()) > 0.5
        assert in_room(scene.layout, scene.robot_pose)
        assert touched(scene) == []
        moved += scene.robot_pose != env_start(env, seed)
    assert moved > 6


def test_a_start_that_touches_what_no_floor_plan_shows_is_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The doors of a fridge that stands open, say; a start that touches nothing is the one that was drawn first."""
    scene = build_scene(get_task("CloseFridge"), "target", 0)
    start = scene.robot_pose

    def noisy(seed: int) -> tuple[RobotPose, list[str]]:
        moved = dataclasses.replace(scene, seed=seed, robot_pose=start)
        add_initial_noise(moved, InitialNoise(base_within_m=1.5), get_task("CloseFridge"))
        return moved.robot_pose, touched(moved)

    found = [noisy(seed) for seed in range(40)]
    assert not any(names for _, names in found)
    monkeypatch.setattr(reset_noise, "touched", lambda _: [])
    drawn_first = [noisy(seed) for seed in range(40)]
    assert any("fridge" in name for _, names in drawn_first for name in names)
    assert all(pose == first for (pose, _), (first, names) in zip(found, drawn_first, strict=True) if not names)


def test_where_every_start_would_touch_something_the_base_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = build_scene(get_task("OpenDrawer"), "target", 0)
    start = scene.robot_pose
    monkeypatch.setattr(reset_noise, "touched", lambda _: ["wall"])
    add_initial_noise(scene, InitialNoise(base_within_m=1.5), get_task("OpenDrawer"))
    assert scene.robot_pose == start


def env_start(env: KitchenEnv, seed: int) -> RobotPose:
    plain = KitchenEnv(env.task, cameras=())
    plain.reset(seed=seed)
    return plain.scene.robot_pose


@pytest.mark.costly
@pytest.mark.parametrize("task", every_task())
def test_novel_language_is_one_of_the_tasks_other_wordings(task: str) -> None:
    plain, novel = KitchenEnv(task, cameras=()), KitchenEnv(task, cameras=(), novel_language=True)
    told = set()
    for seed in SEEDS:
        first, _ = plain.reset(seed=seed)
        second, info = novel.reset(seed=seed)
        assert np.array_equal(first["agent_pos"], second["agent_pos"])
        assert info["instruction"] != plain.scene.instruction
        assert info["instruction"] in plain.scene.paraphrases
        assert "{" not in info["instruction"]
        told.add(plain.scene.paraphrases.index(info["instruction"]))
    assert len(told) > 1


def test_impossible_noise_is_explained() -> None:
    with pytest.raises(UserError, match=r"initial_noise.arm_rad: found -0.1"):
        InitialNoise(arm_rad=-0.1)
