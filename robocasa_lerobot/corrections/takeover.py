"""An episode that a policy begins, and a demonstrator ends unless the policy has solved the task by then.

What a policy has not seen, it does not do: demonstrations that never miss do not show what comes after a miss (Ross et
al. 2011, DAgger; Kelly et al. 2019, HG-DAgger, where who corrects decides when).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from robocasa_lerobot.demos.demonstrator import SkillError, demonstrate
from robocasa_lerobot.demos.motion import OPEN, Array, HandTarget, base_pose, grip_position, hand_rotation
from robocasa_lerobot.demos.motion_style import MotionStyle
from robocasa_lerobot.demos.planning.base_path import carried
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.skills.common import draw_back, hold_hand
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.stages import HELD_STEPS, StageLog, StageOutcome, stage_from
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron.names import FINGER_JOINTS
from robocasa_lerobot.evaluation.actors.actor import Actor

LET_GO_STEPS, BACK_M = 8, 0.10  # of a hand that has been led anywhere, before it begins again
STRAY_M, STRAY_RAD = 0.12, 0.3  # of a base, from where the task begins
_OPEN_M = 0.03  # of a finger that is as good as open


class Takeover:
    """Who decided the steps of an episode, and the actions that it consists of.

    Args:
        policy: drives first.
        noise_seed: of the policy's sampling.
        after_steps: control steps after which the demonstrator takes over.

    Attributes:
        corrected: of each action so far, whether the demonstrator decided it.
    """

    def __init__(self, policy: Actor, noise_seed: int, after_steps: int) -> None:
        self._policy, self._noise_seed, self._after_steps = policy, noise_seed, after_steps
        self.corrected: list[bool] = []

    def act(self, env: KitchenEnv, style: MotionStyle, log: StageLog) -> Iterator[Array]:
        """Actions (12,), stored order, each computed from the state that the env is in when it is asked for.

        What the policy has achieved when its time is up, and keeps, is left to it: it goes on while the goal holds.

        Raises:
            UnknownNameError: a stage needs a skill that does not exist.
            SkillError: the demonstrator cannot make it good.
        """
        log.outcomes = [StageOutcome() for _ in env.declaration.stages]
        start = base_pose(env.data)
        self._policy.reset(self._noise_seed, env)
        held = 0
        while held < HELD_STEPS and (len(self.corrected) < self._after_steps or held):
            log.current = stage_from(env, log.current)
            wanted = self._policy_action(env)
            self.corrected.append(False)
            yield wanted
            held = held + 1 if env.declaration.goal.evaluate(env.scene, env.data, {}) else 0
        for wanted in self._correction(env, style, log, start):
            self.corrected.append(True)
            yield wanted

    def _policy_action(self, env: KitchenEnv) -> Array:
        env.render_observations = self._policy.sees(len(self.corrected))
        observation = env.observe()
        env.render_observations = False
        action = self._policy.act(observation, env.scene.instruction)
        return np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)

    @staticmethod
    def _correction(env: KitchenEnv, style: MotionStyle, log: StageLog, start: tuple[Array, float]) -> Iterator[Array]:
        """Let go of what is no object, draw back, and demonstrate the rest.

        A base that has been led away from where a task of one stage begins goes back there first: its skill may need
        it. Otherwise the hand begins again from where it is, as near to its goal as the policy has brought it.
        """
        if carried(env.scene, env.data) is None:
            here = HandTarget(grip_position(env.data), hand_rotation(env.data))
            shut = min(abs(float(env.data.joint(name).qpos[0])) for name in FINGER_JOINTS) < _OPEN_M
            yield from hold_hand(env.data, here, OPEN, LET_GO_STEPS if shut else 0)
            yield from draw_back(env.data, OPEN, BACK_M)
            (there, heading), (base, yaw) = start, base_pose(env.data)
            led_away = np.linalg.norm((base - there)[:2]) > STRAY_M or abs(wrap(yaw - heading)) > STRAY_RAD
            if led_away and len(env.declaration.stages) == 1:
                yield from fold_arm(env)
                with contextlib.suppress(SkillError):  # as near as it gets
                    yield from drive_to(env, float(there[0]), float(there[1]), heading)
        yield from demonstrate(env, style, log, midway=True)
