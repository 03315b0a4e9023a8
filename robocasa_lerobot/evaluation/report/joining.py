"""Policies that are one row of a table together: an experiment trains one for each group of tasks.

The benchmark fine-tunes each target split by itself, so that "pretraining + target, 10 %" is three policies, each
evaluated on its own tasks. Here they become one `PolicyResult` with the tasks of all. Policies are joined only if
their experiment, labels and rules agree, no task was evaluated with two of them and they are not of two steps of one
phase: else neither is left out, they stay apart and are shown both. Of policies that name no experiment only the very
same weights are joined.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path

from robocasa_lerobot.evaluation.report.places import tables
from robocasa_lerobot.evaluation.report.policies import PolicyResult, TaskResult, label_under

_RULES = (
    "protocol",
    "split",
    "horizon_rule",
    "horizon_multiplier",
    "horizon_version",
    "success_rule",
    "success_hold_steps",
    "render_preset",
)


def join(policies: Sequence[PolicyResult]) -> tuple[PolicyResult, ...]:
    """The policies in the order of a report, those that belong together as one with `parts`."""
    groups: dict[Hashable, list[list[PolicyResult]]] = {}
    for number, policy in enumerate(policies):
        key = _key(policy)
        found = groups.setdefault(number if key is None else key, [])
        fitting = next((group for group in found if all(_fit(policy, other) for other in group)), None)
        if fitting is None:
            found.append([policy])
        else:
            fitting.append(policy)
    joined = [_joined(group) for found in groups.values() for group in found]
    return tuple(sorted(joined, key=_order))


def _key(policy: PolicyResult) -> Hashable | None:
    """What policies that are joined have in common; None for one that stays alone."""
    info = policy.info
    labels = (info.training_data, info.demo_fraction, info.lifelong_phase)
    perturbed = info.experiment is not None and len(policy.conditions) > 1
    if not policy.places and not perturbed and not any(label is not None for label in labels):
        return None
    rules = tuple(getattr(policy.header, rule) for rule in _RULES)
    trained: tuple[Hashable, ...] = (info.experiment, training_folder(info.path))
    if trained == (None, None):
        if not info.fingerprint or info.remote is not None:  # nobody knows the weights behind a socket
            return None
        trained = (info.fingerprint,)
    return (
        *trained,
        info.type,
        labels,
        policy.places,
        rules,
        tuple(policy.conditions),
    )


def same_training(a: PolicyResult, b: PolicyResult) -> bool:
    """Whether two policies are phases of one training."""
    one, other = ((p.info.experiment, training_folder(p.info.path)) for p in (a, b))
    return one == other and one[0] is not None


def alike(a: PolicyResult, b: PolicyResult, data: bool = True) -> bool:
    """Whether policies of two trainings may be points of one curve: of one type, under the same rules and perturbation.

    With `data` their `training_data` agree too.
    """
    rules = all(getattr(a.header, rule) == getattr(b.header, rule) for rule in _RULES if rule != "protocol")
    same = (a.info.type, a.condition) == (b.info.type, b.condition)
    return rules and same and (not data or a.info.training_data == b.info.training_data)


def put_together(found: Sequence[Mapping[int, PolicyResult]], zero_joins: bool = False) -> list[list[int]]:
    """Which of some series of points, by their numbers, make one: those of a single point, where no other has several.

    Alone they would make nothing. Only policies that are `alike` go together; what one at 0, without target data or
    untrained, was trained on may be called otherwise. With `zero_joins` it joins a series of several points, too.
    """
    out = [[number] for number, points in enumerate(found) if len(points) > 1]
    none_whole = not out
    for number, points in enumerate(found):
        if len(points) > 1:
            continue
        ((at, policy),) = points.items()
        fitting = (
            group
            for group in out
            if none_whole or (zero_joins and at == 0)
            if all(
                at != other and alike(policy, one, data=0 not in (at, other))
                for member in group
                for other, one in found[member].items()
            )
        )
        if (group := next(fitting, None)) is None:
            out.append([number])
        else:
            group.append(number)
    return out


def training_folder(path: str) -> Path | None:
    """The output folder of the training of a checkpoint `<folder>/<phase>/checkpoints/<step>/pretrained_model`."""
    above = Path(path).parents
    return above[3] if len(above) > 3 and above[1].name == "checkpoints" else None


def _fit(a: PolicyResult, b: PolicyResult) -> bool:
    """Whether two policies have no task in common, and are not two steps of one phase."""
    overlap = {result.task for result in a.tasks} & {result.task for result in b.tasks}
    same_phase = a.info.phase is not None and a.info.phase == b.info.phase
    return not overlap and not (same_phase and a.info.step != b.info.step)


def _joined(group: Sequence[PolicyResult]) -> PolicyResult:
    if len(group) == 1:
        return group[0]
    conditions: dict[str, tuple[TaskResult, ...]] = {
        name: tuple(result for policy in group for result in policy.conditions.get(name, ()))
        for name in dict.fromkeys(name for policy in group for name in policy.conditions)
    }
    info = dataclasses.replace(group[0].info, label=_label(group), phase=None, step=None, fingerprint="")
    headers = tuple({header.id: header for policy in group for header in policy.headers}.values())
    return dataclasses.replace(
        group[0],
        label=label_under(info.label, group[0].condition),
        info=info,
        headers=headers,
        conditions=conditions,
        parts=tuple(group),
        planned={trials: count for policy in group for trials, count in policy.planned.items()},
    )


def _label(group: Sequence[PolicyResult]) -> str:
    info = group[0].info
    words = [info.experiment, info.training_data]
    words.append(None if info.demo_fraction is None else f"{100 * info.demo_fraction:g} %")
    said = [word for word in words[1:] if word]
    if not said:
        words.append(" + ".join(policy.info.phase or policy.label for policy in group))
    return ", ".join(word for word in words if word)


def _order(policy: PolicyResult) -> tuple[int, ...]:
    """Policies without a place first, as they came, then perturbed ones; then in the order of the published columns."""
    found = policy.places
    if not found:
        return (0,)
    names, first = list(tables()), found[0]
    table = tables()[first.table]
    column = list(table.get("columns", ())).index(first.column) if first.column is not None else -1
    row = list(table.get("rows", ())).index(first.row) if first.row is not None else -1
    return (1 if len(policy.conditions) > 1 else 2, names.index(first.table), column, row)
