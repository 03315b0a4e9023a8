"""Who drives: actions as they came, what is held, a planned motion, a policy, or nobody; asked once a control step."""

from __future__ import annotations

import collections
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv, Observation
from robocasa_lerobot.errors import OF_THE_MACHINE
from robocasa_lerobot.teleop.driving.pilot import AUTONOMOUS, Pilot, PolicyFailedError
from robocasa_lerobot.teleop.driving.steering import NOTHING, Held, Steering
from robocasa_lerobot.teleop.keeping.episode import Origin
from robocasa_lerobot.teleop.messages import Message
from robocasa_lerobot.teleop.settings import EXPIRES_S

MOST_WAITING = 64  # actions


@dataclass
class Assistance:
    """A planned motion: of a kind, with the number of its steps so far; `told` once clients know that it is planned."""

    kind: str
    actions: Iterator[Array]
    steps: int = 0
    told: bool = False


@dataclass
class Driver:
    """What an operator has told, and what follows from it.

    Attributes:
        steering: how deflections are meant.
        pilot: the policy that drives where nobody intervenes, if there is one.
        device: of the last input.
        by_steps: time goes on only where an action waits.
        answered: number of the picture that the last command answers, until it has been carried out.
        assistance: the planned motion that runs.
    """

    steering: Steering = field(default_factory=Steering)
    pilot: Pilot | None = None
    device: str = ""
    by_steps: bool = False
    answered: int | None = None
    assistance: Assistance | None = None
    _held: Held = NOTHING
    _until: float = 0.0
    _waiting: collections.deque[Array] = field(default_factory=collections.deque)

    def hold(self, message: Message, now: float) -> bool:
        """Take an `input`; whether it asks for anything: a move, or the gripper."""
        held = Held.of(message)
        closed = {"open": False, "closed": True}.get(message.get("gripper", ""), self.steering.closed)
        asks = held.moves or closed != self.steering.closed
        self.steering.closed = closed
        self._held, self._until = held, now + EXPIRES_S
        self.device = message.get("device", self.device)
        if asks:
            self.answered = message["frame"]
            self._take_over()
        return asks

    def queue(self, message: Message) -> bool:
        """Take an `action`; False where too many wait."""
        if len(self._waiting) >= MOST_WAITING:
            return False
        action = np.array(message["action"])
        self.steering.closed = _closes(action)
        self._waiting.append(action)
        self.device = self.device or "script"
        self.answered = message["frame"]
        self._take_over()
        return True

    @property
    def waiting(self) -> int:
        """How many actions wait."""
        return len(self._waiting)

    def release(self) -> None:
        """Let go of everything, planned motions and waiting actions too."""
        self._held, self.assistance = NOTHING, None
        self._waiting.clear()

    def begin(self, *, closed: bool = False) -> None:
        """From another state on, with the gripper told to be closed or open there."""
        self.release()
        self.steering.closed = closed
        if self.pilot is not None:
            self.pilot.forget()

    def assist(self, kind: str, actions: Iterator[Array]) -> None:
        """Begin a planned motion."""
        self.release()
        self._take_over()
        self.assistance = Assistance(kind, actions)

    def next(
        self, env: KitchenEnv, observation: Observation, now: float, tell: Callable[[str, str], None]
    ) -> tuple[Array, Origin] | None:
        """The action (12,) of this step, stored order, and where it comes from; None where time stands.

        Args:
            env: in the present state.
            observation: of it.
            now: seconds.
            tell: takes a level and a line about what went wrong or ended.

        Raises:
            PolicyFailedError: it was the policy's turn, and it gave no action.
        """
        correcting = self.pilot is not None and self.pilot.state != AUTONOMOUS
        if self._waiting:
            return self._waiting.popleft(), Origin(self.device, "", intervention=correcting)
        if self.by_steps:
            return None
        held = self._held if now < self._until else NOTHING
        if held.moves:
            return self._steered(env, held, correcting)
        if self.assistance is not None:
            action = self._assisted(tell)
            if action is not None:
                return action, Origin(self.device, "", assisted=True, intervention=correcting)
        if self.pilot is not None and self.pilot.state == AUTONOMOUS:
            try:
                action = self.pilot.act(env, observation, env.scene.instruction)
            except Exception as error:  # whatever it is, of a network or of a socket
                raise PolicyFailedError(str(error)) from error
            self.steering.closed = _closes(action)  # who takes over keeps hold of what the policy holds
            return action, Origin("policy", "", policy_action=np.clip(action, -1.0, 1.0))
        return self._steered(env, NOTHING, correcting)

    def _steered(self, env: KitchenEnv, held: Held, correcting: bool) -> tuple[Array, Origin]:
        action = self.steering.action(env.model, env.data, env.robot.names, held)
        return action, Origin(self.device, self.steering.mode, intervention=correcting)

    def _assisted(self, tell: Callable[[str, str], None]) -> Array | None:
        """The next action of the planned motion; None where it has ended."""
        running = self.assistance
        assert running is not None
        try:
            action = next(running.actions)
        except StopIteration:
            self.assistance = None
            return None
        except SkillError as error:
            self.assistance = None
            tell("warning", str(error))
            return None
        except OF_THE_MACHINE:
            raise
        except Exception as error:  # a click that cannot be planned loses nobody an episode
            self.assistance = None
            tell("error", f"the planned motion failed ({type(error).__name__}: {error}): drive on by hand")
            return None
        running.steps += 1
        return np.clip(action, -1.0, 1.0)

    def _take_over(self) -> None:
        self.assistance = None
        if self.pilot is not None:
            self.pilot.take_over()


def _closes(action: Array) -> bool:
    """Whether an action (12,), stored order, tells the gripper to close."""
    return bool(action[contract.ACTION_SLICES["gripper_close"]][0] >= contract.BINARY_THRESHOLD)
