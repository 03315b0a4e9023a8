"""Learning curves of the trainings, and how often the demonstrator of the training data succeeded."""

from __future__ import annotations

from collections.abc import Sequence

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.formats.charts import learning_curve
from robocasa_lerobot.evaluation.report.model import Bar, Block, Cell, Column, Figure, Section, Table
from robocasa_lerobot.evaluation.report.training import DemonstratorResult, Training, TrainingPhase
from robocasa_lerobot.evaluation.statistics import Estimate

# Points of a curve in the table beside it.
TABLE_ROWS = 10


def section(trainings: Sequence[Training]) -> Section | None:
    """A chart for each phase, and the experiment files."""
    parts: list[Figure | Block] = []
    for number, training in enumerate(trainings, start=1):
        where = f" ({training.folder.name})" if len(trainings) > 1 else ""
        for index, phase in enumerate(training.phases, start=1):
            if phase.steps:
                parts.append(_figure(phase, f"learning-{number}-{index}", where))
    parts += [Block(f"experiment.yaml of {t.folder.name}", t.experiment) for t in trainings if t.experiment]
    if not parts:
        return None
    text = ("Thin: loss of single log lines; thick: running mean. Losses of different phases are over different data.",)
    return Section("training", "Training", text, parts=tuple(parts))


def demonstrator(results: Sequence[DemonstratorResult]) -> Section | None:
    """The demonstrator's own success while the training data were recorded."""
    if not results:
        return None
    rows = tuple(
        (
            Cell(result.task, code=True),
            Cell(
                fmt.percent(result.rate.rate),
                result.rate.rate,
                f"{fmt.interval(result.rate)} · {result.rate.successes}/{result.rate.trials}",
                Bar(Estimate(result.rate.rate, result.rate.low, result.rate.high)),
                strong=True,
            ),
        )
        for result in results
    )
    table = Table(
        "demonstrator-rates",
        "Success of the demonstrator",
        (Column("task"), Column("success", numeric=True, wide=True)),
        rows,
        cards=True,
    )
    text = (
        "How often the scripted demonstrator, which sees the simulator's state, solved the task while the training "
        "data were recorded. Only its successes became data.",
    )
    return Section("demonstrator", "The demonstrator", text, parts=(table,))


def _figure(phase: TrainingPhase, name: str, where: str) -> Figure:
    step = max(1, -(-len(phase.steps) // TABLE_ROWS))
    shown = [*range(0, len(phase.steps) - 1, step), len(phase.steps) - 1]
    rows = tuple(
        (Cell(f"{phase.steps[i]:,}", phase.steps[i]), Cell(f"{phase.losses[i]:.4g}", phase.losses[i])) for i in shown
    )
    columns = (Column("step", numeric=True), Column("loss", numeric=True))
    table = Table(f"{name}-numbers", f"Loss of phase {phase.name}{where}", columns, rows)
    return Figure(
        f"{name}-figure",
        f"Phase {phase.name}{where}",
        learning_curve(phase, name),
        table,
        f"{phase.steps[-1]:,} steps, last loss {phase.losses[-1]:.4g}.",
    )
