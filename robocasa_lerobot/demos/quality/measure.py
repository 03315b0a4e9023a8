"""Measures of one attempt: of its start, and if it was kept, of its motion, contacts, views and path.

States are set one after the other into the kitchen that the seed makes; nothing is stepped.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.hdf5 import segments_of
from robocasa_lerobot.demos.motion import UP, Array, base_pose, floor_axes, grip_position, rotation_about
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.replay import Demonstration, kitchen_of, made_otherwise, read_demonstration
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.objects import middle_of
from robocasa_lerobot.envs.projection import camera_matrix, project
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import UserError

EVERY = 4  # steps between states that are looked at for contacts and views
PATH_POINTS = 20  # of a path that is compared with others
STILL_M = 0.002  # of the hand in a step: it idles
FULL = 0.98  # of a command's bound: it is saturated
FREE_DOFS = 6


@dataclass(frozen=True)
class Start:
    """Where the thing that the first stage is about lies before the robot: x ahead and y to the left, metres."""

    seed: int
    ahead_m: float
    left_m: float


@dataclass(frozen=True)
class Measures:
    """Of a kept demonstration.

    Attributes:
        start: of its scene.
        seconds: that it takes.
        jerk: root mean square of the hand's third derivative, m/s^3.
        idle: share of steps in which the hand does not move, though the base does not either.
        saturated: share of steps in which a component of the arm's command is at its bound, which of positions is the
            speed of the demonstration's style.
        other_contacts: share of the states looked at in which the robot touches what no stage is about.
        in_view: share of these in which a camera has the running stage's object or fixture in its picture.
        path: (PATH_POINTS, 3) of the hand, evenly in time, in the frame of `start`'s thing: metres, and axes of the
            robot's base at the beginning.
        stand: (3,) where the base stands at the end, in the same frame: x and y in metres, heading in radians.
        sources: numbers of the sources that its segments come from; empty where it was not generated.
        segments: what each segment is about, and its source's name; the same.
    """

    start: Start
    seconds: float
    jerk: float
    idle: float
    saturated: float
    other_contacts: float
    in_view: float
    path: Array
    stand: Array
    sources: tuple[int, ...]
    segments: tuple[tuple[str, str], ...] = ()


def start_of(env: KitchenEnv) -> Start:
    """Of the episode that an env was reset to."""
    base, yaw = base_pose(env.data)
    ahead, left = floor_axes(yaw) @ (_about(env, env.data, env.declaration.stages[0]) - base)
    return Start(env.scene.seed, float(ahead), float(left))


def measure(path: Path, demo: str) -> Measures:
    """Of a demonstration in a file.

    Raises:
        UserError: other software recorded it, or its kitchen cannot be made again, or is made differently now.
    """
    recorded = read_demonstration(path, demo)
    with h5py.File(path) as file:
        group = file[f"data/{demo}"]
        sources = tuple(group["src_demo_inds"][()].tolist()) if "src_demo_inds" in group else ()
    env = kitchen_of(recorded)
    try:
        env.reset(seed=recorded.seed)
        if why := made_otherwise(env, recorded.states):
            raise UserError(f"{path}, {demo}: {why}. Take the version that recorded it, or leave the file out.")
        return _measured(env, recorded, sources)
    finally:
        env.close()


def _measured(env: KitchenEnv, recorded: Demonstration, sources: tuple[int, ...]) -> Measures:
    data = mujoco.MjData(env.model)
    start, origin = start_of(env), _about(env, env.data, env.declaration.stages[0])
    heading = base_pose(env.data)[1]
    axes = rotation_about(UP, heading)
    hands, bases = np.empty((len(recorded.states), 3)), np.empty((len(recorded.states), 3))
    touches, views = [], []
    stages = np.zeros(len(recorded.states), dtype=np.int64) if recorded.stage is None else recorded.stage
    masks = _Masks.of(env)
    for step, state in enumerate(recorded.states):
        data.qpos[:], data.qvel[:] = state[1 : 1 + env.model.nq], state[1 + env.model.nq :]
        mujoco.mj_kinematics(env.model, data)
        hands[step] = grip_position(data)
        (x, y, _), yaw = base_pose(data)
        bases[step] = x, y, yaw
        if step % EVERY == 0:
            mujoco.mj_camlight(env.model, data)
            mujoco.mj_collision(env.model, data)
            touches.append(masks.meets(env.model, data))
            views.append(_seen(env, data, env.declaration.stages[int(stages[step])]))
    local = (hands - origin) @ axes
    evenly = np.linspace(0, len(local) - 1, PATH_POINTS)
    path = np.column_stack([np.interp(evenly, np.arange(len(local)), local[:, axis]) for axis in range(3)])
    end = (np.array([*bases[-1, :2], origin[2]]) - origin) @ axes
    turn = wrap(float(bases[-1, 2]) - heading)
    return Measures(
        start=start,
        seconds=len(recorded.actions) / contract.CONTROL_HZ,
        jerk=_jerk(hands),
        idle=_idle(hands, bases),
        saturated=_saturated(recorded.actions, _speed(recorded.meta)),
        other_contacts=float(np.mean(touches)),
        in_view=float(np.mean(views)),
        path=path,
        stand=np.array([end[0], end[1], turn]),
        sources=sources,
        segments=segments_of(recorded.meta),
    )


def _jerk(hands: Array) -> float:
    third = np.diff(hands, n=3, axis=0) * contract.CONTROL_HZ**3
    return float(np.sqrt((third**2).sum(axis=1).mean())) if len(third) else 0.0


def _idle(hands: Array, bases: Array) -> float:
    moved = np.linalg.norm(np.diff(hands, axis=0), axis=1)
    driven = np.hypot(*np.diff(bases[:, :2], axis=0).T)
    return float(((moved < STILL_M) & (driven < STILL_M)).mean()) if len(moved) else 0.0


def _speed(meta: dict[str, Any]) -> float:
    """Bound of a demonstration's commands to move the hand, see `MotionStyle`; rotations are not bound by it."""
    return float((meta.get("motion_style") or {}).get("speed", 1.0))


def _saturated(actions: Array, speed: float = 1.0) -> float:
    position, rotation = (
        np.abs(actions[:, contract.ACTION_SLICES[f"end_effector_{what}"]]) for what in ("position", "rotation")
    )
    return float(((position > FULL * speed).any(axis=1) | (rotation > FULL).any(axis=1)).mean())


def _about(env: KitchenEnv, data: mujoco.MjData, stage: Stage) -> Array:
    """Middle of what a stage is about, (3,): its object, or else its target, which may be an object too."""
    for name in (env.scene.fill(stage.object), env.scene.fill(stage.target)):
        if name in env.scene.objects:
            return np.array(middle_of(env.scene, data, name))
        if _is_loose(env, name):
            return np.array(data.body(name).xpos)
    return np.array(env.scene.fixture(stage.target).pos, dtype=np.float64)


def _is_loose(env: KitchenEnv, name: str) -> bool:
    """Whether a body of that name moves freely, as objects do, and a blender's lid, which is none."""
    model = env.model
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    return body >= 0 and model.body_dofnum[body] == FREE_DOFS


def _seen(env: KitchenEnv, data: mujoco.MjData, stage: Stage) -> bool:
    """Whether the middle of what a stage is about is in one of the cameras' pictures, whatever stands before it."""
    point = _about(env, data, stage)
    for camera in contract.CAMERAS:
        intrinsics, pose = camera_matrix(env.model, data, camera, contract.IMAGE_SIZE)
        pixel, depth = project(point, intrinsics, pose)
        if depth > 0.0 and (pixel >= 0.0).all() and (pixel < contract.IMAGE_SIZE).all():
            return True
    return False


@dataclass(frozen=True)
class _Masks:
    """Bodies (nbody,): the robot's, and those that it may touch: the stages' objects and fixtures, and the floor."""

    robot: NDArray[np.bool_]
    allowed: NDArray[np.bool_]

    @classmethod
    def of(cls, env: KitchenEnv) -> _Masks:
        scene = env.scene
        names: set[str] = set()
        for stage in env.declaration.stages:
            for word in (stage.object, stage.target):
                filled = scene.fill(word)
                if filled in scene.objects or _is_loose(env, filled):
                    names.add(filled)
                elif word in scene.roles:
                    names.add(scene.fixtures[scene.roles[word]].name)
        robot = scene.subtree(scene.robot.names.base)
        allowed = robot.copy()
        allowed[0] = True
        bodies = {env.model.body(body).name for body in range(env.model.nbody)}
        for name in names & bodies:
            allowed |= scene.subtree(name)
        return cls(robot, allowed)

    def meets(self, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
        """Whether the robot touches anything else."""
        if data.ncon == 0:
            return False
        bodies = model.geom_bodyid[data.contact.geom[: data.ncon]]
        touching = data.contact.dist[: data.ncon] <= 0.0
        other = self.robot[bodies] & ~self.allowed[bodies][:, ::-1]
        return bool((other.any(axis=1) & touching).any())
