"""One seeded trial of a policy in an env."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.film import Film
from robocasa_lerobot.evaluation.plan import TrialSpec
from robocasa_lerobot.evaluation.policy_runner import PolicyRunner
from robocasa_lerobot.evaluation.results import TermSummary

# Steps between two signs of life; at 20 to 100 steps/s on a CPU that is at most a second.
HEARTBEAT_STEPS = 20


@dataclass
class TermCount:
    """A success term while a trial runs."""

    first_step: int | None = None
    met: int = 0
    final: bool = False

    def note(self, step: int, met: bool) -> None:
        """Its value after a step, which counts from 1."""
        if met and self.first_step is None:
            self.first_step = step
        self.met += met
        self.final = met

    def summary(self, steps: int) -> TermSummary:
        """The term in short."""
        return TermSummary(self.first_step, round(self.met / max(1, steps), 6), self.final)


class RolloutError(RuntimeError):
    """The policy or the env did something that no trial can go on from."""


class DivergedError(RolloutError):
    """Numbers that are not finite, from the policy or the physics."""


@dataclass
class Outcome:
    """What a trial gave; `steps` are control steps at 20 Hz, the first step is number 1.

    `trajectory` is a SHA-256 over all actions and proprioception: two trials with the same one went the same way.
    """

    success: bool = False
    steps: int = 0
    first_success_step: int | None = None
    terms: dict[str, TermSummary] = field(default_factory=dict)
    instruction: str = ""
    layout_id: int | None = None
    style_id: int | None = None
    trajectory: str | None = None


def run_trial(
    env: gymnasium.Env[Any, Any],
    policy: PolicyRunner,
    spec: TrialSpec,
    film: Film | None = None,
    heartbeat: Callable[[int], None] = lambda step: None,
) -> Outcome:
    """Run one episode from `spec.seed` until the env ends it.

    Success is reached at any step. Pictures are rendered only for steps that the policy looks at.

    Raises:
        RolloutError: an action that is not finite, or an env that goes on past its horizon.
    """
    base: Any = env.unwrapped
    policy.reset(spec.policy_seed)
    always = film is not None and film.needs_observation(base)
    base.render_observations = always or policy.sees(0)
    observation, info = env.reset(seed=spec.seed)
    outcome = Outcome(
        instruction=str(info.get("instruction") or getattr(base, "task_description", "")),
        layout_id=info.get("scene", {}).get("layout_id"),
        style_id=info.get("scene", {}).get("style_id"),
    )
    limit = horizon_of(env, spec)
    if film is not None:
        film.shoot(base, observation, 0)
    digest = hashlib.sha256(np.asarray(observation["agent_pos"], dtype=np.float64).tobytes())
    ended = False
    counts: dict[str, TermCount] = {}
    while not ended:
        if outcome.steps >= limit:
            raise RolloutError(f"the env went on past its horizon of {limit} steps without truncating the episode")
        if outcome.steps % HEARTBEAT_STEPS == 0:
            heartbeat(outcome.steps)
        action = policy.act(observation, outcome.instruction)
        if not np.isfinite(action).all():
            raise DivergedError(f"the policy gave an action that is not finite at step {outcome.steps}: {action}")
        outcome.steps += 1
        base.render_observations = always or policy.sees(outcome.steps)
        observation, _, terminated, truncated, info = env.step(action)
        if film is not None:
            film.shoot(base, observation, outcome.steps)
        digest.update(np.asarray(action, dtype=np.float32).tobytes())
        digest.update(np.asarray(observation["agent_pos"], dtype=np.float64).tobytes())
        _note(outcome, info, counts)
        ended = bool(terminated or truncated)
    outcome.terms = {name: count.summary(outcome.steps) for name, count in counts.items()}
    outcome.trajectory = digest.hexdigest()
    return outcome


def horizon_of(env: gymnasium.Env[Any, Any], spec: TrialSpec) -> int:
    """Control steps after which an episode must have ended: the plan's, else the env's own.

    Raises:
        UserError: neither says.
    """
    base = env.unwrapped
    limit = spec.horizon or getattr(base, "horizon", None) or getattr(base, "_max_episode_steps", None)
    if limit is None:
        raise UserError(f"env of task {spec.task}: it has no attribute `horizon`; give --env.horizon.")
    return int(limit)


def _note(outcome: Outcome, info: dict[str, Any], counts: dict[str, TermCount]) -> None:
    if bool(info["is_success"]) and not outcome.success:
        outcome.success, outcome.first_success_step = True, outcome.steps
    for name, met in info.get("success_terms", {}).items():
        counts.setdefault(name, TermCount()).note(outcome.steps, bool(met))
