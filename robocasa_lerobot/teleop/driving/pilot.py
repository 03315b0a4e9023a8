"""A policy that drives where nobody intervenes (DAgger's autonomous and correcting turns)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchen_env import KitchenEnv, Observation

if TYPE_CHECKING:
    from robocasa_lerobot.evaluation.actors.actor import Actor

AUTONOMOUS, CORRECTING = "AUTONOMOUS", "CORRECTING"


class Pilot:
    """A policy and whose turn it is.

    Args:
        name: of the policy.
        actor: the policy.

    Attributes:
        state: `AUTONOMOUS` or `CORRECTING`.
        interventions: of the running episode.
    """

    def __init__(self, name: str, actor: Actor) -> None:
        self.name, self._actor = name, actor
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
        if not self._fresh:
            noise = np.random.SeedSequence([env.scene.seed, self._hand_backs]).generate_state(1)[0]
            self._actor.reset(int(noise), env)
            self._fresh, self._hand_backs = True, self._hand_backs + 1
        return np.asarray(self._actor.act(observation, instruction), dtype=np.float64)

    def describe(self, *, driving: bool) -> dict[str, Any]:
        """As it is told to clients."""
        state = self.state if driving else "PAUSED"
        return {"name": self.name, "state": state, "interventions": self.interventions}


def load_pilot(policy: str, device: str = "auto", image_size: int | None = None) -> tuple[Pilot, int]:
    """The policy at a path, a reference policy or an address that `eval` takes; and the pixels of its pictures.

    Raises:
        UserError: there is none, or it cannot be loaded.
    """
    from robocasa_lerobot.evaluation.actors.checkpoint import common_image_size, read_source
    from robocasa_lerobot.evaluation.actors.policy_runner import load_actor, pick_device

    source = read_source(policy)
    where = "cpu" if source.is_reference else pick_device(device)
    return Pilot(source.label, load_actor(source, where, None)), common_image_size([source], image_size)
