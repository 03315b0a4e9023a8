"""Motion style: what differs between two demonstrations of one task beyond the kitchen, drawn once for each.

A demonstration has a speed, a side to which its free paths bow, and a preference among poses of the hand that are
about equally good: grasps, rolls and approaches. Where a hand waits before it goes straight to a handle is drawn too:
a policy that is trained on it has seen how a hand comes back from beside its goal, which one that always waits at the
same place has not. speed and bow change the free paths of any skill; the preference is asked for by skills that choose
among candidates (`motion_style_of(env).bonuses`), and so is the place (`motion_style_of(env).beside`).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import mujoco
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import DEAD_ZONES, FROM_ACHIEVED, Array, limit
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

_SLOWEST = 0.85
_BOW_RAD = 0.1
# A candidate may cost this much more than the best one (`reach.Plan.cost`) and still be taken.
_WEIGHT = 0.12
# Half sizes in metres of the box in which a hand waits, along the world's horizontal across the approach, upwards (the
# counter's edge is near) and along the approach (backwards).
_ACROSS_M, _DOWN_M, _UP_M, _BACK_M = 0.05, 0.04, 0.015, 0.03
# Motions with greater commands than this are free ones: skills approach objects, push and pull with smaller ones.
_FAST = 0.9

_POSITION = contract.ACTION_SLICES["end_effector_position"]
_BASE = contract.ACTION_SLICES["base_motion"]
_GRIPPER = contract.ACTION_SLICES["gripper_close"]
_MODE = contract.ACTION_SLICES["control_mode"]


@dataclass(frozen=True)
class MotionStyle:
    """How a demonstration is carried out. The defaults change nothing.

    Attributes:
        speed: bound of the commands that move the hand, not of those that turn it, and factor of the driving base's
            speed, in (0, 1].
        bow_rad: angle about the vertical by which free horizontal paths of the open hand start beside their goal.
        hand: quaternion (w, x, y, z) in the world of the hand that is preferred.
        weight: what the preference is worth, in the cost of candidates.
        wait_m: where a hand waits before it goes straight to its goal, beside the skill's own place: across the
            approach, upwards, and along the approach.
    """

    speed: float = 1.0
    bow_rad: float = 0.0
    hand: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    weight: float = 0.0
    wait_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> MotionStyle:
        """A random one."""
        quaternion = rng.normal(size=4)
        w, x, y, z = (float(v) for v in quaternion / np.linalg.norm(quaternion))
        speed, bow = float(rng.uniform(_SLOWEST, 1.0)), float(rng.uniform(-_BOW_RAD, _BOW_RAD))
        across, up, along = (float(v) for v in rng.uniform((-_ACROSS_M, -_DOWN_M, -_BACK_M), (_ACROSS_M, _UP_M, 0.0)))
        return cls(speed=speed, bow_rad=bow, hand=(w, x, y, z), weight=_WEIGHT, wait_m=(across, up, along))

    def beside(self, approach: Array) -> Array:
        """Offset (3,) in metres of the place where a hand waits that will go along `approach`, a unit vector (3,)."""
        across, up, along = self.wait_m
        sideways = np.cross(approach, [0.0, 0.0, 1.0])
        length = float(np.linalg.norm(sideways))
        sideways = sideways / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])
        return across * sideways + up * np.cross(sideways, approach) + along * approach

    def bonuses(self, rotations: Array) -> Array:
        """What hand rotations (N, 3, 3) gain over others by being preferred, in [0, weight], (N,)."""
        if not self.weight:
            return np.zeros(len(rotations))
        gained: Array = self.weight * (np.trace(self._hand.T @ rotations, axis1=1, axis2=2) + 1.0) / 4.0
        return gained

    @functools.cached_property
    def _hand(self) -> Array:
        """The preferred hand rotation, (3, 3)."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, np.array(self.hand))
        return matrix.reshape(3, 3)

    def carry_out(self, action: Array) -> Array:
        """An action (12,), stored order, as this demonstration carries it out."""
        if self.speed == 1.0 and self.bow_rad == 0.0:
            return action
        out = action.copy()
        move = out[_POSITION]
        largest = float(np.abs(move).max())
        if largest > _FAST and out[_GRIPPER][0] < 0 and out[_MODE][0] == FROM_ACHIEVED:
            c, s = np.cos(self.bow_rad), np.sin(self.bow_rad)
            out[_POSITION] = [c * move[0] - s * move[1], s * move[0] + c * move[1], move[2]]
        out[_POSITION] = limit(out[_POSITION], self.speed)
        if largest > 0:  # arm and base together keep step with each other
            return out
        # A base at rest answers to commands beyond its dead zones: these are the speed.
        beyond = np.maximum(np.abs(out[_BASE]) - DEAD_ZONES, 0.0)
        out[_BASE] -= np.sign(out[_BASE]) * (1.0 - self.speed) * beyond
        return out


PLAIN = MotionStyle()
_given: WeakKeyDictionary[KitchenEnv, MotionStyle] = WeakKeyDictionary()


def give_motion_style(env: KitchenEnv, style: MotionStyle) -> None:
    """Let the demonstrations in an env be carried out so, from now on."""
    _given[env] = style


def motion_style_of(env: KitchenEnv) -> MotionStyle:
    """How the demonstration that runs in an env is carried out."""
    return _given.get(env, PLAIN)
