"""Phases that cannot be trained because none of their tasks is in this version yet: they are left out, and it is said.

Such a phase is as if it were not there. What would have started from it starts from the last phase before it that
runs; where there is none, it is left out too, because its numbers would claim a start that it did not have.
"""

from __future__ import annotations

import dataclasses

from robocasa_lerobot.data.registry.registry import registered_part
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config.experiment import ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.config.phase import ReplayConfig
from robocasa_lerobot.training.planning.skipped import PARTIAL, PHASE, Skipped


def runnable(experiment: ExperimentConfig) -> tuple[ExperimentConfig, list[Skipped]]:
    """The experiment without the phases that cannot run, and those left out or trained on a part of its tasks.

    Raises:
        UserError: no phase can run, or a selection of datasets does not fit its registry.
    """
    said: list[Skipped] = []
    kept: list[PhaseConfig] = []
    stands_for: dict[str, str | None] = {}  # a phase that is left out: the one that runs in its place, if any
    for phase in experiment.phases:
        parent = experiment.parent(phase)
        start = stands_for.get(parent.name, parent.name) if parent is not None else None
        mixture, notes = registered_part(phase.mixture)
        if mixture is None:
            stands_for[phase.name] = start
            said.append(Skipped(PHASE, phase.name, None, " ".join(notes)))
        elif parent is not None and start is None:
            stands_for[phase.name] = None
            reason = f"it starts from phase {parent.name}, which is left out, and so is all before it."
            said.append(Skipped(PHASE, phase.name, None, reason))
        else:
            said += [Skipped(PARTIAL, phase.name, None, " ".join(notes))] if notes else []
            if parent is not None and start != parent.name:
                reason = f"it starts from phase {start}, because {parent.name} is left out."
                said.append(Skipped(PARTIAL, phase.name, None, reason))
            init = phase.init if parent is None else start
            kept.append(dataclasses.replace(phase, mixture=mixture, init=init, replay=_replay(phase, kept, start)))
    if not kept:
        raise UserError(f"experiment {experiment.name!r}: no phase can run. " + " ".join(map(str, said)))
    return (dataclasses.replace(experiment, phases=kept), said) if said else (experiment, said)


def _replay(phase: PhaseConfig, kept: list[PhaseConfig], start: str | None) -> ReplayConfig | None:
    """The rest of the phase's replay: the phases that run, or nothing where it builds on none."""
    if phase.replay is None or phase.replay.phases is None:
        return phase.replay if start is not None else None
    names = [name for name in phase.replay.phases if name in {other.name for other in kept}]
    return dataclasses.replace(phase.replay, phases=names) if names else None
