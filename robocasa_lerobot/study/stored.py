"""What is kept of a run when its checkpoints are gone: trials, curves, circumstances, and a picture of its films."""

from __future__ import annotations

import csv
import dataclasses
import gzip
import hashlib
import io
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError, differing
from robocasa_lerobot.evaluation.records.results import UNPERTURBED, TrialRecord, read_results
from robocasa_lerobot.files import write_text, written_aside
from robocasa_lerobot.provenance import git_commit, machine, utc_now, versions
from robocasa_lerobot.settings import load_yaml
from robocasa_lerobot.study.runs import CPU, Run
from robocasa_lerobot.study.strips import write_strips
from robocasa_lerobot.training.config.experiment import PhaseConfig, load_experiment
from robocasa_lerobot.training.metrics import METRICS, read_lines
from robocasa_lerobot.training.planning.evaluations import FINISHED, FOLDER, phase_evaluations
from robocasa_lerobot.training.records import PHASE_FILE

TRIALS, CURVES, ABOUT = "trials.csv.gz", "curves.csv", "about.json"
FILMED_SEED = 0  # whose film strips are kept
_CURVE_POINTS = 100  # of each phase
# What stays of a run's earlier folders.
_CIRCUMSTANCES = ("commit", "versions", "machine", "device", "training_hours", "trial_hours_of_one_process", "ended")


@dataclass(frozen=True)
class StoredTrial:
    """A trial in short; `failed` are the terms of the goal that did not hold at its end."""

    phase: str
    evaluation: str
    task: str
    trial: int
    seed: int
    layout_id: int | None
    style_id: int | None
    success: bool
    steps: int
    outcome: str
    failed: tuple[str, ...]


@dataclass(frozen=True)
class StoredRun:
    """A run, as far as its phases have ended.

    Attributes:
        experiment, seed: which one.
        trials: of all evaluations of those phases.
        about: their steps; commit, versions, machine and hours of `phases`, those of the folder that was stored last,
            and a list of the same, `earlier`, where others had been kept and their folders were gone.
        curves: rows of phase, step and loss.
    """

    experiment: str
    seed: int
    trials: tuple[StoredTrial, ...]
    about: dict[str, Any]
    curves: tuple[tuple[str, int, float], ...]

    @property
    def phases(self) -> tuple[str, ...]:
        """The phases that have ended."""
        return tuple(dict.fromkeys(phase for phase, _, _ in self.curves))


def stored_folder(results: Path, experiment: str, seed: int) -> Path:
    """Where a run's files lie."""
    return results / experiment / f"seed_{seed}"


def strips_name(phase: str, evaluation: str) -> str:
    """The picture of an evaluation's film strips, in the folder of its run."""
    return f"{phase}-{evaluation}.jpg"


def store(run: Run, results: Path) -> Path:
    """Keep the phases of a run that have ended; its folder. `about.json` is written last: with it, all are there.

    Phases that were kept before and whose folders are gone stay, and what they were trained with is told beside.

    Raises:
        UserError: none has all evaluations that the experiment asks for.
    """
    experiment = load_experiment(run.file, scale=run.scale)
    ended = [phase for phase in experiment.phases if _has_ended(run.folder / phase.name, phase)]
    if not ended:
        raise UserError(f"{run.name}: none of its phases has ended and has all its evaluations.")
    out = stored_folder(results, run.experiment, run.seed)
    trials: list[StoredTrial] = []
    curves: list[tuple[str, int, float]] = []
    training = trying = 0.0
    devices: list[str] = []
    for phase in ended:
        folder = run.folder / phase.name
        lines = read_lines(folder / METRICS)
        training += sum(_seconds(lines))
        thinned = lines[:: max(1, len(lines) // _CURVE_POINTS)]
        curves += [(phase.name, int(line["step"]), float(line["loss"])) for line in thinned]
        for name in (evaluation.name for evaluation in phase_evaluations(phase)):
            # Those of scenes as they are: a stored trial does not say how its scene was perturbed.
            found = read_results(folder / FOLDER / name).trials
            records = [record for record in found if record.perturbation == UNPERTURBED]
            trials += [_short(phase.name, name, record) for record in records]
            trying += sum(record.seconds.total for record in records)
            if run.seed == FILMED_SEED:
                write_strips(folder / FOLDER / name, records, out / strips_name(phase.name, name))
        about_phase = json.loads((folder / PHASE_FILE).read_text(encoding="utf-8"))
        devices.append(str(about_phase.get("device", experiment.device)))  # those of before did not note it
    names = {phase.name for phase in ended}
    before = read_stored(results, run.experiment, run.seed)
    earlier: list[dict[str, Any]] = []
    if before is not None and stands_for(before.about, run):
        earlier = before.about.get("earlier", [])
        if not names.issuperset(before.about.get("phases", before.about["steps"])):
            earlier = [*earlier, {name: before.about.get(name) for name in _CIRCUMSTANCES}]
        trials += [trial for trial in before.trials if trial.phase not in names]
        curves += [point for point in before.curves if point[0] not in names]
        names |= set(before.about["steps"])
    kept = [phase for phase in experiment.phases if phase.name in names]
    order = [phase.name for phase in kept]
    curves.sort(key=lambda point: (order.index(point[0]), point[1]))
    out.mkdir(parents=True, exist_ok=True)
    _write_trials(out / TRIALS, trials)
    rows = ["phase,step,loss", *(f"{phase},{step},{loss:.6g}" for phase, step, loss in curves)]
    write_text(out / CURVES, "\n".join(rows) + "\n")
    about = {
        "experiment": run.experiment,
        "seed": run.seed,
        "scale": run.scale,
        "episodes": run.episodes,
        "commit": git_commit(),
        "versions": versions("lerobot", "torch", "mujoco"),
        "machine": machine(),
        "device": ", ".join(dict.fromkeys(devices)),
        "steps": {phase.name: phase.steps for phase in kept},
        "evaluations": _evaluations(run.config.phases, names),
        "training_hours": round(training / 3600, 3),
        "trial_hours_of_one_process": round(trying / 3600, 3),
        "ended": utc_now(),
        "phases": [phase.name for phase in ended],
        "earlier": earlier,
    }
    write_text(out / ABOUT, json.dumps(about, indent=1) + "\n")
    return out


def circumstances(about: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """With what a run's phases were trained and tried: of those of this folder, and of those that it had before."""
    return [about, *about.get("earlier", [])]


def phases_left(run: Run, results: Path) -> dict[str, bool]:
    """The phases of a run that are still to be run, in order, and whether they are to be tried.

    Those that were not kept are, and what these build on is trained: what was kept needs no checkpoint any more, but
    what a later phase starts from, or whose policy is corrected for it, does. Its trials stay those that were kept.
    """
    about = _about(results, run)
    kept = about["steps"] if about is not None and stands_for(about, run) else {}
    left: set[str] = set()
    for phase in run.config.phases:
        if phase.name not in kept:
            left |= {phase.name, *(one.name for one in run.config.ancestors(phase)), *run.corrected_for(phase)}
    return {phase.name: phase.name not in kept for phase in run.config.phases if phase.name in left}


def is_stored(run: Run, results: Path) -> bool:
    """Whether all phases of a run were kept."""
    about = _about(results, run)
    return about is not None and stands_for(about, run) and len(about["steps"]) == len(run.config.phases)


def check_results(runs: Iterable[Run], results: Path) -> None:
    """Check that what was kept in the places of these runs is theirs, since they and the page replace it.

    Raises:
        UserError: there is something of another scale, of other demonstrations, or of a CPU for a GPU.
    """
    for run in runs:
        about = _about(results, run)
        others = "" if about is None else _others(about, run)
        if others:
            raise UserError(
                f"{stored_folder(results, run.experiment, run.seed)} holds results of another study ({others}), which "
                "this one would replace. Give another --results and --page."
            )


def stands_for(about: Mapping[str, Any], run: Run) -> bool:
    """Whether what was kept is of this run as it is now; a trial of it, shorter phases, or a CPU for a GPU are not.

    Nor are other evaluations, as of more trials; what was kept before these were noted stands for any.

    Args:
        about: the content of `about.json`.
        run: as the study has it.
    """
    steps = {phase.name: phase.steps for phase in run.config.phases}
    tried = _evaluations(run.config.phases, set(about["steps"]))
    alike = about.get("evaluations", tried) == tried
    return not _others(about, run) and about["steps"].items() <= steps.items() and alike


def _evaluations(phases: Iterable[PhaseConfig], names: Collection[str]) -> dict[str, dict[str, str]]:
    """Of phases of these names what each evaluation is: a name that changes with its file or its settings."""
    return {
        phase.name: {
            one.name: hashlib.sha256(json.dumps([load_yaml(one.file), one.settings]).encode()).hexdigest()[:12]
            for one in phase_evaluations(phase)
        }
        for phase in phases
        if phase.name in names
    }


def _others(about: Mapping[str, Any], run: Run) -> str:
    """What of the settings of a study's command was another when something was kept; empty where nothing was."""
    found = {"scale": about["scale"], "episodes": about["episodes"], "device": _kind(about["device"])}
    return differing(found, {"scale": run.scale, "episodes": run.episodes, "device": _kind(run.device)})


def _kind(device: str) -> str:
    return "CPU" if device == CPU else "GPU"


def _about(results: Path, run: Run) -> dict[str, Any] | None:
    """What was kept of a run's circumstances; None where nothing was."""
    file = stored_folder(results, run.experiment, run.seed) / ABOUT
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else None


def read_stored(results: Path, experiment: str, seed: int) -> StoredRun | None:
    """What was kept of a run; None where nothing was."""
    folder = stored_folder(results, experiment, seed)
    if not (folder / ABOUT).is_file():
        return None
    about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    text = gzip.decompress((folder / TRIALS).read_bytes()).decode()
    trials = tuple(_read_trial(row) for row in csv.DictReader(io.StringIO(text)))
    with (folder / CURVES).open(encoding="utf-8", newline="") as file:
        curves = tuple((row["phase"], int(row["step"]), float(row["loss"])) for row in csv.DictReader(file))
    return StoredRun(experiment, seed, trials, about, curves)


def _has_ended(folder: Path, phase: PhaseConfig) -> bool:
    """Whether a phase was trained to its end and has all its evaluations."""
    lines = read_lines(folder / METRICS)
    names = (evaluation.name for evaluation in phase_evaluations(phase))
    trained = bool(lines) and int(lines[-1]["step"]) >= phase.steps
    return trained and all((folder / FOLDER / name / FINISHED).is_file() for name in names)


def _seconds(lines: Iterable[dict[str, Any]]) -> Iterable[float]:
    before = 0
    for line in lines:
        yield float(line["seconds_per_step"]) * (int(line["step"]) - before)
        before = int(line["step"])


def _short(phase: str, evaluation: str, record: TrialRecord) -> StoredTrial:
    failed = tuple(name for name, term in record.terms.items() if not term.final) if not record.success else ()
    return StoredTrial(
        phase,
        evaluation,
        record.task,
        record.trial,
        record.seed,
        record.layout_id,
        record.style_id,
        record.success,
        record.steps,
        record.outcome,
        failed,
    )


def _write_trials(path: Path, trials: Iterable[StoredTrial]) -> None:
    """Packed; the same trials give the same bytes."""
    text = io.StringIO()
    names = [field.name for field in dataclasses.fields(StoredTrial)]
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for trial in sorted(trials, key=lambda one: (one.phase, one.evaluation, one.task, one.trial)):
        values = {**dataclasses.asdict(trial), "failed": "+".join(trial.failed), "success": int(trial.success)}
        writer.writerow(["" if values[name] is None else values[name] for name in names])
    with written_aside(path) as aside:
        aside.write_bytes(gzip.compress(text.getvalue().encode(), mtime=0))


def _read_trial(row: dict[str, str]) -> StoredTrial:
    def number(name: str) -> int | None:
        return int(row[name]) if row[name] else None

    return StoredTrial(
        phase=row["phase"],
        evaluation=row["evaluation"],
        task=row["task"],
        trial=int(row["trial"]),
        seed=int(row["seed"]),
        layout_id=number("layout_id"),
        style_id=number("style_id"),
        success=row["success"] == "1",
        steps=int(row["steps"]),
        outcome=row["outcome"],
        failed=tuple(row["failed"].split("+")) if row["failed"] else (),
    )
