"""What a study takes, told beforehand: demonstrations, hours of each kind of work, and disk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import torch

from robocasa_lerobot.data.registry.registry import open_registry
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE
from robocasa_lerobot.making.estimate import estimate
from robocasa_lerobot.making.needs import Need, needs_of, parse_episodes
from robocasa_lerobot.progress import Bar
from robocasa_lerobot.study.runs import Run
from robocasa_lerobot.study.settings import PartConfig, StudyConfig
from robocasa_lerobot.study.sharing import threads_of_each
from robocasa_lerobot.training.planning.evaluations import FINISHED, FOLDER, PlannedEvaluation, plan_evaluations
from robocasa_lerobot.training.planning.plan import PhasePlan, plan_experiment

# Of one core; and the part of their horizons that trials last on average, since those that succeed end before. Both of
# 4,624 trials of the study on two cores, which trainings shared at times (`docs/results`).
TRIAL_STEPS_PER_SECOND = 103.0
PART_OF_HORIZON = 0.8


@dataclass(frozen=True)
class Cost:
    """Of a part, without what earlier parts have made already.

    Attributes:
        runs: trainings.
        demonstrations: to record.
        data_hours, training_hours, trial_hours: on this machine; None where a training could not be measured.
        trials: of all runs.
        longest_hours: the longest single training.
        size: bytes on disk of datasets and checkpoints.
    """

    runs: int
    demonstrations: int
    data_hours: float
    training_hours: float | None
    trials: int
    trial_hours: float
    longest_hours: float | None
    size: int

    @property
    def hours(self) -> float:
        """All of it that is known."""
        return self.data_hours + (self.training_hours or 0.0) + self.trial_hours


def costs(
    study: StudyConfig,
    runs: Mapping[str, list[Run]],
    configs: Path,
    cores: int,
    measured_steps: int,
    at_once: int,
    left: Mapping[Run, Mapping[str, bool]],
) -> dict[str, Cost]:
    """What each part takes; `runs` are those of each part that no earlier part has and that have not ended.

    `left` are the phases of each that are still to be run, and whether they are to be tried. Data are those of all its
    phases, as they are made.

    Trainings are measured with the threads that each of `at_once` has beside the others, and alone: they share caches
    and memory as well, so that two of the demo's policy take 6 % longer than that.

    Raises:
        UserError: a mistake in an experiment.
    """
    datasets = open_registry(str(configs / study.registry)).config.datasets
    pixels = min((dataset.make.image_size for dataset in datasets if dataset.make is not None), default=None)
    measured: dict[str, float | str] = {}
    recorded: set[Path] = set()
    # Other seeds need the same data and take as long, where they have not begun.
    begun = {run for run, phases in left.items() if run.folder.exists() or len(phases) < len(run.config.phases)}
    kinds = {run: run.name if run in begun else run.experiment for own in runs.values() for run in own}
    plans: dict[str, _Plan] = {}
    total = len(set(kinds.values()))
    with (
        Bar(total=total, desc="timing steps", unit="experiment", leave=False) as bar,
        _torch_threads(threads_of_each(at_once, cores)),
    ):
        for run, kind in kinds.items():
            if kind not in plans:
                plans[kind] = _planned(run, pixels, measured_steps, measured, left[run])
                bar.update()
    out: dict[str, Cost] = {}
    for part, own in runs.items():
        needs: list[Need] = []
        mine: list[_Plan] = []
        for run in own:
            mine.append(plan := plans[kinds[run]])
            needs += [need for need in plan.needs if need.root not in recorded]
            recorded |= {need.root for need in needs}
        data = estimate(needs, cores)
        phases = [phase for plan in mine for phase in plan.phases if phase.done < phase.phase.steps]
        hours = [phase.hours for phase in phases if phase.hours is not None]
        known = len(hours) == len(phases)
        out[part] = Cost(
            runs=len(own),
            demonstrations=data.demonstrations,
            data_hours=data.recording_hours + data.converting_hours,
            training_hours=sum(hours) / at_once if known else None,
            trials=sum(plan.trials for plan in mine),
            trial_hours=sum(plan.steps for plan in mine) * PART_OF_HORIZON / TRIAL_STEPS_PER_SECOND / cores / 3600,
            longest_hours=max(hours, default=0.0) if known else None,
            size=data.size + sum((phase.checkpoint_bytes or 0) * phase.kept for phase in phases),
        )
    return out


@contextmanager
def _torch_threads(number: int | None) -> Iterator[None]:
    """Let torch compute with so many threads inside; None leaves it as it is."""
    before = torch.get_num_threads()
    torch.set_num_threads(number or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@dataclass(frozen=True)
class _Plan:
    """Of an experiment: missing data, phases, and the trials and control steps of their evaluations."""

    needs: list[Need]
    phases: list[PhasePlan]
    trials: int
    steps: int


def _planned(
    run: Run, pixels: int | None, measured_steps: int, measured: dict[str, float | str], wanted: Mapping[str, bool]
) -> _Plan:
    sizes = () if pixels is None else (f"--loader.image_size={pixels}",)
    experiment = run.loaded(sizes)
    needs, _ = needs_of(experiment, parse_episodes(run.episodes) if run.episodes else {})
    phases = plan_experiment(experiment, measured_steps=measured_steps, measured=measured)
    phases = [plan for plan in phases if plan.phase.name in wanted]
    tried = [plan.phase for plan in phases if wanted[plan.phase.name] and not plan.left_out]
    evaluations = plan_evaluations(experiment, tried)
    left = [_share_left(run, item) for item in evaluations]
    return _Plan(
        [need for need in needs if need.missing],
        phases,
        round(sum(item.trials * share for item, share in zip(evaluations, left, strict=True))),
        round(sum(item.steps * share for item, share in zip(evaluations, left, strict=True))),
    )


def _share_left(run: Run, item: PlannedEvaluation) -> float:
    """Of an evaluation's trials, that have not ended yet."""
    folder = run.folder / item.phase / FOLDER / item.evaluation.name
    trials = folder / TRIALS_FILE
    if (folder / FINISHED).is_file():
        return 0.0
    done = trials.read_bytes().count(b"\n") if trials.is_file() else 0
    return max(0.0, 1.0 - done / max(item.trials, 1))


def cost_lines(
    parts: Mapping[str, PartConfig], found: Mapping[str, Cost], cores: int, device: str, at_once: int
) -> list[str]:
    """The costs as a table, and their sum."""
    head = ("part", "runs", "demos", "data h", "training h", "trials", "trials h", "GB")
    rows = [head]
    for name, cost in found.items():
        training = "?" if cost.training_hours is None else f"{cost.training_hours:.1f}"
        numbers = (str(cost.runs), f"{cost.demonstrations:,}", f"{cost.data_hours:.1f}", training)
        rows.append((name, *numbers, f"{cost.trials:,}", f"{cost.trial_hours:.1f}", f"{cost.size / 1e9:.1f}"))
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells))
        if row is not head:
            lines.append(f"    {parts[row[0]].asks}")
    all_hours = sum(cost.hours for cost in found.values())
    longest = max((cost.longest_hours or 0.0 for cost in found.values()), default=0.0)
    beside = f", {at_once} trainings at once" if at_once > 1 else ""
    lines += ["", f"in all about {all_hours:.1f} hours on {cores} core(s) and {device}{beside}, what is there left out"]
    lines += [f"the longest single training: {60 * longest:.0f} minutes"] if longest else []
    return lines
