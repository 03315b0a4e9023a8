"""One attempt of a demonstrator, as the benchmark keeps it."""

from __future__ import annotations

from dataclasses import dataclass

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

    @property
    def key(self) -> Key:
        """What makes it one trial."""
        return self.task, self.split, self.seed, self.action_noise, self.varied
