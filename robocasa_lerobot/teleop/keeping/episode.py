"""An episode while it is driven: what is recorded of each step, and the whole state before it, to go back to."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS, EpisodeBuffer, Recording, stage_rows
from robocasa_lerobot.demos.stages import StageLog, StageOutcome, stage_from
from robocasa_lerobot.envs.kitchen_env import KitchenEnv, Observation
from robocasa_lerobot.envs.robots.control_step import DivergedError

Array = NDArray[np.float64]
Info = dict[str, Any]


@dataclass(frozen=True)
class Origin:
    """Where an action comes from.

    Attributes:
        device: of the operator, "policy" or "".
        mode: of the steering, or "" for actions of others.
        assisted: whether it belongs to a planned motion.
        intervention: whether a person decided it while there was a policy.
        policy_action: (12,) stored order, what the policy wanted; None where it was not asked.
    """

    device: str = ""
    mode: str = ""
    assisted: bool = False
    intervention: bool = False
    policy_action: Array | None = None


class Episode:
    """What has been driven so far in the kitchen of a seed; `states[t]` is the whole state before step t.

    Args:
        env: made with `terminate_on_success=False`; it is reset to the seed.
        seed: of the kitchen.

    Attributes:
        observation, info: of the present state, or of the one that is shown.
        origins: of each step.
        marks: steps to go back to, the start first.
        undos, undone_steps: how often steps were dropped, and how many.
    """

    def __init__(self, env: KitchenEnv, seed: int) -> None:
        assert not env.terminate_on_success, "the operator decides when an episode ends"
        self.env, self.seed = env, seed
        self.observation, self.info = env.reset(seed=seed)
        self.states = [env.get_state()]
        self.origins: list[Origin] = []
        self.marks = [0]
        self.undos = self.undone_steps = 0
        self._buffer = EpisodeBuffer()
        self._held = [0]

    def __len__(self) -> int:
        return len(self._buffer)

    @property
    def held(self) -> int:
        """For how many steps the goal has held at the end."""
        return self._held[-1]

    @property
    def successful(self) -> bool:
        """Whether the goal has held for as long as an episode asks for."""
        return self.held >= SUCCESS_HOLD_STEPS

    def held_at(self, step: int) -> int:
        """For how many steps the goal had held before a step."""
        return self._held[step]

    @property
    def gripper_closed(self) -> bool:
        """Whether the last action told the gripper to close."""
        where = contract.ACTION_SLICES["gripper_close"]
        return bool(len(self)) and bool(self.actions()[-1][where][0] > 0)

    def actions(self) -> Array:
        """(T, 12) stored order, as carried out."""
        found = np.array(self._buffer.actions).reshape(-1, contract.ACTION_SIZE)
        return np.asarray(contract.hdf5_to_stored(found), dtype=np.float64)

    def step(self, action: Array, origin: Origin) -> None:
        """Carry out and note an action (12,), stored order, in single precision as a policy's is.

        Raises:
            DivergedError: the physics is lost; nothing is noted.
        """
        env = self.env
        wanted = np.clip(action, -1.0, 1.0).astype(np.float32)
        self._buffer.add(env, contract.binarize(wanted.astype(np.float64)), self.info, self._stage())
        try:
            self.observation, _, _, _, self.info = env.step(wanted)
        except Exception:
            self._buffer.drop_from(len(self.origins))
            raise
        self.origins.append(origin)
        self.states.append(env.get_state())
        self._held.append(self.held + 1 if self.info["success"] else 0)

    def show(self, step: int) -> Observation:
        """Put the env into the state before a step, or after the last; nothing is dropped."""
        self.observation, self.info = self.env.set_state(self.states[step])
        return self.observation

    def rewind_to(self, step: int) -> None:
        """Go back to the state before a step: that and all after it are dropped."""
        dropped = len(self) - step
        self.show(step)
        if dropped > 0:
            self.undos, self.undone_steps = self.undos + 1, self.undone_steps + dropped
        self._buffer.drop_from(step)
        del self.origins[step:], self.states[step + 1 :], self._held[step + 1 :]
        self.marks = [mark for mark in self.marks if mark <= step]

    def mark(self) -> None:
        """Mark the present step."""
        if len(self) not in self.marks:
            self.marks.append(len(self))

    def last_mark(self) -> int:
        """The last marked step before the present one, or the start."""
        return max((mark for mark in self.marks if mark < len(self)), default=0)

    def idle_head(self) -> int:
        """How many steps at the beginning tell nothing to move: base, torso and arm zero, gripper as at the start."""
        moving = np.ones(contract.ACTION_SIZE, dtype=bool)
        moving[contract.ACTION_SLICES["control_mode"]] = False
        start = np.zeros(contract.ACTION_SIZE)
        start[contract.ACTION_SLICES["gripper_close"]] = -1.0
        busy = (np.abs(self.actions() - start)[:, moving] > 0).any(axis=1)
        return int(busy.argmax()) if busy.any() else len(self)

    def without_head(self, steps: int) -> Episode:
        """The same actions carried out again from the start of the kitchen without the first ones; it may fail.

        Raises:
            DivergedError: the physics is lost on the way.
        """
        other = Episode(self.env, self.seed)
        for action, origin in zip(self.actions()[steps:], self.origins[steps:], strict=True):
            other.step(action, origin)
        other.undos, other.undone_steps = self.undos, self.undone_steps
        return other

    def confirmed(self) -> bool:
        """Whether the recorded actions, from the start of the kitchen, pass through the recorded states bit for bit.

        The env stands at the end of the episode afterwards.
        """
        env, same = self.env, True
        env.reset(seed=self.seed)
        for action, state in zip(self.actions(), self._buffer.states, strict=True):
            now = np.concatenate([[env.data.time], env.data.qpos, env.data.qvel])
            if not np.array_equal(now, state):
                same = False
                break
            try:
                env.step(action.astype(np.float32))
            except DivergedError:
                same = False
                break
        same = same and bool(np.array_equal(env.get_state().physics, self.states[-1].physics))
        self.show(len(self))
        return same

    def recording(self, ep_meta: dict[str, Any], *, with_policy: bool) -> Recording:
        """The episode as demonstrators' are kept, and of each step where it comes from."""
        log = StageLog(current=self._stage(), outcomes=[])
        driven = Counter(self._buffer.stages)
        for index in range(len(self.env.declaration.stages)):
            skipped = index < log.current and index not in driven
            log.outcomes.append(StageOutcome(int(index in driven), index < log.current, skipped))
        log.close(self.env)
        recording = self._buffer.recording(
            self.env,
            self.info,
            {"stages": stage_rows(self.env, log), **ep_meta},
            success=self.successful,
            reason="" if self.successful else f"the goal holds for {self.held} steps at the end",
        )
        recording.per_step[contract.ASSISTED] = np.array([[o.assisted] for o in self.origins], dtype=np.uint8)
        if with_policy:
            recording.per_step[contract.INTERVENTION] = np.array(
                [[o.intervention] for o in self.origins], dtype=np.uint8
            )
            # Where nobody asked the policy, its place has what was carried out: no number that is none.
            asked = [
                done if o.policy_action is None else contract.stored_to_hdf5(o.policy_action)
                for o, done in zip(self.origins, self._buffer.actions, strict=True)
            ]
            recording.per_step[contract.POLICY_ACTION] = np.array(asked)
        return recording

    def _stage(self) -> int:
        """The stage that the present step belongs to."""
        return stage_from(self.env, self._buffer.stages[-1] if self._buffer.stages else 0)
