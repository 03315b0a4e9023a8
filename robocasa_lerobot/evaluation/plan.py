"""The trials of an evaluation, fixed before anything runs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.evaluation.results import UNPERTURBED, TrialKey

# Two streams, so that the scene and the policy's sampling noise are independent of each other.
_ENV_STREAM, _POLICY_STREAM = 0, 1


@dataclass(frozen=True)
class TrialSpec:
    """One planned trial: which policy, which task, and the seeds of the scene and of the policy's noise."""

    label: str
    task: str
    trial: int
    seed: int
    policy_seed: int
    horizon: int | None
    film: bool
    perturbation: str = UNPERTURBED

    @property
    def key(self) -> TrialKey:
        """What identifies the trial in a results file."""
        return (self.label, self.task, self.perturbation, self.trial)


def trial_seed(seed: int, task: str, trial: int, stream: int = _ENV_STREAM) -> int:
    """A seed in [0, 2^31) that depends on nothing but the evaluation's seed, the task's name and the trial's number.

    Not `seed + trial`: neighbouring evaluations (seed 0 and 1) would then share all trials but one. The same
    policy-independent seed for every policy makes comparisons paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest(), dtype="<u4").tolist()
    state = np.random.SeedSequence([seed, stream, trial, *words]).generate_state(1, dtype=np.uint32)
    return int(state[0] >> 1)


def make_plan(
    labels: Sequence[str],
    horizons: dict[str, int | None],
    trials: int,
    seed: int,
    videos: int,
) -> list[TrialSpec]:
    """All trials of an evaluation, policy by policy and task by task.

    Args:
        labels: names of the policies.
        horizons: steps at 20 Hz of each task; None leaves it to the env.
        trials: trials of each policy on each task.
        seed: the evaluation's seed.
        videos: how many trials of each policy on each task are filmed (the first ones).
    """
    return [
        TrialSpec(
            label=label,
            task=task,
            trial=trial,
            seed=trial_seed(seed, task, trial),
            policy_seed=trial_seed(seed, task, trial, _POLICY_STREAM),
            horizon=horizon,
            film=trial < videos,
        )
        for label in labels
        for task, horizon in horizons.items()
        for trial in range(trials)
    ]
