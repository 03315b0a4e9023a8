"""What a report knows of where its trials come from: policies to measure others by, and another simulator's time."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.records.results import REFERENCE_POLICIES, REPLAY
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.numbers import seconds
from robocasa_lerobot.evaluation.report.policies import REFERENCES, describe_policy
from robocasa_lerobot.evaluation.report.sections import comparison, provenance, summary

TASKS = {"OpenDrawer": 0.6, "CloseDrawer": 0.6}
PUSHT = {"factory": "lerobot", "type": "lerobot:pusht", "simulator": {"adapter": "0"}}


def test_replayed_demonstrations_are_a_reference_and_no_policy_that_is_compared(tmp_path: Path) -> None:
    about = [
        synthetic_runs.policy("old", type="groot"),
        synthetic_runs.policy("new", type="groot"),
        synthetic_runs.policy("replay", type="replay", path="replay:demos.hdf5"),
    ]
    head = synthetic_runs.header("custom", about, list(TASKS), task_sets={}, trials=10)
    records = [record for one in about for record in synthetic_runs.trials(head, one.label, TASKS, 10)]
    data = gather([synthetic_runs.write(tmp_path / "run", head, records)])
    assert [policy.label for policy in data.policies] == ["replay", "old", "new"]
    assert describe_policy(data.policies[0]) == "reference: stored actions played again"
    pair = comparison.main_pair(gather([tmp_path / "run"]))
    assert pair is not None
    assert (pair.a.label, pair.b.label) == ("old", "new")
    assert set(REFERENCES) == {*REFERENCE_POLICIES, REPLAY}


@pytest.mark.parametrize(
    ("settings", "fps", "rate"),
    [  # two of our kitchens; PushT as it is recorded now, and as it once was; an env that says nothing
        ({}, None, 20.0),
        ({"factory": "robocasa_lerobot.envs.kitchen_env:KitchenEnv"}, None, 20.0),
        (PUSHT, 10.0, 10.0),
        (PUSHT, None, None),
        ({"factory": "my_envs:make"}, None, None),
    ],
)
def test_seconds_are_those_of_the_env(
    settings: dict[str, Any], fps: float | None, rate: float | None, tmp_path: Path
) -> None:
    about = synthetic_runs.policy("mine")
    head = synthetic_runs.header("custom", [about], list(TASKS), task_sets={}, trials=9, settings=settings)
    records = [dataclasses.replace(r, fps=fps) for r in synthetic_runs.trials(head, "mine", TASKS, 9)]
    run = synthetic_runs.write(tmp_path / "run", head, records)
    assert ('"fps"' in (run / "trials.jsonl").read_text()) is (fps is not None)
    assert main(["report", str(run), "--no-videos"]) == 0
    steps = {task: sorted(r.first_success_step or 0 for r in records if r.task == task and r.success) for task in TASKS}
    rows = list(csv.DictReader((run / "report.csv").read_text().splitlines()))
    found = {row["task"]: row["median_seconds_to_success"] for row in rows if row["task"]}
    for task, own in steps.items():
        assert found[task] == "" if rate is None else float(found[task]) == pytest.approx(np.median(own) / rate)
    lines = (run / "report.md").read_text().splitlines()
    line = next(line for line in lines if line.startswith("| mine |") and line.count("|") == 9)
    both = sorted(steps["OpenDrawer"] + steps["CloseDrawer"])
    assert line.split("|")[-3].strip() == seconds(None if rate is None else float(np.median(both)) / rate)


def test_settings_are_those_of_every_run_that_was_continued(tmp_path: Path) -> None:
    """The second half of the trials on another machine, by another version."""
    about = synthetic_runs.policy("mine")
    heads = [
        synthetic_runs.header("custom", [about], list(TASKS), task_sets={}, trials=10, **of_run)
        for of_run in ({}, {"machine": {"processor": "another"}, "versions": {"mujoco": "3.18.0"}})
    ]
    assert heads[0].id != heads[1].id
    run = tmp_path / "run"
    run.mkdir()
    lines = [head.to_line() for head in heads]
    for record in synthetic_runs.trials(heads[0], "mine", TASKS, 10):
        lines.append(dataclasses.replace(record, run=heads[record.trial // 5].id).to_line())
    (run / "trials.jsonl").write_text("\n".join(lines) + "\n")
    rows = dict(provenance.common_settings(gather([run]).single))
    assert rows["processor"] == "none: these trials were drawn at random, another"
    assert rows["mujoco"] == "3.17.0, 3.18.0"
    assert rows["device"] == "synthetic"


def test_policies_and_tasks_are_in_the_order_of_the_plan(tmp_path: Path) -> None:
    """Whichever trials ended first: long horizons run first, and workers overtake each other."""
    about = [synthetic_runs.policy(label) for label in ("first", "second")]
    head = synthetic_runs.header("custom", about, list(TASKS), task_sets={}, trials=2)
    records = [record for one in about for record in synthetic_runs.trials(head, one.label, TASKS, 2)]
    data = gather([synthetic_runs.write(tmp_path / "run", head, records[::-1])])
    assert [policy.label for policy in data.policies] == ["first", "second"]
    assert data.task_names == tuple(TASKS)


def test_only_what_has_weights_is_said_to_have_them(tmp_path: Path) -> None:
    kinds = {"zero": "zero", "replay": "replay:demos.hdf5", "mine": "mine"}
    about = [
        synthetic_runs.policy(kind, type="act" if kind == "mine" else kind, path=path) for kind, path in kinds.items()
    ]
    head = synthetic_runs.header("custom", about, list(TASKS), task_sets={}, trials=1)
    records = [record for one in about for record in synthetic_runs.trials(head, one.label, TASKS, 1)]
    parts = provenance.section(gather([synthetic_runs.write(tmp_path / "run", head, records)])).parts
    names = {part.title: {name for name, _ in part.items} & {"weights", "stored actions"} for part in parts[1:]}  # type: ignore[union-attr]
    assert names == {"zero": set(), "replay": {"stored actions"}, "mine": {"weights"}}


def test_an_interval_to_one_side_is_told_as_far_as_it_reaches(tmp_path: Path) -> None:
    about = synthetic_runs.policy("mine")
    head = synthetic_runs.header("custom", [about], list(TASKS), task_sets={}, trials=3)
    records = synthetic_runs.trials(head, "mine", dict.fromkeys(TASKS, 0.0), 3)
    said = summary.how_sure(gather([synthetic_runs.write(tmp_path / "run", head, records)]))
    # Wilson's interval of 0 of 3 ends at 56.1 %, that of 0 of 6 at 39.0 %.
    assert said.startswith(
        "One task's rate may be up to 56 points off (95 % intervals), the average over 2 tasks up to 39.0."
    )
