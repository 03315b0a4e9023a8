"""Whether evaluations can run, told before there is anything to evaluate: without a checkpoint, a scene or a GPU.

`robocasa-lerobot eval --check ...` tells a person. Training, which knows no simulator, asks in a process of its own,

    python -m robocasa_lerobot.evaluation.planning.check

with a JSON list of evaluations on standard input, each a list of the arguments of `robocasa-lerobot eval`; the answer
on standard output is a JSON list of the fields of `Checked`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import check_name, what_lacks
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig, PolicySettings, check_factory
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.run_header import (
    NothingRegisteredError,
    PlannedTasks,
    partial_sentence,
    plan_tasks,
)
from robocasa_lerobot.evaluation.planning.sources import check_labels, known_labels
from robocasa_lerobot.evaluation.remote.address import is_address

# Settings that leave results as they are: where they lie, where and how patiently trials run. Which policy it is, is
# not said by the place of a checkpoint, where a later one lies in its turn.
_NOT_OF_THE_RUN = (
    *("out", "workers", "shard", "stall_seconds", "remote"),
    *("policy.path", "policy.devices", "policy.placement", "env.render_devices"),
)


@dataclass(frozen=True)
class Checked:
    """Facts of an evaluation that are known beforehand.

    Attributes:
        mistake: in its settings; None if there is none.
        nothing: why there is nothing to run: this version has none of its tasks. None if there is.
        partial: what it leaves out, as a sentence; None if nothing.
        tasks: that it runs.
        trials: of all policies, tasks and perturbations together.
        steps: control steps of all trials, if none is solved before its horizon; 0 where the env decides.
        plan: a name of the planned run, the same as long as its tasks, their horizons and its settings are.
    """

    mistake: str | None = None
    nothing: str | None = None
    partial: str | None = None
    tasks: int = 0
    trials: int = 0
    steps: int = 0
    plan: str = ""


def check(arguments: Sequence[str]) -> Checked:
    """Facts of the evaluation with these arguments of `robocasa-lerobot eval`."""
    try:
        config = load_config(EvaluationConfig, arguments)
        return describe(config, planned(config))
    except NothingRegisteredError as error:
        return Checked(nothing=str(error))
    except UserError as error:
        return Checked(mistake=str(error))


def planned(config: EvaluationConfig) -> PlannedTasks:
    """The tasks of an evaluation.

    Raises:
        NothingRegisteredError: this version has none of them.
        UserError: something is named that does not exist.
    """
    for path in config.policy.path:
        check_name(path)
    check_labels(known_labels(config))
    check_factory(config.env.factory)
    tasks = plan_tasks(config.env, config.first_sets)
    for phase in config.policy.lifelong_phase if config.lifelong else ():
        tasks.of_policy(phase)
    return tasks


def describe(config: EvaluationConfig, tasks: PlannedTasks) -> Checked:
    """The numbers of an evaluation that can run."""
    phases: list[int | None] = [*config.policy.lifelong_phase] if config.lifelong else [None] * len(config.policy.path)
    each = config.trials * len(config.perturbation.names)
    own = [task for phase in phases for task in tasks.of_policy(phase)]
    return Checked(
        partial=partial_sentence(tasks.sets, tasks.missing, tasks.missing_by_set),
        tasks=len(tasks.horizons),
        trials=each * len(own),
        steps=each * sum(tasks.horizons[task] or 0 for task in own),
        plan=_name(config, tasks),
    )


def _name(config: EvaluationConfig, tasks: PlannedTasks) -> str:
    settings = dataclasses.asdict(config)
    for key in _NOT_OF_THE_RUN:
        group, _, name = key.rpartition(".")
        del (settings[group] if group else settings)[name]
    if config.policy.runtime == PolicySettings.runtime:  # younger than the names of finished runs
        del settings["policy"]["runtime"]
    return hashlib.sha256(json.dumps([tasks.horizons, settings], default=str).encode()).hexdigest()[:12]


def lines(config: EvaluationConfig, tasks: PlannedTasks) -> list[str]:
    """What a person wants to know of an evaluation before it runs."""
    checked = describe(config, tasks)
    where = "another simulator" if config.env.is_foreign else f"{config.env.split} scenes"
    out = [f"protocol {config.protocol}: {checked.tasks} tasks, {checked.trials:,} trials in {where}"]
    if checked.steps:
        hours = checked.steps / contract.CONTROL_HZ / 3600
        out.append(f"  at most {checked.steps:,} control steps, {hours:,.1f} simulated hours")
    for name, members in tasks.sets.items():
        lacking = tasks.missing_by_set.get(name, [])
        rest = f", without {', '.join(lacking)}" if lacking else ""
        out.append(f"  {name}: {len(members)} of {len(members) + len(lacking)} tasks{rest}")
    out += [checked.partial] if checked.partial else []
    # A training may be about to write it: no mistake yet.
    lacks = [what_lacks(path) for path in config.policy.path if not is_address(path)]
    return [*out, *(f"not there yet: {what}" for what in lacks if what is not None)]


if __name__ == "__main__":
    print(json.dumps([dataclasses.asdict(check(arguments)) for arguments in json.load(sys.stdin)]))
