"""What workers, policy servers and the engine tell each other, their settings to begin with.

The engine imports what is in here and not the processes' own modules, which bring MuJoCo and numba: it needs neither.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.records.results import FINISHED, Seconds, StageSummary, TermSummary


@dataclass(frozen=True)
class WorkerSettings:
    """What a worker needs beside the trials themselves; picklable.

    `perturbations` are the arguments that each of them adds to the env's, `served` the labels of policies that a
    policy server computes.
    """

    sources: dict[str, PolicySource]
    factory: str
    env_kwargs: dict[str, Any]
    device: str
    threads: int
    executed_steps: int | None
    out: str
    render_devices: tuple[int, ...] = ()
    perturbations: dict[str, dict[str, Any]] = field(default_factory=dict)
    success_rule: str = "any_step"
    success_hold_steps: int = 1
    width: int = 1
    runtime: str = "onnx"
    served: frozenset[str] = frozenset()


@dataclass(frozen=True)
class ServerSettings:
    """What a policy server needs; picklable. `address` is the path of its socket."""

    sources: dict[str, PolicySource]
    device: str
    threads: int
    width: int
    executed_steps: int | None
    runtime: str
    address: str


@dataclass
class Outcome:
    """What a trial gave; `steps` are control steps, the first step is number 1.

    `fps` is how many of them are a second, where the env has an attribute that says it: our kitchens' are 20.
    `stages` is how far it came in the task's stages, None for an env that has none.
    `trajectory` is a SHA-256 over all actions and proprioception: two trials with the same one took the same course.
    """

    success: bool = False
    steps: int = 0
    first_success_step: int | None = None
    terms: dict[str, TermSummary] = field(default_factory=dict)
    stages: StageSummary | None = None
    instruction: str = ""
    layout_id: int | None = None
    style_id: int | None = None
    trajectory: str | None = None
    fps: float | None = None
    warnings: dict[str, int] = field(default_factory=dict)
    seconds: Seconds = field(default=Seconds(0.0), compare=False)


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
