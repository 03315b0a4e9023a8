"""The schema of `trials.jsonl`, for writing and reading: lines of run headers and of trial records.

A header says what holds for a whole run: protocol, settings, policies, software, machine. It is written once before
the run's first trial and named by a hash of its content. A trial's line says what happened in that trial and names the
header that it belongs to, so that the lines of several shards may stand in one file in any order.

    results = read_results(Path("outputs/evaluations/a"))
    for record in results.trials:
        results.header_of(record).split, results.policy_of(record).fingerprint, record.success
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.records.schema import OPTIONAL, SchemaError, build

TRIALS_FILE = "trials.jsonl"
SHARDS_FOLDER = "shards"
SCHEMA_VERSION = 4
READABLE_VERSIONS = (3, 4)  # trials of 3 do not say how far they came in their stages
# What kind of end a trial had. Only `finished` trials ran to success or horizon; the others carry an error.
FINISHED, CRASHED, HUNG, DIVERGED = "finished", "crashed", "hung", "diverged"
OUTCOMES = (FINISHED, CRASHED, HUNG, DIVERGED)
UNPERTURBED = "none"
REFERENCE_POLICIES = ("demonstrator", "random", "zero")  # by their types
REPLAY = "replay"  # written replay:FILE
REFERENCE_TYPES = (*REFERENCE_POLICIES, REPLAY)

# Stands for the "/" of a label in names of folders and files.
_SLASH = "__"

# What names a trial in a results file: policy label, task, perturbation, number of the trial.
TrialKey = tuple[str, str, str, int]


class ResultsError(UserError):
    """A results file that this version cannot read, or that belongs to other settings."""


@dataclass(frozen=True)
class TermSummary:
    """A success term over the steps of a trial, in short.

    `first_step` is the first control step (from 1) after which it was true, None if it never was; `share` is the
    share of steps after which it was true; `final` its value after the last step.
    """

    first_step: int | None
    share: float
    final: bool


@dataclass(frozen=True)
class StageSummary:
    """How far a trial came in its task's stages, in order.

    `total` is how many the episode had, `met` those whose conditions were met in order (all of them with the goal),
    `given` those of them that held before the first step; `next` is the first one that was not met, in words.
    """

    total: int
    met: int
    given: int
    next: str | None

    @property
    def progress(self) -> float:
        """Share of the stages that were left to do at the start and were met, 0 to 1."""
        return 1.0 if self.met == self.total else (self.met - self.given) / (self.total - self.given)


@dataclass(frozen=True)
class Seconds:
    """Where a trial's wall time went, seconds: it is `total` that includes all others.

    `policy`: preprocessing and inference of its observations (its share of the batches it was in); `physics`:
    stepping the simulation and evaluating the goal; `rendering`: pictures for the policy and for films; `building`:
    making the scene; `waiting`: for the policy's answer beyond its computing, that is for the batch and for others.
    """

    total: float
    policy: float = 0.0
    physics: float = 0.0
    rendering: float = 0.0
    building: float = 0.0
    waiting: float = 0.0


@dataclass(frozen=True)
class PolicyInfo:
    """A policy that a run evaluated.

    `type` is LeRobot's name, or that of a reference policy (`demonstrator`, `random`, `zero`, `replay`), whose `path`
    it is too. `fingerprint` is a SHA-256 over weights, config and processors. `experiment`, `phase` and `step` are what
    the checkpoint says about its training, None where it says nothing. `lifelong_phase` (from 1), `demo_fraction` (of
    the target demonstrations, 0 to 1) and `training_data` ("target only", ...) are labels that the user gave for the
    report. `remote` is there for a policy behind a socket: its address, key map, what the server said, and that nobody
    knows its weights; the fingerprint is then of key map and metadata alone, marked `unknown:`.
    """

    label: str
    path: str
    type: str
    fingerprint: str
    phase: str | None = None
    step: int | None = None
    lifelong_phase: int | None = None
    demo_fraction: float | None = None
    training_data: str | None = None
    weights_version: str | None = None  # of LeRobot, where the checkpoint says it
    experiment: str | None = None
    # Left out of the line where there is none, so that files without it stay readable.
    remote: dict[str, Any] | None = field(default=None, metadata=OPTIONAL)

    @property
    def is_checkpoint(self) -> bool:
        """Whether the run itself computed it, and so its device, and versions of torch, may change what it does."""
        return self.type not in REFERENCE_TYPES and self.remote is None


@dataclass(frozen=True)
class RunHeader:
    """What holds for all trials of a run.

    Args:
        protocol: name of the protocol (`leaderboard`, `paper`, `foundation`, ...), "custom" for settings of one's own.
        task_sets: each task set of the protocol with those of its tasks that the run plans; {} where tasks were named.
        tasks: all planned tasks.
        missing_tasks: tasks that the protocol names and that are not run, mostly because this version does not have
            them: with any, the run is partial.
        trials: trials of each policy on each task under each perturbation.
        seed: the evaluation's seed, from which all others follow.
        split: "target" or "pretrain" scenes.
        render_preset: "fast" or "quality".
        image_size: height and width of the pictures, pixels.
        horizon_rule: "task" (each task's own), "fixed", or "env" (left to an env of the user's own).
        horizon_multiplier: factor on the task's own horizon.
        horizon_version: release of RoboCasa whose horizons are the tasks' own; None with other rules.
        success_rule: "any_step", "hold" (for `success_hold_steps` in a row), or "at_end".
        success_hold_steps: control steps for which the goal must hold.
        executed_steps: actions executed of each predicted chunk; None: the policy's own.
        perturbations: each planned perturbation with its parameters (standard deviations with units in their names).
        settings: all settings that a trial's outcome depends on; runs with different ones are never mixed.
        policies: by label.
        versions: of package, Python, MuJoCo, LeRobot, torch and others.
        git_commit: of the package's checkout, "-dirty" appended when files differ; None outside of one.
        device: what the policy computed on.
        machine: processor, cores, GPU, system.
        started: UTC, ISO 8601.
        registry: file whose task sets these are; None: the benchmark's.
        missing_by_set: for each task set that is not run as a whole, its tasks that are not run.
    """

    protocol: str
    task_sets: dict[str, list[str]]
    tasks: list[str]
    missing_tasks: list[str]
    trials: int
    seed: int
    split: str
    render_preset: str
    image_size: int
    horizon_rule: str
    horizon_multiplier: float
    success_rule: str
    success_hold_steps: int
    executed_steps: int | None
    perturbations: dict[str, dict[str, Any]]
    settings: dict[str, Any]
    policies: dict[str, PolicyInfo]
    versions: dict[str, str]
    git_commit: str | None
    device: str
    machine: dict[str, str]
    started: str
    horizon_version: str | None = None
    registry: str | None = None
    missing_by_set: dict[str, list[str]] = field(default_factory=dict)
    schema: int = field(default=SCHEMA_VERSION)

    @cached_property
    def id(self) -> str:
        """The first 16 hexadecimal digits of a SHA-256 over everything but the time of the start."""
        values = {name: value for name, value in self._values().items() if name != "started"}
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def has_checkpoints(self) -> bool:
        """Whether the run computed any policy."""
        return any(policy.is_checkpoint for policy in self.policies.values())

    def to_line(self) -> str:
        """The JSON line of this header, without its newline."""
        return _dump({"kind": "run", "id": self.id, **self._values()})

    def _values(self) -> dict[str, Any]:
        values = dataclasses.asdict(self)
        for policy in values["policies"].values():
            if policy["remote"] is None:
                del policy["remote"]
        return values


@dataclass(frozen=True)
class TrialRecord:
    """What happened in one trial.

    Steps are control steps, in our kitchens at 20 Hz; the first one is number 1.

    Args:
        run: id of the header.
        label, task, perturbation, trial: what names the trial; `perturbation` is "none" where there is none.
        seed: of the scene; the same for every policy and perturbation.
        policy_seed: of the policy's sampling noise.
        split: "target" or "pretrain".
        layout_id, style_id: of the kitchen; None where the trial never got one, or the env has none.
        instruction: what the policy was told.
        horizon: steps after which the trial ended at the latest; None where that was left to an env of one's own.
        horizon_multiplier: what the task's own horizon was multiplied by.
        success: by the run's success rule.
        first_success_step: the first step after which the goal held (with rule "hold": had held long enough).
        steps: steps run.
        terms: the goal's predicates, in short.
        stages: how far it came in the task's stages; None for an env without stages, and for a trial that broke.
        outcome: one of `OUTCOMES`.
        error: of a trial that did not finish: what happened, in its second attempt.
        attempts: 1, or more if it was tried again.
        first_outcome, first_error: those of the first attempt, where there was a second one.
        warnings: MuJoCo's warnings during the trial, with their counts.
        trajectory: SHA-256 over all actions and proprioception; equal for trials that took the same course.
        video: path relative to the results folder.
        seconds: wall time.
        finished: UTC, ISO 8601.
        fps: control steps a second of another simulator; None where it does not say, and in our kitchens.
    """

    run: str
    label: str
    task: str
    perturbation: str
    trial: int
    seed: int
    policy_seed: int
    split: str
    layout_id: int | None
    style_id: int | None
    instruction: str
    horizon: int | None
    horizon_multiplier: float
    success: bool
    first_success_step: int | None
    steps: int
    terms: dict[str, TermSummary]
    stages: StageSummary | None
    outcome: str
    error: str | None
    attempts: int
    first_outcome: str | None
    first_error: str | None
    warnings: dict[str, int]
    trajectory: str | None
    video: str | None
    seconds: Seconds
    finished: str
    # Left out of the line where there is none, as results of earlier versions have none either.
    fps: float | None = field(default=None, metadata=OPTIONAL)
    schema: int = field(default=SCHEMA_VERSION)

    @property
    def key(self) -> TrialKey:
        """What names the trial in a results file."""
        return (self.label, self.task, self.perturbation, self.trial)

    def comparable(self) -> dict[str, Any]:
        """The record without what may differ between two runs of one plan: times, machine, retries and films.

        And without `fps`, which decides nothing and older records do not have.
        """
        values = dataclasses.asdict(self)
        for name in ("run", "seconds", "finished", "video", "attempts", "first_outcome", "first_error", "fps"):
            del values[name]
        return values

    def to_line(self) -> str:
        """The JSON line of this record, without its newline."""
        values = dataclasses.asdict(self)
        if self.fps is None:
            del values["fps"]
        return _dump({"kind": "trial", **values})


@dataclass(frozen=True)
class Results:
    """What a results file holds: headers by their ids, and trials, of which the last line for each key counts.

    Headers are in the order of their last lines: a run of settings that were there before makes them the last ones.
    """

    path: Path
    headers: dict[str, RunHeader]
    trials: list[TrialRecord]

    def header_of(self, record: TrialRecord) -> RunHeader:
        """The header of a record's run."""
        return self.headers[record.run]

    def policy_of(self, record: TrialRecord) -> PolicyInfo:
        """The policy of a record."""
        return self.headers[record.run].policies[record.label]


def read_results(path: Path) -> Results:
    """The results in a folder, or in a `trials.jsonl`.

    A last line without its newline is a write that was cut off by a kill: it is left out.

    Raises:
        ResultsError: the file is missing, or a complete line is neither a header nor a record of this version.
    """
    file = path / TRIALS_FILE if path.is_dir() else path
    if not file.is_file():
        shards = " Its shards are not joined yet: `robocasa-lerobot eval ... --merge`, with their other settings."
        there = any(file.parent.glob(f"{SHARDS_FOLDER}/*-of-*"))
        raise ResultsError(f"{file}: no such file; expected the {TRIALS_FILE} of an evaluation.{shards * there}")
    headers: dict[str, RunHeader] = {}
    records: dict[TrialKey, TrialRecord] = {}
    for number, line in enumerate(file.read_bytes().split(b"\n")[:-1], start=1):
        if line.strip():
            item = parse_line(line.decode("utf-8", errors="replace"), f"{file}:{number}")
            if isinstance(item, RunHeader):
                headers.pop(item.id, None)
                headers[item.id] = item
                continue
            if item.run not in headers:
                raise ResultsError(f"{file}:{number}: its run {item.run!r} has no header above it.")
            if item.label not in headers[item.run].policies:
                raise ResultsError(f"{file}:{number}: policy {item.label!r} is not in the header of its run.")
            records[item.key] = item
    return Results(file, headers, list(records.values()))


def parse_line(line: str, where: str) -> RunHeader | TrialRecord:
    """The header or record of a JSON line; `where` names file and line number for errors.

    Raises:
        ResultsError: not JSON, another schema version, or a missing, unknown or wrongly typed key.
    """
    try:
        values = json.loads(line)
    except json.JSONDecodeError as error:
        remedy = "Remove the line, or restore the file."
        if where.endswith(":1"):  # where the header is
            remedy = f"Is it a run's folder, or its {TRIALS_FILE}?"
        raise ResultsError(f"{where}: not a JSON object ({error}). {remedy}") from error
    if not isinstance(values, dict):
        raise ResultsError(f"{where}: found {type(values).__name__}, expected a JSON object.")
    if (found := values.get("schema")) not in READABLE_VERSIONS:
        readable = " and ".join(map(str, READABLE_VERSIONS))
        raise ResultsError(f"{where}: schema {found!r}, this version reads {readable}; evaluate again.")
    kind = values.pop("kind", None)
    if kind == "trial" and found == 3:
        values.setdefault("stages", None)
    try:
        if kind == "trial":
            record = build(TrialRecord, values)
            if record.outcome not in OUTCOMES:
                raise SchemaError(f"outcome {record.outcome!r}, expected one of {', '.join(OUTCOMES)}")
            if record.success is not (record.first_success_step is not None):
                raise SchemaError("success and first_success_step contradict each other")
            if (record.error is None) is not (record.outcome == FINISHED):
                raise SchemaError(f"outcome {record.outcome!r} with error {record.error!r}")
            return record
        if kind == "run":
            name = values.pop("id", None)
            header = build(RunHeader, values)
            if header.id != name:
                raise SchemaError(f"the id is {name!r}, but that of its content {header.id!r}: it was edited")
            return header
    except SchemaError as error:
        raise ResultsError(f"{where}: {error}.") from error
    raise ResultsError(f"{where}: kind {kind!r}, expected 'run' or 'trial'.")


def file_name(label: str) -> str:
    """A policy's label as the name of a folder or file: `demo/finetune-000400` is `demo__finetune-000400`."""
    return label.replace("/", _SLASH)


def _dump(values: dict[str, Any]) -> str:
    return json.dumps(values, ensure_ascii=False, allow_nan=False)
