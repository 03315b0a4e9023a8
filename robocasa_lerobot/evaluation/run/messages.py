"""What workers, policy servers and the engine tell each other."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.evaluation.records.results import FINISHED
from robocasa_lerobot.evaluation.run.rollout import Outcome


@dataclass(frozen=True)
class Ready:
    """A process can be given work."""


@dataclass(frozen=True)
class Alive:
    """A sign of life; `step` of the trial, -1 while policy or env are being built, or outside of a trial.

    `loads` says that a policy is about to be loaded, during which there is none.
    """

    step: int = -1
    loads: bool = False


@dataclass(frozen=True)
class Finished:
    """A trial ended; `error` is the reason of one that did not finish, `kind` the record's outcome.

    `lost` says how the connection to a policy behind a socket ended: the trial is none, and is repeated.
    """

    outcome: Outcome
    video: str | None
    wall_seconds: float
    error: str | None
    kind: str = FINISHED
    lost: str | None = None


@dataclass(frozen=True)
class Refused:
    """A fault that no other trial will get around; the whole run ends with this message."""

    message: str


@dataclass(frozen=True)
class Describe:
    """A worker asks a policy server how often a policy looks."""

    label: str


@dataclass(frozen=True)
class Loading:
    """A policy server loads weights; no sign of life comes until it has."""


@dataclass(frozen=True)
class Failed:
    """A policy server's answer to a request whose computation raised."""

    traceback: str
