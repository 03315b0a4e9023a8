"""Whether what a study names is there: task sets, experiments, and their phases and evaluations."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.study.runs import Run
from robocasa_lerobot.study.settings import StudyConfig
from robocasa_lerobot.training.config.experiment import ExperimentConfig
from robocasa_lerobot.training.planning.evaluations import phase_evaluations


def check_study(study: StudyConfig, configs: Path, sets: Iterable[str]) -> None:
    """Check the columns and rows of all parts: the page has all of them, and is written after hours of training.

    Args:
        study: the one to run.
        configs: folder with `experiments/`.
        sets: names of the registry's task sets.

    Raises:
        UnknownNameError: there is no such task set, experiment, phase, or evaluation of the phase.
        UserError: an experiment has a mistake.
    """
    known = tuple(sets)
    experiments: dict[str, ExperimentConfig] = {}
    for name, part in study.parts.items():
        for task_set in part.sets:
            if task_set not in known:
                raise UnknownNameError("task set", task_set, known, f"(in `sets` of the study's part {name!r})")
        for label, row in part.rows.items():
            if row.experiment not in experiments:
                experiments[row.experiment] = Run(row.experiment, 0, Path(), configs).config
            phases = {phase.name: phase for phase in experiments[row.experiment].phases}
            where = f"(of the row {label!r} of the study's part {name!r})"
            if row.phase not in phases:
                raise UnknownNameError("phase", row.phase, phases, where)
            evaluations = [evaluation.name for evaluation in phase_evaluations(phases[row.phase])]
            if row.evaluation not in evaluations:
                raise UnknownNameError("evaluation", row.evaluation, evaluations, where)
