"""The leaderboard's protocol, as a list of reasons why a run does not follow it."""

from __future__ import annotations

import collections

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.records.results import UNPERTURBED, TrialRecord
from robocasa_lerobot.evaluation.report.policies import PolicyResult, is_reference

SPLIT = "pretrain"
TRIALS_PER_TASK = 50
SHOWN = 8


def reasons(policy: PolicyResult) -> list[str]:
    """Why the trials of a policy are no submission; none if they are.

    The protocol: the 50 target tasks, at least 50 trials of each, in pretraining scenes, unperturbed, each task's own
    horizon, success at any step of the trial, every trial run to its end.
    """
    found: list[str] = []
    if is_reference(policy):
        found.append(f"{policy.label} is a reference policy ({policy.info.path}), not a learned one")
    if any(header.settings.get("synthetic") for header in policy.headers):
        found.append("its trials are synthetic: they were made to show a report and never run")
    found += _rules(policy)
    if UNPERTURBED not in policy.conditions:
        found.append("it has no unperturbed trials")
        return found
    trials = {result.task: result.trials for result in policy.conditions[UNPERTURBED]}
    missing = [task for task in published.group_of_task() if task not in trials]
    if missing:
        found.append(f"{len(missing)} of the 50 tasks are missing: {_some(missing)}")
    for what, tasks in _trial_faults({task: trials[task] for task in published.group_of_task() if task in trials}):
        if tasks:
            found.append(f"{what}: {_some(tasks)}")
    return found


def _rules(policy: PolicyResult) -> list[str]:
    found: dict[str, None] = {}
    for header in policy.headers:
        if header.split != SPLIT:
            found[f"split is {header.split!r}, the leaderboard's is {SPLIT!r} (--env.split={SPLIT})"] = None
        if header.horizon_rule != "task":
            found[f"horizons are {header.horizon_rule!r}, the leaderboard's are each task's own"] = None
        if header.horizon_multiplier != 1.0:
            found[f"horizons are {header.horizon_multiplier:g} times the tasks' own, the leaderboard's 1 time"] = None
        if header.success_rule != "any_step" or header.success_hold_steps != 1:
            rule = f"{header.success_rule!r} for {header.success_hold_steps} step(s)"
            found[f"success is {rule}, the leaderboard's is 'any_step' for 1 step"] = None
    return list(found)


def _trial_faults(trials: dict[str, tuple[TrialRecord, ...]]) -> list[tuple[str, list[str]]]:
    few = [f"{task} ({len(own)})" for task, own in trials.items() if len(own) < TRIALS_PER_TASK]
    sizes = collections.Counter(len(own) for own in trials.values())
    uneven = [] if len(sizes) < 2 or few else [f"{task} ({len(own)})" for task, own in trials.items()]
    seeds = [task for task, own in trials.items() if len({r.seed for r in own}) < len(own)]
    errors = [task for task, own in trials.items() if any(r.error is not None for r in own)]
    split = [task for task, own in trials.items() if any(r.split != SPLIT for r in own)]
    return [
        (f"fewer than {TRIALS_PER_TASK} trials", few),
        ("tasks have different numbers of trials", uneven),
        ("seeds were used twice", seeds),
        ("trials ended in an error (run them again with --retry_errors=true)", errors),
        (f"trials are not in {SPLIT!r} scenes", split),
    ]


def _some(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
