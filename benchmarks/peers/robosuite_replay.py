"""How well robosuite itself repeats one of its recorded traces, and how far two of its runs drift apart.

Runs in robosuite's environment, which `benchmarks/sim_speed.py` prepares, not in ours:

    benchmarks/.venvs/robosuite/bin/python benchmarks/peers/robosuite_replay.py --traces panda_omron_traces.npz
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from robosuite.controllers import load_composite_controller_config
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import EmptyArena
from robosuite.models.tasks import ManipulationTask

ARM_HOME = (-0.01612974, -1.03446714, -0.02397936, -2.27550888, 0.03932365, 1.51639493, 0.69615947)
SETTLE_STEPS = 10
# HDF5 order to robosuite 1.5.1's: arm, torso, base, gripper, mode.
ACTION_ORDER = (0, 1, 2, 3, 4, 5, 10, 7, 8, 9, 6, 11)


class EmptyRoom(ManipulationEnv):
    """A PandaOmron at the origin in RoboCasa's initial pose, and nothing else."""

    def _load_model(self) -> None:
        super()._load_model()
        robot = self.robots[0]
        robot.init_qpos = np.array(ARM_HOME)
        robot.init_torso_qpos = np.zeros(1)
        robot.robot_model.set_base_xpos([0.0, 0.0, 0.0])
        arena = EmptyArena()
        arena.set_origin([0.0, 0.0, 0.0])
        self.model = ManipulationTask(mujoco_arena=arena, mujoco_robots=[robot.robot_model], mujoco_objects=[])

    def reward(self, action: np.ndarray | None = None) -> float:
        return 0.0

    def _check_success(self) -> bool:
        return False

    def visualize(self, vis_settings: dict[str, bool]) -> None:
        return None


def replay(actions: np.ndarray, joints: list[str], perturbation: float) -> tuple[np.ndarray, np.ndarray]:
    """Joints (T+1, 13) and grip site positions (T+1, 3); the second arm joint starts `perturbation` radians off."""
    env = EmptyRoom(
        robots="PandaOmron",
        controller_configs=load_composite_controller_config(robot="PandaOmron"),
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        ignore_done=True,
        horizon=len(actions) + SETTLE_STEPS + 1,
        control_freq=20,
        initialization_noise=None,
        lite_physics=True,
    )
    env.reset()
    model, data = env.sim.model, env.sim.data
    where = [model.get_joint_qpos_addr(joint) for joint in joints]
    grip = model.site_name2id("gripper0_right_grip_site")
    for _ in range(SETTLE_STEPS):
        env.step(np.zeros(12))
    if perturbation:
        data.qpos[where[joints.index("robot0_joint2")]] += perturbation
        env.sim.forward()
    rows = [(data.qpos[where].copy(), data.site_xpos[grip].copy())]
    for action in actions:
        env.step(action[list(ACTION_ORDER)])
        rows.append((data.qpos[where].copy(), data.site_xpos[grip].copy()))
    env.close()
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--traces", type=Path, required=True, help="the recordings (.npz)")
    parser.add_argument("--trace", default="arm_random_mode+1", help="which of them")
    options = parser.parse_args()
    with np.load(options.traces) as file:
        joints = [str(name) for name in file["joint_names"]]
        actions, recorded = file[f"{options.trace}/actions"], file[f"{options.trace}/qpos"]
    own, grip = replay(actions, joints, 0.0)
    apart = {size: 1e3 * np.linalg.norm(replay(actions, joints, size)[1] - grip, axis=1) for size in (1e-12, 1e-9)}
    print("| step | joints off the recording | " + " | ".join(f"mm apart from {size:.0e} rad" for size in apart) + " |")
    print("|--:|--:|" + "--:|" * len(apart))
    for step in sorted({0, 1, len(actions), *range(10, len(actions), 10)}):
        cells = " | ".join(f"{distance[step]:.1e}" for distance in apart.values())
        print(f"| {step} | {np.abs(own[step] - recorded[step]).max():.1e} | {cells} |")


if __name__ == "__main__":
    main()
