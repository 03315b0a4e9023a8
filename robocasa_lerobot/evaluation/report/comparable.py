"""Which policies of a report were tried alike: the same tasks, kitchens, rules and simulator."""

from __future__ import annotations

from collections.abc import Sequence

from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.policies import PolicyResult, simulator_of

# Fields of a run's header, and what they are called in a sentence.
_RULES = {
    "split": "kitchens",
    "horizon_rule": "horizons",
    "horizon_multiplier": "horizons",
    "horizon_version": "horizons",
    "success_rule": "what counts as solved",
    "success_hold_steps": "what counts as solved",
}


def differences(a: PolicyResult, b: PolicyResult) -> list[str]:
    """In what the trials of two policies differ, but for the tasks; empty where their rates can be compared."""
    found = [what for rule, what in _RULES.items() if getattr(a.header, rule) != getattr(b.header, rule)]
    found += ["simulators"] if simulator_of(a.header) != simulator_of(b.header) else []
    return list(dict.fromkeys(found))


def same_tasks(a: PolicyResult, b: PolicyResult) -> bool:
    """Whether they were tried on the same tasks."""
    return {result.task for result in a.tasks} == {result.task for result in b.tasks}


def common_tasks(a: PolicyResult, b: PolicyResult) -> set[str]:
    """The tasks that both were tried on."""
    return {result.task for result in a.tasks} & {result.task for result in b.tasks}


def warnings(policies: Sequence[PolicyResult]) -> tuple[str, ...]:
    """A sentence about columns of a table that were not tried as the last one was; none where all were."""
    if not policies:
        return ()
    last = policies[-1]
    found: dict[str, list[str]] = {}
    for policy in policies[:-1]:
        if what := differences(policy, last):
            found.setdefault(fmt.listed(what), []).append(policy.label)
    return tuple(
        f"Not tried alike: {fmt.listed(labels)} and {last.label} differ in {what}; their rates say nothing about which "
        "is better."
        for what, labels in found.items()
    )
