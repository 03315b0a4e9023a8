"""A robot is a value: a made-up variant of another home, footprint and gripper, and nothing else changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robocasa_lerobot.demos.planning.grasps import grasp_poses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.objects.catalogue import CATEGORIES, instance
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.robot_poses import is_free
from robocasa_lerobot.errors import UnknownNameError

FARTHER_M = 0.15
VARIANT = replace(
    PANDA_OMRON,
    name="variant",
    home=replace(PANDA_OMRON.home, arm=(0.3, -0.8, 0.1, -2.0, 0.2, 1.4, 0.5)),
    shape=replace(
        PANDA_OMRON.shape,
        standoff=PANDA_OMRON.shape.standoff + FARTHER_M,
        base_x=(-0.70, 0.25),
        base_y=(-0.32, 0.32),
    ),
    gripper=replace(PANDA_OMRON.gripper, opening=0.045),
    camera_sets={"front": PANDA_OMRON.camera_sets["default"], "default": PANDA_OMRON.camera_sets["default"]},
)
SEEDS = range(4)


def env_of(task: str, robot=PANDA_OMRON) -> KitchenEnv:
    return KitchenEnv(task, robot=robot, cameras=())


@pytest.mark.parametrize("task", ["OpenDrawer", "PickPlaceCounterToSink", "CloseFridge"])
def test_scenes_are_made_for_the_robot_that_is_in_them(task: str) -> None:
    env = env_of(task, VARIANT)
    for seed in SEEDS:
        env.reset(seed=seed)
        scene = env.scene
        assert scene.robot is VARIANT
        assert is_free(scene.layout, scene.robot_pose, VARIANT.shape)
        arm = [float(env.data.joint(name).qpos[0]) for name in VARIANT.names.arm_joints]
        assert np.abs(np.array(arm) - VARIANT.home.arm).max() < 0.12  # noise of 0.02 rad, then settled
        base = env.data.site(VARIANT.names.base_center_site).xpos
        assert np.hypot(base[0] - scene.robot_pose.x, base[1] - scene.robot_pose.y) < 0.02
    env.close()


def test_it_stands_as_far_as_it_says() -> None:
    usual, farther = env_of("NavigateKitchen"), env_of("NavigateKitchen", VARIANT)
    for seed in SEEDS:
        usual.reset(seed=seed)
        farther.reset(seed=seed)
        for role in ("source", "target"):
            if usual.scene.roles != farther.scene.roles:
                continue  # its larger base left another arrangement
            near, far = usual.scene.standing_pose(role), farther.scene.standing_pose(role)
            assert np.hypot(near.x - far.x, near.y - far.y) == pytest.approx(FARTHER_M)


def test_an_episode_runs_and_its_state_goes_on() -> None:
    env = env_of("TurnOnMicrowave", VARIANT)
    env.reset(seed=3)
    action = np.zeros(12, dtype=np.float32)
    action[5] = 0.5
    env.step(action)
    state = env.get_state()
    first, *_ = env.step(action)
    again, *_ = env.set_state(state)[:1]
    second, *_ = env.step(action)
    assert first["agent_pos"].tobytes() == second["agent_pos"].tobytes() != again["agent_pos"].tobytes()
    env.close()


def test_its_cameras_are_its_own() -> None:
    KitchenEnv("OpenDrawer", robot=VARIANT, camera_set="front").close()
    with pytest.raises(UnknownNameError, match="front"):
        KitchenEnv("OpenDrawer", camera_set="front")
    with pytest.raises(UnknownNameError, match="cotraining"):
        KitchenEnv("OpenDrawer", robot=VARIANT, camera_set="cotraining")


def test_a_narrow_gripper_is_sent_to_narrow_objects() -> None:
    widths: dict[str, float] = {}
    for name in ("apple", "can", "mug", "spoon"):
        item = instance(CATEGORIES[name], 0)
        for robot in (PANDA_OMRON, VARIANT):
            poses = grasp_poses(item, robot.gripper)
            assert all(pose.width < robot.gripper.opening for pose in poses)
            widths[f"{name} {robot.name}"] = max((pose.width for pose in poses), default=0.0)
    assert widths["apple PandaOmron"] > VARIANT.gripper.opening > widths["apple variant"]
