"""Which policies are one row: those of one experiment, and never models that have only their labels in common."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs as runs

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.evaluation.report.efficiency_curves import _is_pretrained
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.left_out import is_partial, partial_runs
from robocasa_lerobot.evaluation.statistics.data_efficiency import _draw

GROUPS = {name: [task for task, group in runs.GROUPS.items() if group == name] for name in published.GROUPS}
LABELS: dict[str, Any] = {"training_data": "target only", "demo_fraction": 0.1}


def _run(folder: Path, group: str, **policy: Any) -> Path:
    """A run of a policy on the first tasks of a group."""
    tasks = GROUPS[group][:3]
    info = runs.policy(folder.name, **{**LABELS, "type": "groot", **policy})
    head = runs.header("foundation", [info], tasks, task_sets={group: tasks})
    return runs.write(folder, head, runs.trials(head, folder.name, dict.fromkeys(tasks, 0.5), 4))


def _rows(*folders: Path) -> list[int]:
    """Of how many policies each row is."""
    return sorted(len(policy.parts) or 1 for policy in gather(list(folders)).policies)


def test_models_without_an_experiment_are_joined_by_their_weights_alone(tmp_path: Path) -> None:
    others = [_run(tmp_path / f"a{i}", group, fingerprint=f"{i}" * 64) for i, group in enumerate(GROUPS)]
    assert _rows(*others) == [1, 1, 1]
    same = [_run(tmp_path / f"b{i}", group, fingerprint="f" * 64) for i, group in enumerate(GROUPS)]
    assert _rows(*same) == [3]
    remote = [
        _run(tmp_path / f"c{i}", group, fingerprint="unknown:1", remote={"address": "a"})
        for i, group in enumerate(GROUPS)
    ]
    assert _rows(*remote) == [1, 1, 1]


def test_phases_of_one_experiment_are_joined_and_two_steps_of_a_phase_are_not(tmp_path: Path) -> None:
    def phase(name: str, group: str, phase: str, step: int) -> Path:
        path = str(tmp_path / "training" / phase / "checkpoints" / str(step) / "pretrained_model")
        return _run(tmp_path / name, group, experiment="e", phase=phase, step=step, path=path, fingerprint=name * 32)

    names = list(GROUPS)
    assert _rows(*(phase(f"p{i}", group, f"target_{i}", 100) for i, group in enumerate(names))) == [3]
    assert _rows(phase("s0", names[0], "one", 100), phase("s1", names[1], "one", 200)) == [1, 1]


@pytest.mark.parametrize("fraction", [0.1, 0.3, 0.5, 1.0])
@pytest.mark.parametrize(("data", "expected"), [("none", False), ("target only", False), ("pretraining", True)])
def test_what_was_trained_on_nothing_before_is_not_pretrained(
    data: str, expected: bool, fraction: float, tmp_path: Path
) -> None:
    folder = _run(tmp_path / "run", next(iter(GROUPS)), training_data=data, demo_fraction=fraction)
    (policy,) = gather([folder]).policies
    assert _is_pretrained(policy) is expected


@pytest.mark.parametrize("trials", [10, 30, 100])
def test_redrawn_rates_lie_about_the_found_one_whatever_the_number_of_trials(trials: int) -> None:
    counts = [(0, trials)] * 10 + [(trials // 2, trials)] * 6
    rate = float(np.mean([x / n for x, n in counts]))
    drawn = _draw(counts, np.random.default_rng(0), 20_000)
    assert abs(float(drawn.mean()) - rate) < 0.002
    assert _draw([(0, trials)], np.random.default_rng(0), 1000).min() == 0.0


def _two_runs(folder: Path, second: list[str], **labels: Any) -> Path:
    """A folder in which one task was run first, and then, with other labels, others too."""
    tasks = GROUPS["atomic_seen"][:3]
    left = tasks[1:]
    first = runs.header(
        "custom",
        [runs.policy("p", type="groot")],
        tasks[:1],
        task_sets={"atomic_seen": tasks[:1]},
        missing_by_set={"atomic_seen": left},
        missing_tasks=left,
        trials=4,
    )
    then = runs.header(
        "custom",
        [runs.policy("p", type="groot", **labels)],
        second,
        task_sets={"atomic_seen": second},
        missing_by_set={"atomic_seen": [t for t in tasks if t not in second]} if len(second) < 3 else {},
        trials=4,
        started="2026-01-02T00:00:00+00:00",
    )
    records = runs.trials(first, "p", {tasks[0]: 0.5}, 4)
    runs.write(folder, first, records)
    more = [record for record in runs.trials(then, "p", dict.fromkeys(second, 0.5), 4) if record.task != tasks[0]]
    with (folder / "trials.jsonl").open("a", encoding="utf-8") as file:
        file.write("\n".join([then.to_line(), *(record.to_line() for record in more)]) + "\n")
    return folder


def test_what_a_later_run_in_the_same_folder_completes_is_not_partial(tmp_path: Path) -> None:
    tasks = GROUPS["atomic_seen"][:3]
    whole = gather([_two_runs(tmp_path / "whole", tasks)])
    assert not is_partial(whole.policies[0])
    assert partial_runs(whole) is None
    part = gather([_two_runs(tmp_path / "part", tasks[:2])])
    assert is_partial(part.policies[0])
    assert "without 1 of 3 tasks of atomic_seen" in (partial_runs(part) or "")


def test_labels_that_were_given_later_count(tmp_path: Path) -> None:
    tasks = GROUPS["atomic_seen"][:3]
    (policy,) = gather([_two_runs(tmp_path / "run", tasks, **LABELS, lifelong_phase=2)]).policies
    assert (policy.info.training_data, policy.info.demo_fraction, policy.info.lifelong_phase) == ("target only", 0.1, 2)
    assert dataclasses.replace(policy.info, training_data=None, demo_fraction=None, lifelong_phase=None) == runs.policy(
        "p", type="groot"
    )
