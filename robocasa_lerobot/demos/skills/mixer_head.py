"""Heads of stand mixers: lifted by the finger tips under their nose; led down by its cap, or pressed from above."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, frame
from robocasa_lerobot.demos.planning.articulated import ContactPath, Shift, plan_contact
from robocasa_lerobot.demos.planning.contact_paths import grip_path, push_path
from robocasa_lerobot.demos.skills.arc_motion import pull_arc, push_arc
from robocasa_lerobot.demos.skills.articulated_part import ArticulatedPart
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.robots.robot import GripperGeometry
from robocasa_lerobot.envs.tasks.task import Stage

ATTEMPTS = 5
UP_SHARE, DOWN_SHARE = 0.998, 0.002  # beyond the 0.99 and 0.01 that tasks ask for
# Of the hand: pitch (upwards) and turn to the right of straight ahead, degrees.
LIFTS = ((0.0, 0.0), (0.0, 30.0), (0.0, -30.0), (15.0, 0.0), (0.0, 60.0), (0.0, -60.0))
PRESSES = ((-20.0, 0.0), (-35.0, 0.0), (-50.0, 0.0), (-20.0, 35.0), (-20.0, -35.0))
# The same with the head up, and the share of the head's angle by which the hand turns with it.
DRAGS = tuple((pitch, aside, turn) for pitch in (-20, 10, 30, 45, 60) for aside in (0, 20, -20) for turn in (0.0, 0.5))
HALF_SHARE = 0.15  # of the turn upwards, from where there is room over the head
# The cap stands out before the nose by this much; its middle is this high in the head. The corners of the finger tips
# keep off the nose.
CAP_M, CAP_HEIGHT, OFF_NOSE_M = 0.015, 0.56, 0.0015
STANCES: tuple[tuple[Shift, Shift], ...] = tuple(
    ((ahead, left), (ahead, left)) for ahead in (0.0, -0.12, -0.25, -0.4, 0.1) for left in (0.0, 0.15, -0.15, 0.3, -0.3)
)


def raise_head(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Tilt a mixer's head up.

    Raises:
        SkillError: it is not up after five attempts.
    """
    head = _head(env, stage)
    for _ in range(ATTEMPTS):
        paths = [_lift_path(env.robot.gripper, head, lift, roll) for lift in LIFTS for roll in (1.0, -1.0)]
        yield from push_arc(env, head, paths, STANCES, UP_SHARE * head.full)
        if head.share >= UP_SHARE:
            return
    raise SkillError(f"{head.name} is {head.share:.0%} up after {ATTEMPTS} attempts")


def lower_head(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Press a mixer's head down.

    Raises:
        SkillError: it is not down after five attempts.
    """
    head = _head(env, stage)
    for _ in range(ATTEMPTS):
        if head.share > HALF_SHARE + 0.1:
            paths = [_drag_path(env.robot.gripper, head, drag, roll) for drag in DRAGS for roll in (1.0, -1.0)]
            yield from pull_arc(env, head, plan_contact(env, head, paths, STANCES), DOWN_SHARE * head.full)
            if head.share <= DOWN_SHARE:
                return
            if head.share > HALF_SHARE + 0.2:
                continue  # the cap has slipped out of the fingers
        paths = [_press_path(env.robot.gripper, head, press, roll) for press in PRESSES for roll in (1.0, -1.0)]
        yield from push_arc(env, head, paths, STANCES, DOWN_SHARE * head.full)
        if head.share <= DOWN_SHARE:
            return
    raise SkillError(f"{head.name} is still {head.share:.1%} up after {ATTEMPTS} attempts")


def _head(env: KitchenEnv, stage: Stage) -> ArticulatedPart:
    mixer = env.scene.fixture(stage.target, Appliance)
    return ArticulatedPart(env.data, mixer, mixer.joint("head"))


def _lift_path(gripper: GripperGeometry, head: ArticulatedPart, tilt: tuple[float, float], roll: float) -> ContactPath:
    """Push the head up near its nose, the fingers flat under it."""
    local = np.array([0.0, 0.9 * head.low[1], head.low[2]])
    rotation = _rotation(head, tilt, roll)
    return push_path(gripper, head, local, -UP, lambda _: rotation, UP_SHARE * head.full, off_m=0.015, back_m=0.12)


def _drag_path(
    gripper: GripperGeometry, head: ArticulatedPart, drag: tuple[float, float, float], roll: float
) -> ContactPath:
    """Hold the cap on the nose and lead it down: a head that is up is too near a wall cabinet to reach over it."""
    pitch, aside, turn = drag
    skew = head.angle + np.deg2rad(pitch)  # of the fingers from the cap's axis
    thick, _, tall = gripper.closed_half
    corner = tall * np.cos(skew) + thick * abs(np.sin(skew))
    local = np.array([0.0, head.outside + CAP_M - corner - OFF_NOSE_M, CAP_HEIGHT * head.high[2]])
    first = head.angle

    def rotation_at(angle: float) -> Array:
        return _rotation(head, (pitch + turn * np.rad2deg(first - angle), aside), roll)

    # From below, for there is a wall cabinet close above; straight, for then the fingers pass beside the cap.
    bias = 0.005 * abs(pitch - 35.0) + 0.005 * abs(aside)
    return grip_path(head, local, rotation_at, DOWN_SHARE * head.full, bias=bias)


def _press_path(gripper: GripperGeometry, head: ArticulatedPart, tilt: tuple[float, float], roll: float) -> ContactPath:
    """Push the head down near its nose, the fingers flat on it."""
    local = np.array([0.0, 0.85 * head.low[1], head.high[2]])
    rotation = _rotation(head, tilt, roll)
    return push_path(gripper, head, local, UP, lambda _: rotation, DOWN_SHARE * head.full, off_m=0.04, back_m=0.06)


def _rotation(head: ArticulatedPart, tilt: tuple[float, float], roll: float) -> Array:
    pitch, aside = np.deg2rad(tilt)
    level = np.cos(aside) * head.inwards + np.sin(aside) * head.rightwards
    return frame(np.cos(pitch) * level + np.sin(pitch) * UP, roll * head.rightwards)
