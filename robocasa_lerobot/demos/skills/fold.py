"""Fold the arm as at the start of an episode, round obstacles: where most skills begin from, and drives too."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import CLOSED, OPEN, Array, HandTarget, grip_position, hand_rotation
from robocasa_lerobot.demos.planning.approach import Approach
from robocasa_lerobot.demos.planning.base_path import carried
from robocasa_lerobot.demos.planning.collision import CollisionChecker, Held
from robocasa_lerobot.demos.planning.costs import REACHING
from robocasa_lerobot.demos.planning.follow import follow_joint_path
from robocasa_lerobot.demos.skills.common import draw_back, hold_hand
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

FOLDED_RAD = 0.35  # of each joint from its angle at the start
LET_GO_STEPS, OFF_M = 6, 0.08  # of a hand that has just used a handle, which would take the part along


def fold_holding(env: KitchenEnv, held: Held) -> Iterator[Array]:
    """Lead the arm home with an object in the hand: round obstacles where there is a way, else straight."""
    mine = env.scene.subtree(*held.names)
    checker = CollisionChecker(env.scene, env.data, allowed=np.flatnonzero(mine).tolist())
    checker.allow_present()
    way = _way_home(checker, held)
    yield from follow_joint_path(env, checker.arm.home if way is None else way, CLOSED)


def fold_arm(env: KitchenEnv) -> Iterator[Array]:
    """Lead the arm home unless it is there, something is in the hand, or no free path is found."""
    if carried(env.scene, env.data) is not None:
        return
    checker = CollisionChecker(env.scene, env.data)
    base, present = checker.present_base, checker.present_joints
    home = checker.arm.home
    if np.abs(present - home).max() < FOLDED_RAD:
        return
    touched = checker.touched(base[None], present[None], most=8).all()
    if any(env.model.body_dofnum[body] == 1 for body in touched):  # a door or a drawer
        at = HandTarget(grip_position(env.data), hand_rotation(env.data))
        yield from hold_hand(env.data, at, OPEN, LET_GO_STEPS)
        yield from draw_back(env.data, OPEN, OFF_M)
        checker = CollisionChecker(env.scene, env.data)
        base, present = checker.present_base, checker.present_joints
    # What it leans on already is no reason to stay there.
    checker.allow(checker.touched(base[None], present[None]).all())
    way = _way_home(checker)
    if way is not None:
        yield from follow_joint_path(env, way, OPEN)


def _way_home(checker: CollisionChecker, held: Held | None = None) -> Array | None:
    """Joint angles home, straight (7,) or round obstacles (k, 7), that meet nothing new; None where there is no way."""
    base, present, home = checker.present_base, checker.present_joints, checker.arm.home

    def counts(joints: Array, margin_m: float) -> NDArray[np.int64]:
        return checker.touched(np.tile(base, (len(joints), 1)), joints, held=held, margin_m=margin_m).counts

    paths = Approach(checker.arm, counts, REACHING)
    if paths.straight(present, home) < REACHING.hit:
        return home
    detour = paths.detour(present, home, base)
    return None if detour is None else detour[0]
