"""The evaluations of finished phases, each in a process of its own: training knows nothing of simulators.

They are planned before the first step (`plan_evaluations`): a mistake in one stops the run there and not after days,
and what this version cannot simulate yet is left out with a line in `skipped.jsonl`.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot.config_files import find_config
from robocasa_lerobot.data.mixture_config import ROBOCASA365
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.parent import END_WITH_INPUT
from robocasa_lerobot.settings import load_yaml, parse_overrides
from robocasa_lerobot.training.config.experiment import ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.planning import skipped
from robocasa_lerobot.training.planning.skipped import EVALUATION, PARTIAL, Skipped
from robocasa_lerobot.training.weights.checkpoint import LAST, PRETRAINED, last_checkpoint

FOLDER, FINISHED = "evaluations", "finished"
_LAUNCHER = ("RANK", "LOCAL_RANK", "WORLD_SIZE", "MASTER_ADDR", "MASTER_PORT", "ACCELERATE_", "TORCHELASTIC_")
_POLL_SECONDS = 0.5
_END_SECONDS = 30.0


@dataclass(frozen=True)
class PhaseEvaluation:
    """An evaluation file, and settings that a phase changes in it, as on the command line."""

    file: Path
    settings: tuple[str, ...]

    @property
    def name(self) -> str:
        """What it is called, and its folder."""
        return self.file.stem


@dataclass(frozen=True)
class PlannedEvaluation:
    """An evaluation of a phase, and what its command says of it beforehand.

    Attributes:
        phase: the phase's name.
        evaluation: file and settings.
        arguments: of `robocasa-lerobot eval`.
        nothing: why it is left out; None if it runs.
        partial: what it leaves out; None if nothing.
        tasks: that it runs.
        trials: on all of them.
        steps: control steps of all trials, if none is solved before its horizon; 0 where the env decides.
        plan: a name of the planned run, the same as long as its tasks, their horizons and its settings are.
    """

    phase: str
    evaluation: PhaseEvaluation
    arguments: tuple[str, ...]
    nothing: str | None
    partial: str | None
    tasks: int
    trials: int
    steps: int
    plan: str

    @property
    def skipped(self) -> Skipped | None:
        """The line about its left-out part; None where it runs as a whole."""
        if self.nothing is not None:
            return Skipped(EVALUATION, self.phase, self.evaluation.name, self.nothing)
        return None if self.partial is None else Skipped(PARTIAL, self.phase, self.evaluation.name, self.partial)


def phase_evaluations(phase: PhaseConfig) -> list[PhaseEvaluation]:
    """The phase's evaluations: paths, or names of files in `configs/evaluations/`, each with its settings.

    Raises:
        UserError: a file is not there or is named twice, or a quotation does not end.
    """
    found: list[PhaseEvaluation] = []
    for text in phase.evaluations:
        try:
            name, *settings = shlex.split(text)
        except ValueError as error:
            raise UserError(
                f"phase {phase.name!r}: evaluation {text!r} ({error}); expected `NAME --setting=value ...`."
            ) from error
        try:
            file = find_config(name, "evaluations")
        except UserError as error:
            raise UserError(f"phase {phase.name!r}: evaluation {name}: {error}") from None
        if file.stem in [other.name for other in found]:
            raise UserError(f"phase {phase.name!r}: two evaluations would write to the folder {file.stem!r}.")
        found.append(PhaseEvaluation(file, tuple(settings)))
    return found


def plan_evaluations(experiment: ExperimentConfig, phases: Sequence[PhaseConfig]) -> list[PlannedEvaluation]:
    """The evaluations of phases, as the command that will run them reads their settings; nothing is run.

    Raises:
        UserError: a mistake in any of them; all are listed.
    """
    asked = [
        (phase.name, evaluation, command_arguments(experiment, phase, evaluation))
        for phase in phases
        for evaluation in phase_evaluations(phase)
    ]
    if not asked:
        return []
    answers = _checked([arguments for _, _, arguments in asked])
    mistakes = [
        f"  phase {phase}, `{shlex.join((evaluation.name, *evaluation.settings))}`: {answer['mistake']}"
        for (phase, evaluation, _), answer in zip(asked, answers, strict=True)
        if answer["mistake"] is not None
    ]
    if mistakes:
        raise UserError("evaluations that cannot run as they are written:\n" + "\n".join(dict.fromkeys(mistakes)))
    names = ("nothing", "partial", "tasks", "trials", "steps", "plan")
    return [
        PlannedEvaluation(phase, evaluation, tuple(arguments), **{name: answer[name] for name in names})
        for (phase, evaluation, arguments), answer in zip(asked, answers, strict=True)
    ]


def command_arguments(experiment: ExperimentConfig, phase: PhaseConfig, evaluation: PhaseEvaluation) -> list[str]:
    """The arguments of `robocasa-lerobot eval` for the phase's last checkpoint."""
    folder = Path(experiment.output_dir) / phase.name
    return [
        f"--config_path={evaluation.file}",
        f"--policy.path={folder / 'checkpoints' / LAST / PRETRAINED}",
        f"--out={folder / FOLDER / evaluation.name}",
        *registry_setting(evaluation, experiment.registry),
        *evaluation.settings,
    ]


def registry_setting(evaluation: PhaseEvaluation, registry: str | None) -> list[str]:
    """The setting that gives an evaluation the experiment's registry, where it names none itself."""
    if registry in (None, ROBOCASA365):
        return []
    env = load_yaml(evaluation.file).get("env") or {}
    own = [key for key, _ in parse_overrides(evaluation.settings, flags=True)]
    return [] if "registry" in env or "env.registry" in own else [f"--env.registry={registry}"]


def run_evaluations(
    planned: Sequence[PlannedEvaluation], folder: Path, stop: Callable[[], bool] = lambda: False
) -> list[Skipped]:
    """Run a phase's evaluations that can run and are not finished yet; results go to `<folder>/evaluations/<name>/`.

    One that fails is no reason not to train on: it gets a line, and the same command runs it again.

    Args:
        planned: the evaluations.
        folder: the phase's.
        stop: asked now and then; with true the running one is ended, and goes on when it is run again.

    Returns:
        A line for each that failed.
    """
    failed: list[Skipped] = []
    last = last_checkpoint(folder)
    for item in planned if last is not None else ():
        assert last is not None
        done = folder / FOLDER / item.evaluation.name / FINISHED
        what = " ".join((last.name, item.plan, *item.evaluation.settings))
        if item.nothing is not None or (done.is_file() and done.read_text() == what):
            continue
        command = [sys.executable, "-m", "robocasa_lerobot.cli", "eval", END_WITH_INPUT, *item.arguments]
        status = _run(command, stop)
        if status is None or (status and stop()):  # a signal to all processes ends it as well, and is no failure
            break
        if status:
            again = shlex.join(["robocasa-lerobot", "eval", *item.arguments])
            reason = f"it ended with status {status}. Its own message stands in the log; alone it runs with `{again}`"
            if done.is_file():
                reason += f". If its settings have changed, put the results of before, {done.parent}, elsewhere"
            failed.append(Skipped(EVALUATION, item.phase, item.evaluation.name, reason))
            print(failed[-1], file=sys.stderr, flush=True)
            continue
        done.parent.mkdir(parents=True, exist_ok=True)
        done.write_text(what)
    return failed


class Evaluations:
    """The evaluations of a run's phases: planned at once, run after each phase, both by the first process alone.

    `left_out` has those known beforehand not to run, or not as a whole.

    Raises:
        UserError: as `plan_evaluations`.
    """

    def __init__(self, experiment: ExperimentConfig, phases: Sequence[PhaseConfig], first_process: bool) -> None:
        self._output = Path(experiment.output_dir)
        self._planned = plan_evaluations(experiment, phases) if first_process else []
        self._failed: list[Skipped] = []
        self.left_out = [item.skipped for item in self._planned if item.skipped is not None]

    def run(self, phase: str, stop: Callable[[], bool]) -> bool:
        """Run those of a finished phase; whether they were ended because of `stop`."""
        own = [item for item in self._planned if item.phase == phase]
        failed = run_evaluations(own, self._output / phase, stop)
        skipped.record(self._output, [*skipped.read(self._output), *failed])
        self._failed += failed
        return stop()

    def check_none_failed(self) -> None:
        """Raise a UserError that lists the evaluations that failed."""
        if self._failed:
            shown = "\n".join(f"  {item}" for item in self._failed)
            raise UserError(f"{len(self._failed)} evaluation(s) failed; the same command runs them again:\n{shown}")


def _run(command: list[str], stop: Callable[[], bool]) -> int | None:
    """The exit status of a command; None where it was ended because of `stop`.

    Its standard input closes when this process ends, however it does: nothing of a killed run may go on writing.
    """
    process = subprocess.Popen(command, env=_environment(), stdin=subprocess.PIPE)
    try:
        while True:
            try:
                return process.wait(_POLL_SECONDS)
            except subprocess.TimeoutExpired:
                if stop():
                    process.terminate()
                    with suppress(subprocess.TimeoutExpired):
                        process.wait(_END_SECONDS)
                    return None
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def _checked(evaluations: list[list[str]]) -> list[dict[str, Any]]:
    """What `robocasa_lerobot.evaluation.planning.check` says of evaluations."""
    command = [sys.executable, "-m", "robocasa_lerobot.evaluation.planning.check"]
    done = subprocess.run(
        command, input=json.dumps(evaluations), env=_environment(), capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise UserError(f"evaluations cannot be planned here (`{shlex.join(command)}`):\n{done.stderr.strip()}")
    return list(json.loads(done.stdout.splitlines()[-1]))  # whatever a library prints stands above


def _environment() -> dict[str, str]:
    """Ours without the launcher's variables: an evaluation is no part of this group of trainers."""
    return {name: value for name, value in os.environ.items() if not name.startswith(_LAUNCHER)}
