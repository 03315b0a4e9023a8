"""The trials of an evaluation, fixed before anything runs."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.records.results import UNPERTURBED, TrialKey

# Two streams, so that the scene and the policy's sampling noise are independent of each other.
_ENV_STREAM, _POLICY_STREAM = 0, 1


@dataclass(frozen=True)
class TrialSpec:
    """One planned trial: policy, task, perturbation, and the seeds of the scene and of the policy's noise.

    From `seed`, task, split and perturbation follow kitchen, objects, the robot's start and the instruction.
    """

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
    policy-independent seed for every policy and perturbation makes comparisons paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest(), dtype="<u4").tolist()
    state = np.random.SeedSequence([seed, stream, trial, *words]).generate_state(1, dtype=np.uint32)
    return int(state[0] >> 1)


def noise_seed(seed: int, task: str, trial: int) -> int:
    """The seed of the policy's sampling noise in a trial, independent of that of its scene."""
    return trial_seed(seed, task, trial, _POLICY_STREAM)


def make_plan(
    labels: Sequence[str] | Mapping[str, Sequence[str]],
    horizons: Mapping[str, int | None],
    trials: int,
    seed: int,
    videos: int,
    perturbations: Sequence[str] = (UNPERTURBED,),
    seeds: Mapping[str, Sequence[int]] | None = None,
) -> list[TrialSpec]:
    """All trials of an evaluation, policy by policy, task by task, perturbation by perturbation.

    Args:
        labels: names of the policies; a mapping gives each its own tasks, else all have those of `horizons`.
        horizons: steps at 20 Hz of each task; None leaves it to the env.
        trials: trials of each policy on each task under each perturbation.
        seed: the evaluation's seed.
        videos: how many trials of each policy on each task and perturbation are filmed (the first ones).
        perturbations: names, "none" for the plain env.
        seeds: of the scenes of each task's trials, where they are those of stored episodes.
    """
    tasks = labels if isinstance(labels, Mapping) else dict.fromkeys(labels, tuple(horizons))
    return [
        TrialSpec(
            label=label,
            task=task,
            trial=trial,
            seed=seeds[task][trial] if seeds else trial_seed(seed, task, trial),
            policy_seed=noise_seed(seed, task, trial),
            horizon=horizons[task],
            film=trial < videos,
            perturbation=perturbation,
        )
        for label, own in tasks.items()
        for task in own
        for perturbation in perturbations
        for trial in range(trials)
    ]


@dataclass(frozen=True)
class Shard:
    """Part `index` (from 1) of `count` parts of a plan."""

    index: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Shard:
        """The shard of a text such as "2/8".

        Raises:
            UserError: not of that form, or not 1 <= index <= count.
        """
        index, slash, count = text.partition("/")
        if not (slash and index.isdigit() and count.isdigit() and 1 <= int(index) <= int(count)):
            raise UserError(f"shard: found {text!r}, expected I/N with 1 <= I <= N, such as 1/4.")
        return cls(int(index), int(count))

    def of(self, plan: Sequence[TrialSpec]) -> list[TrialSpec]:
        """The shard's trials: each n-th one, so that every shard has a like share of every task."""
        return list(plan[self.index - 1 :: self.count])


def running_order(specs: Sequence[TrialSpec]) -> list[TrialSpec]:
    """The order in which trials are begun: policy by policy, long horizons first.

    A long trial that began last would keep one worker busy while the others have nothing left. Trials without a
    known horizon keep their places among each other, at the end.
    """
    position = {label: i for i, label in enumerate(dict.fromkeys(spec.label for spec in specs))}
    return sorted(specs, key=lambda spec: (position[spec.label], -(spec.horizon or 0)))


def to_film(spec: TrialSpec) -> TrialSpec:
    """The same trial, filmed."""
    return dataclasses.replace(spec, film=True)
