"""A policy that drives where nobody intervenes (DAgger's autonomous and correcting turns)."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchen_env import KitchenEnv, Observation
from robocasa_lerobot.errors import UserError

if TYPE_CHECKING:
    from robocasa_lerobot.evaluation.actors.actor import Actor

AUTONOMOUS, CORRECTING = "AUTONOMOUS", "CORRECTING"


class PolicyFailedError(Exception):
    """The policy gave no action; the text says why."""


class Pilot:
    """A policy and whose turn it is.

    Args:
        name: of the policy.
        make: the policy; it is made again after a failure, over a new connection where it is behind a socket.

    Attributes:
        state: `AUTONOMOUS` or `CORRECTING`.
        interventions: of the running episode.
    """

    def __init__(self, name: str, make: Callable[[], Actor]) -> None:
        self.name, self._make = name, make
        self._actor: Actor | None = make()
        self.begin()

    def begin(self) -> None:
        """A new episode, the policy's turn first."""
        self.state, self.interventions, self._hand_backs, self._fresh = AUTONOMOUS, 0, 0, False

    def forget(self) -> None:
        """Have the policy begin anew at its next action: what it has seen is not what comes next."""
        self._fresh = False

    def take_over(self) -> bool:
        """A person drives from now on; whether that is news."""
        news = self.state == AUTONOMOUS
        if news:
            self.state, self.interventions = CORRECTING, self.interventions + 1
        return news

    def give_back(self) -> None:
        """The policy drives from now on, with a fresh history."""
        self.state = AUTONOMOUS
        self.forget()

    def act(self, env: KitchenEnv, observation: Observation, instruction: str) -> NDArray[np.float64]:
        """The policy's action (12,), stored order; its noise follows from the kitchen's seed and how often it began."""
        if self._actor is None:
            self._actor, self._fresh = self._make(), False
        if not self._fresh:
            noise = np.random.SeedSequence([env.scene.seed, self._hand_backs]).generate_state(1)[0]
            self._actor.reset(int(noise), env)
            self._fresh, self._hand_backs = True, self._hand_backs + 1
        action = np.asarray(self._actor.act(observation, instruction), dtype=np.float64)
        if not np.isfinite(action).all():
            raise UserError(f"its action holds numbers that are not finite: {action}.")
        return action

    def lost(self) -> None:
        """It has failed: a person drives, and the policy is made again when it is given back to."""
        actor, self._actor = self._actor, None
        close = getattr(actor, "close", None)  # of one behind a socket, which has few places
        if close is not None:
            with contextlib.suppress(Exception):
                close()
        self.take_over()

    def describe(self, *, driving: bool) -> dict[str, Any]:
        """As it is told to clients."""
        state = self.state if driving else "PAUSED"
        return {"name": self.name, "state": state, "interventions": self.interventions}


def load_pilot(policy: str, task: str, device: str = "auto", keys: str = "") -> tuple[Pilot, int]:
    """The policy at a path, a reference policy or an address, as `eval` takes them; and the pixels of its pictures.

    Args:
        policy: what `eval --policy=` takes.
        task: that it drives.
        device: that a checkpoint computes on.
        keys: key map of a policy behind a socket, or "" for its protocol's own.

    Raises:
        UserError: there is none, or it cannot be loaded or reached.
    """
    from robocasa_lerobot.evaluation.actors.policy_runner import load_actor, pick_device
    from robocasa_lerobot.evaluation.config.evaluation import EnvSettings, EvaluationConfig, PolicySettings
    from robocasa_lerobot.evaluation.planning.sources import open_sources
    from robocasa_lerobot.evaluation.remote.failures import RemoteError

    asked = PolicySettings(path=[policy], keys=[keys] if keys else [])
    (source,), size = open_sources(EvaluationConfig(policy=asked, env=EnvSettings(tasks=[task])))
    where = pick_device(device) if source.is_checkpoint else "cpu"
    try:
        return Pilot(source.label, lambda: load_actor(source, where, None)), size
    except RemoteError as error:  # it answered a moment ago
        raise UserError(f"{error}. Start the server, then give the same command again.") from error
