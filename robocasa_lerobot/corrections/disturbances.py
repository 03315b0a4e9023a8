"""Demonstrations in which the hand is led astray on its way, and comes from there.

A demonstrator goes straight to its goal, so that where the hand is says where the goal must be: a policy learns to go
on as it has begun, and need not look (de Haan et al. 2019, causal confusion). Where something else has moved the
hand, only pictures say where to go (Laskey et al. 2017, DART, do so by noise at every step).
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.motion import CLOSED, OPEN, Array, action, limit
from robocasa_lerobot.demos.motion_style import MotionStyle
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.stages import StageLog
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UserError

# Control steps, drawn between the two: what the demonstrator has until the next disturbance, and how long that lasts. A
# full command moves the hand by a good centimetre.
BETWEEN_STEPS, DISTURBED_STEPS = (4, 30), (6, 20)
UP_SHARE, TURN_SHARE = 0.4, 0.3  # of a full command: most of it upwards or downwards, and about each axis
MOST_MORE_STEPS = 60  # of an episode, for each: to be led astray and to come back
TOGGLED = 0.3  # share of them in which the gripper changes, as after a grasp that has missed
_DISTURBANCE_STREAM = 10  # apart from those of scene, arm, noise, style, choice among sources and corrections


@dataclass(frozen=True)
class DisturbedSettings(RecordingSettings):
    """A recording in which the hand is led astray on its way; it says which steps the demonstrator decided.

    Attributes:
        disturbances: up to how many times in an episode.
    """

    disturbances: int = 1

    def check(self) -> None:
        """Whether attempts can be made at all.

        Raises:
            UserError: there are fewer disturbances than one, or see `RecordingSettings`.
        """
        if self.disturbances < 1:
            raise UserError(f"disturbances: found {self.disturbances}, expected at least 1, or 0 for none at all.")
        super().check()

    def attempt_kwargs(self) -> dict[str, Any]:
        """Time to be led astray and to come back."""
        more = self.disturbances * MOST_MORE_STEPS
        return {**super().attempt_kwargs(), "horizon": get_task(self.task).horizon + more}

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Make the attempt of a seed."""
        demonstrator = DisturbedDemonstrator(np.random.default_rng([seed, _DISTURBANCE_STREAM]), self.disturbances)
        recording = self.labelled_episode(env, seed, demonstrator.act)
        decided = np.array(demonstrator.decided[: len(recording.actions)], dtype=np.uint8)
        recording.per_step[contract.INTERVENTION] = decided.reshape(-1, 1)
        recording.ep_meta["disturbances"] = demonstrator.count
        return recording


def with_disturbances(settings: RecordingSettings, disturbances: int) -> RecordingSettings:
    """The same recording with up to so many disturbances in an episode; 0 leaves it as it is."""
    return DisturbedSettings(**vars(settings), disturbances=disturbances) if disturbances else settings


class DisturbedDemonstrator:
    """A demonstrator that is disturbed, until it touches something: from then on it is left alone.

    Args:
        rng: draws when, whither and for how long.
        most: disturbances of an episode; their number is drawn between one and this.

    Attributes:
        decided: of each action so far, whether the demonstrator decided it.
        count: disturbances so far.
    """

    def __init__(self, rng: np.random.Generator, most: int) -> None:
        self._rng, self._most = rng, most
        self.decided: list[bool] = []
        self.count = 0

    def act(self, env: KitchenEnv, style: MotionStyle, log: StageLog) -> Iterator[Array]:
        """Actions (12,), stored order, each computed from the state that the env is in when it is asked for.

        Raises:
            UnknownNameError: a stage needs a skill that does not exist.
            SkillError: the demonstrator cannot make it good.
        """
        most = int(self._rng.integers(1, self._most + 1))
        while self.count < most:
            gripper = yield from self._demonstrate(env, style, log, int(self._rng.integers(*BETWEEN_STEPS)))
            self.count += 1
            yield from self._disturb(env, gripper)
        yield from self._demonstrate(env, style, log, None)

    def _demonstrate(
        self, env: KitchenEnv, style: MotionStyle, log: StageLog, steps: int | None
    ) -> Generator[Array, None, float]:
        """The demonstrator for so many steps, or to the end once it touches something; what the gripper does then."""
        if env.scene.robot_touches(env.data):
            steps = None
        for step, wanted in enumerate(demonstrate(env, style, log, midway=self.count > 0), start=1):
            self.decided.append(True)
            yield wanted
            if steps is None:
                continue
            if env.scene.robot_touches(env.data):
                steps = None
            elif step >= steps:
                return float(wanted[-1])
        raise AssertionError("a demonstrator stands still in the end, and does not stop")

    def _disturb(self, env: KitchenEnv, gripper: float) -> Iterator[Array]:
        """Move the hand somewhere, mostly to a side, until it meets something."""
        rng = self._rng
        heading = rng.uniform(-np.pi, np.pi)
        move = limit(np.array([np.cos(heading), np.sin(heading), rng.uniform(-UP_SHARE, UP_SHARE)]), 1.0)
        turn = rng.uniform(-TURN_SHARE, TURN_SHARE, 3)
        if rng.uniform() < TOGGLED:
            gripper = OPEN if gripper == CLOSED else CLOSED
        for _ in range(int(rng.integers(*DISTURBED_STEPS))):
            if env.scene.robot_touches(env.data):
                return
            self.decided.append(False)
            yield action(position=move, rotation=turn, gripper=gripper)
