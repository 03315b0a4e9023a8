"""One seeded trial of a policy in an env."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.robots import control_step
from robocasa_lerobot.envs.tasks.stage_progress import StageProgress
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import Actor
from robocasa_lerobot.evaluation.planning.trials import TrialSpec
from robocasa_lerobot.evaluation.records.results import Seconds, StageSummary, TermSummary
from robocasa_lerobot.evaluation.run.film import Film
from robocasa_lerobot.evaluation.run.messages import Outcome
from robocasa_lerobot.evaluation.run.physics_warnings import PhysicsWarnings
from robocasa_lerobot.evaluation.run.success import SuccessRule

HEARTBEAT_S = 1.0  # between two signs of life; a policy may take long for each step


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


class DivergedError(RolloutError, control_step.DivergedError):
    """Numbers that are not finite, from the policy or the physics, found by the rollout and not by the env itself."""


def run_trial(
    env: gymnasium.Env[Any, Any],
    policy: Actor,
    spec: TrialSpec,
    film: Film | None = None,
    heartbeat: Callable[[int], None] = lambda step: None,
    rule: SuccessRule | None = None,
) -> Outcome:
    """Run one episode from `spec.seed` until it is decided or its horizon is reached.

    Pictures are rendered only for steps that the policy looks at.

    Raises:
        RolloutError: an env that goes on past its horizon.
        control_step.DivergedError: an action, proprioception or physics that is not finite.
    """
    base: Any = env.unwrapped
    started = time.perf_counter()
    always = film is not None and film.needs_observation(base)
    base.render_observations = always or policy.sees(0)
    rendered = getattr(base, "rendering_seconds", 0.0)
    observation, info = env.reset(seed=spec.seed)
    policy.reset(spec.policy_seed, base)
    building = time.perf_counter() - started - (getattr(base, "rendering_seconds", 0.0) - rendered)
    scene = info.get("scene", {})
    outcome = Outcome(
        instruction=str(info.get("instruction") or getattr(base, "task_description", "")),
        layout_id=scene.get("layout_id"),
        style_id=scene.get("style_id"),
        fps=None if (fps := getattr(base, "fps", None)) is None else float(fps),
    )
    limit = horizon_of(env, spec)
    decided = rule or SuccessRule()
    warnings = PhysicsWarnings(base)
    physics = filming = 0.0
    if film is not None:
        shooting = time.perf_counter()
        film.shoot(base, observation, 0)
        filming += time.perf_counter() - shooting
    digest = hashlib.sha256(proprioception(observation).tobytes())
    counts: dict[str, TermCount] = {}
    progress = StageProgress(base.declaration, base.scene, base.data) if hasattr(base, "declaration") else None
    ended, told = False, -math.inf
    while not ended:
        if outcome.steps >= limit:
            raise RolloutError(f"the env went on past its horizon of {limit} steps without truncating the episode")
        now = time.monotonic()
        if now - told > HEARTBEAT_S:
            heartbeat(outcome.steps)
            told = now
        action = policy.act(observation, outcome.instruction)
        if not np.isfinite(action).all():
            raise DivergedError(f"the policy gave an action that is not finite at step {outcome.steps}: {action}")
        outcome.steps += 1
        base.render_observations = always or policy.sees(outcome.steps)
        stepping = time.perf_counter()
        observation, _, terminated, truncated, info = env.step(action)
        physics += time.perf_counter() - stepping
        if film is not None:
            shooting = time.perf_counter()
            film.shoot(base, observation, outcome.steps)
            filming += time.perf_counter() - shooting
        digest.update(np.asarray(action, dtype=np.float32).tobytes())
        digest.update(proprioception(observation).tobytes())
        _check_finite(observation, outcome.steps, warnings)
        for name, met in info.get("success_terms", {}).items():
            counts.setdefault(name, TermCount()).note(outcome.steps, bool(met))
        if progress is not None:
            progress.note(base.data, success=bool(info["is_success"]))
        done = decided.note(outcome.steps, bool(info["is_success"]))
        ended = bool(terminated or truncated or done)
    outcome.first_success_step = decided.success_step()
    outcome.success = outcome.first_success_step is not None
    outcome.terms = {name: count.summary(outcome.steps) for name, count in counts.items()}
    if progress is not None:
        outcome.stages = StageSummary(progress.total, progress.met, progress.given, progress.next_text)
    outcome.warnings = warnings.counts()
    outcome.trajectory = digest.hexdigest()
    pictures = getattr(base, "rendering_seconds", 0.0) - rendered
    outcome.seconds = Seconds(
        total=time.perf_counter() - started,
        policy=policy.time.policy,
        physics=max(0.0, physics - pictures),
        rendering=pictures + filming,
        building=building,
        waiting=policy.time.waiting,
    )
    return outcome


def _check_finite(observation: dict[str, Any], step: int, warnings: PhysicsWarnings) -> None:
    numbers = proprioception(observation)
    if not np.isfinite(numbers).all():
        raise DivergedError(f"proprioception is not finite after step {step}: {numbers}")
    bad = warnings.divergence()
    if bad is not None:
        raise DivergedError(f"the physics diverged at step {step}: MuJoCo warned of {bad}")


def proprioception(observation: dict[str, Any]) -> NDArray[np.float64]:
    """All numbers of an observation beside its pictures, in one vector, by the order of their names."""
    found: list[NDArray[np.float64]] = []
    for name in sorted(observation):
        value = observation[name]
        if isinstance(value, dict):
            found += [] if name == "pixels" else [proprioception(value)]
        elif name != "pixels":
            found.append(np.asarray(value, dtype=np.float64).ravel())
    return np.concatenate(found) if found else np.zeros(0)


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
