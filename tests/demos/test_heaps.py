"""What is heaped in a bowl is taken from above; on a plate things come to lie side by side."""

from __future__ import annotations

from collections.abc import Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import UP
from robocasa_lerobot.demos.skills.pick_place.graspable import graspable
from robocasa_lerobot.demos.skills.pick_place.heaps import HIGHER_M, uppermost
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import reach_on
from robocasa_lerobot.demos.skills.pick_place.poses.plate_poses import is_flat, offsets, side_by_side
from robocasa_lerobot.envs.kitchen_env import KitchenEnv


def made(name: str) -> Iterator[KitchenEnv]:
    env = KitchenEnv(name, split="target", cameras=(), terminate_on_success=False)
    env.reset(seed=100_000)
    yield env
    env.close()


def test_of_what_is_heaped_in_a_bowl_the_uppermost_comes_first() -> None:
    for env in made("PortionHotDogs"):
        stages = env.declaration.stages
        asked, bowl = env.data.joint(f"{stages[0].object}_joint0"), env.data.body("bowl").xpos
        others = [env.data.joint(f"{stage.object}_joint0") for stage in stages[1:]]
        before = [joint.qpos.copy() for joint in (asked, *others)]
        for number, joint in enumerate((asked, *others)):  # all in the bowl, each on those before
            joint.qpos[:3] = bowl + (0.5 + number) * 2 * HIGHER_M * UP
            joint.qpos[3:7] = (1, 0, 0, 0)  # lying, however they had come to rest
        mujoco.mj_kinematics(env.model, env.data)
        assert uppermost(env, stages, 0) == len(stages) - 1
        asked.qpos[2] = bowl[2] + 8 * HIGHER_M
        mujoco.mj_kinematics(env.model, env.data)
        assert uppermost(env, stages, 0) == 0
        for joint, qpos in zip((asked, *others), before, strict=True):
            joint.qpos[:] = qpos
        mujoco.mj_kinematics(env.model, env.data)


def test_what_lies_in_no_vessel_comes_when_it_is_asked_for() -> None:
    for env in made("StoreLeftoversInBowl"):
        stages = env.declaration.stages
        assert [uppermost(env, stages, index) for index in range(2, len(stages))] == list(range(2, len(stages)))


def test_on_a_plate_a_bun_leaves_room_and_comes_to_lie_beside_a_sausage() -> None:
    for env in made("PortionHotDogs"):
        plate, bun = env.data.body("plate1").xpos.copy(), graspable(env, "hotdog_bun1")
        most = reach_on(env, "plate1")
        assert is_flat(env, "plate1")
        assert not is_flat(env, "bowl")
        assert all(np.linalg.norm(place) < most for place in offsets(most))
        across = np.array([0.0, 0.5 * most, 0.0])  # of a bun whose long axis is the room's x
        assert bun.half_extents(np.eye(3))[0] > bun.half_extents(np.eye(3))[1]
        first = side_by_side(env, bun, "plate1", most, more=True)
        assert first(plate + across, np.eye(3)) < first(plate, np.eye(3))
        sausage = env.data.joint("sausage1_joint0")
        before = sausage.qpos.copy()
        sausage.qpos[:] = [*(plate - across + 0.02 * UP), 1.0, 0.0, 0.0, 0.0]
        mujoco.mj_kinematics(env.model, env.data)
        second = side_by_side(env, bun, "plate1", most, more=False)
        assert second(plate + 1.6 * across, np.eye(3)) < second(plate - across, np.eye(3)) - 1.0
        sausage.qpos[:] = before
        mujoco.mj_kinematics(env.model, env.data)
