"""Single poses of the hand: our batched solver beside `mink`, where that can be imported."""

from __future__ import annotations

import importlib
import importlib.util
import time
from typing import Any

import mujoco
import numpy as np

from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE, ARM_JOINTS, GRIP_SITE, HAND
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

POSES, ITERATIONS, NEAR_M, NEAR_RAD = 100, 40, 0.005, 0.05


def poses() -> dict[str, Any] | None:
    """Milliseconds for a pose, and how many of the poses are reached, by both; None without mink."""
    if importlib.util.find_spec("mink") is None:
        return None
    mink = importlib.import_module("mink")
    spec = mujoco.MjSpec()
    PANDA_OMRON.add_to(spec, "fast")
    model = spec.compile()
    data = mujoco.MjData(model)
    PANDA_OMRON.set_home(model, data)
    mujoco.mj_forward(model, data)
    arm, home = Arm(model, data, PANDA_OMRON), np.array(PANDA_OMRON.home.arm)
    rng = np.random.default_rng(0)
    goals = np.clip(home + rng.normal(size=(POSES, 7)) * 0.5, *arm.ranges.T)
    positions, rotations = arm.forward(goals)
    arm.solve(positions[:1], rotations[:1], home[None])
    started = time.process_time()
    single = [arm.solve(p[None], r[None], home[None]) for p, r in zip(positions, rotations, strict=True)]
    ours = time.process_time() - started
    reached = sum(bool(s.position_error[0] < NEAR_M and s.rotation_error[0] < NEAR_RAD) for s in single)
    started = time.process_time()
    arm.solve(positions, rotations, np.tile(home, (POSES, 1)))
    together = time.process_time() - started
    started = time.process_time()
    theirs = [_by_mink(mink, model, data, arm, *pose) for pose in zip(positions, rotations, strict=True)]
    seconds = time.process_time() - started
    return {
        "poses": POSES,
        "ours_ms": round(1000 * ours / POSES, 4),
        "ours_together_ms": round(1000 * together / POSES, 4),
        "ours_reached": reached,
        "mink_ms": round(1000 * seconds / POSES, 4),
        "mink_reached": sum(theirs),
    }


def _by_mink(mink: Any, model: mujoco.MjModel, data: mujoco.MjData, arm: Arm, position: Any, rotation: Any) -> bool:
    """Whether mink reaches a pose in the arm's frame with as many steps as ours may take."""
    frame, hand = data.site(ARM_CENTER_SITE), data.body(HAND).xmat.reshape(3, 3)
    axes = frame.xmat.reshape(3, 3)
    grip_in_hand = hand.T @ data.site(GRIP_SITE).xmat.reshape(3, 3)
    goal, turn = frame.xpos + axes @ position, axes @ rotation @ grip_in_hand
    configuration = mink.Configuration(model, data.qpos.copy())
    task = mink.FrameTask(GRIP_SITE, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
    task.set_target(mink.SE3.from_rotation_and_translation(mink.SO3.from_matrix(turn), goal))
    posture = mink.PostureTask(model, cost=1e-3)
    posture.set_target(data.qpos)
    mine = {int(model.joint(name).dofadr[0]) for name in ARM_JOINTS}
    frozen = mink.DofFreezingTask(model, dof_indices=[dof for dof in range(model.nv) if dof not in mine])
    limits = [mink.ConfigurationLimit(model)]
    for _ in range(ITERATIONS):
        error = task.compute_error(configuration)
        if np.linalg.norm(error[:3]) < NEAR_M and np.linalg.norm(error[3:]) < NEAR_RAD:
            return True
        velocity = mink.solve_ik(
            configuration, [task, posture], 1.0, "daqp", damping=1e-3, limits=limits, constraints=[frozen]
        )
        configuration.integrate_inplace(velocity, 1.0)
    error = task.compute_error(configuration)
    return bool(np.linalg.norm(error[:3]) < NEAR_M and np.linalg.norm(error[3:]) < NEAR_RAD)
