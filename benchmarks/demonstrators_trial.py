"""One attempt of a demonstrator, as the benchmark keeps it."""

from __future__ import annotations

from dataclasses import dataclass

# What came of a stage: which it is, how often it was tried, whether it was done in the end, and done at the start.
type Stage = tuple[str, int, bool, bool]
type Key = tuple[str, str, int, float, bool]  # task, split, seed, action noise, whether it is varied


@dataclass(frozen=True)
class Trial:
    """One attempt of a demonstrator.

    Attributes:
        task, split, seed, action_noise, varied: what was tried.
        success: whether the goal held at the end.
        steps: control steps of the episode.
        wall_s: seconds that it took, making the kitchen included.
        workers: processes that worked at the time.
        reason: why it failed.
        false_terms: terms of the goal that did not hold then.
        commit: of the checkout.
        sources: hash of the declaration and the skills that it depends on; "" of trials that do not say.
        stages: what came of each stage, in order; () of trials that do not say.
    """

    task: str
    split: str
    seed: int
    action_noise: float
    varied: bool
    success: bool
    steps: int
    wall_s: float
    workers: int
    reason: str
    false_terms: tuple[str, ...]
    commit: str
    sources: str = ""
    stages: tuple[Stage, ...] = ()

    @property
    def key(self) -> Key:
        """What makes it one trial."""
        return self.task, self.split, self.seed, self.action_noise, self.varied
