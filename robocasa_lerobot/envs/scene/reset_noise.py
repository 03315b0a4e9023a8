"""Noise on how the robot starts: its arm's joint angles, and where its base stands and points."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.envs.scene.build import tell
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, is_free, open_before
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.errors import UserError

_BASE_NOISE_STREAM = 3  # key of its generator, apart from those of the scene, the arm and the cameras
_TRIES = 100


@dataclass(frozen=True)
class InitialNoise:
    """How the robot's start is spread: by Gaussian noise, or anywhere round the task's own.

    Args:
        arm_rad: standard deviation on each arm joint, radians; RoboCasa's own episodes have 0.02.
        base_position_m: the same on the base's position along x and y, metres, on top of the task's own spread.
        base_yaw_deg: the same on its heading, degrees.
        base_within_m: the base starts anywhere within so many metres, at any heading: alike over the disc.

    Raises:
        UserError: one is negative or infinite.
    """

    arm_rad: float = 0.02
    base_position_m: float = 0.0
    base_yaw_deg: float = 0.0
    base_within_m: float = 0.0

    @property
    def moves_base(self) -> bool:
        """Whether the base starts elsewhere than the task has it."""
        return max(self.base_position_m, self.base_yaw_deg, self.base_within_m) > 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value >= 0.0):
                raise UserError(f"initial_noise.{field.name}: found {value}, expected a finite number of at least 0.")


def add_initial_noise(scene: Scene, noise: InitialNoise, task: SceneSpec) -> None:
    """Move the start of a scene's robot, before its `initial_data`; the noise follows from the scene's seed.

    A base pose that would stand in a fixture, in an open door or drawer, or outside of the room, or touch anything, is
    drawn again; where none of 100 is free, the base stays. An instruction that says on which side of the robot a
    fixture is says so of the new place, seen as from the old one's heading: facing the counter.
    """
    scene.arm_noise_rad = noise.arm_rad
    if not noise.moves_base:
        return
    rng = np.random.default_rng([scene.seed, _BASE_NOISE_STREAM])
    start = scene.robot_pose
    opened = open_before((scene.fixtures[name], share, share) for (name, _), share in scene.openness.items())
    for _ in range(_TRIES):
        shift = rng.normal(0.0, noise.base_position_m, 2)
        turn = np.deg2rad(rng.normal(0.0, noise.base_yaw_deg))
        if noise.base_within_m > 0.0:
            bearing, turn = rng.uniform(-np.pi, np.pi), turn + rng.uniform(-np.pi, np.pi)
            far = noise.base_within_m * np.sqrt(rng.uniform())
            shift = shift + far * np.array([np.cos(bearing), np.sin(bearing)])
        place = (start.x + float(shift[0]), start.y + float(shift[1]))
        pose = RobotPose(*place, start.yaw + float(turn), _side(scene, task, place) if start.side else "")
        if not is_free(scene.layout, pose, scene.robot.shape, opened):
            continue
        scene.robot_pose = pose
        if not touched(scene):
            if pose.side != start.side:
                scene.words["side"] = pose.side
                tell(scene, task)
            return
    scene.robot_pose = start


def _side(scene: Scene, task: SceneSpec, place: tuple[float, float]) -> str:
    """On which side of a robot at a place, that faces as the task has it start, its fixture is."""
    fixture = scene.fixtures[scene.roles[scene.fill(task.robot_start.fixture)]]
    ahead, left = fixture.pos[0] - place[0], fixture.pos[1] - place[1]
    yaw = scene.robot_pose.yaw
    return "left" if np.cos(yaw) * left > np.sin(yaw) * ahead else "right"


def touched(scene: Scene) -> list[str]:
    """What the robot touches where it starts, its arm without noise."""
    return scene.robot_touches(scene.evaluated_start())
