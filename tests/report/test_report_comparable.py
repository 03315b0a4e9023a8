"""Policies that were not tried alike stand beside each other in a report, and it says so."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_runs

from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, UNPERTURBED
from robocasa_lerobot.evaluation.report import comparable, output
from robocasa_lerobot.evaluation.report import numbers as fmt
from robocasa_lerobot.evaluation.report.formats.film_strip import choose_films
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.model import Figure, Table
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.evaluation.report.sections import comparison, horizon, kinds, summary, tasks
from robocasa_lerobot.video import VideoWriter

TASKS = {"OpenDrawer": 0.9, "CloseDrawer": 0.8}


def a_run(folder: Path, label: str, rates: dict[str, float] | None = None, **changes: Any) -> Path:
    rates = rates or TASKS
    head = synthetic_runs.header("custom", [synthetic_runs.policy(label)], list(rates), task_sets={}, **changes)
    records = synthetic_runs.trials(head, label, rates, head.trials)
    multiplier = head.horizon_multiplier
    kept = [dataclasses.replace(record, horizon_multiplier=multiplier) for record in records]
    return synthetic_runs.write(folder / label, head, kept)


def beside(folder: Path, rates: dict[str, float] | None = None, **changes: Any) -> ReportData:
    """An older policy tried otherwise beside a newer one."""
    return gather([a_run(folder, "old", rates, trials=9, **changes), a_run(folder, "new", trials=9)])


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"split": "pretrain"}, "kitchens"),
        ({"horizon_multiplier": 0.5}, "horizons"),
        ({"success_rule": "at_end"}, "what counts as solved"),
        ({"settings": {"factory": "my_envs:make"}}, "simulators"),
    ],
)
def test_what_was_tried_by_other_rules_is_not_compared_in_the_headline(
    changes: dict[str, Any], what: str, tmp_path: Path
) -> None:
    data = beside(tmp_path, **changes)
    said = summary.headline(data)
    assert "old" not in said
    assert said.endswith("1 more policy was tried on other tasks or by other rules.")
    (warning,) = comparable.warnings(data.policies)
    assert f"old and new differ in {what}" in warning
    section = tasks.section(data)
    assert warning in section.parts[0].warnings
    assert "same kitchen" not in section.marks_legend


def test_nothing_of_our_kitchens_is_said_of_another_simulator(tmp_path: Path) -> None:
    """Whose tasks have the names of ours, as those of RoboCasa's own in LeRobot."""
    rates = dict.fromkeys((*TASKS, *list(synthetic_runs.GROUPS)[:20]), 0.5)
    theirs = {"settings": {"factory": "lerobot", "type": "lerobot:robocasa"}, "split": "own", "horizon_rule": "env"}
    run = a_run(tmp_path, "pi0", rates, trials=9, **theirs)
    output.write_report([run], out=tmp_path / "report.html")
    said = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "is solved when the goal held at any step. In the simulator lerobot:robocasa was tried: pi0." in said
    for ours in ("made in code", "Ours are other kitchens", "kitchens drawn like these", "same kitchen for every"):
        assert ours not in said
    data = gather([run])
    assert kinds.section(data) is None
    table = tasks.section(data).parts[0]
    assert isinstance(table, Table)
    assert [column.label for column in table.columns] == ["task", "pi0", "best"]
    # Beside one of our kitchens: the tables say which is which, and what is known of ours is of ours alone.
    data = gather([a_run(tmp_path / "kitchens", "mine", {"OpenDrawer": 0.5}, trials=9), run])
    table = tasks.section(data).parts[0]
    assert isinstance(table, Table)
    assert "Ours are other kitchens, other objects and another simulator than the published ones." in table.warnings
    assert "In the simulator lerobot:robocasa was tried: pi0." in table.warnings
    stages = {row[0].text: row[1].text for row in table.rows}
    assert stages["OpenDrawer"] != fmt.NONE
    assert stages["CloseDrawer"] == fmt.NONE


def test_a_label_at_the_beginning_of_a_sentence_stays_as_it_is(tmp_path: Path) -> None:
    rates = {"act": 0.01, "pi0": 0.9}
    kept = gather([a_run(tmp_path, label, dict.fromkeys(TASKS, rate), trials=9) for label, rate in rates.items()])
    assert summary.headline(kept).startswith("pi0 solves ")
    assert str(comparison.sentence(kept)).startswith("pi0 is better than act by ")
    alike = gather([a_run(tmp_path / "alike", label, trials=2) for label in ("act", "pi0")])
    assert str(comparison.sentence(alike)).startswith("pi0 and act cannot be told apart")


def test_what_was_tried_alike_is_compared(tmp_path: Path) -> None:
    data = beside(tmp_path)
    assert "; old " in summary.headline(data)
    assert comparable.warnings(data.policies) == ()
    assert "the same place is the same kitchen" in tasks.section(data).marks_legend
    assert "1 more policy" in summary.headline(beside(tmp_path / "other", {"OpenDrawer": 0.5}))


def test_nothing_is_said_of_times_that_no_trial_has_reached(tmp_path: Path) -> None:
    data = gather([a_run(tmp_path, "short", trials=9, horizon_multiplier=0.5)])
    section = horizon.section(data)
    assert section is not None
    (figure,) = section.parts
    assert isinstance(figure, Figure)
    row = figure.table.rows[0]
    by_half, by_three_quarters, by_all = row[2], row[3], row[4]
    assert by_half.value is not None
    assert by_three_quarters.value is by_all.value is None


def test_times_of_other_kinds_are_left_out_and_named(tmp_path: Path) -> None:
    runs = [
        a_run(tmp_path, "fixed", trials=9, horizon_rule="fixed"),
        a_run(tmp_path, "held", trials=9, success_rule="at_end"),
        a_run(tmp_path, "plain", trials=9),
    ]
    section = horizon.section(gather(runs))
    assert section is not None
    assert any("another kind of horizon: fixed" in text for text in section.text)
    assert any("at the end of a trial, whenever that is: held" in text for text in section.text)


def test_a_damaged_film_is_as_one_that_is_missing(tmp_path: Path) -> None:
    run = a_run(tmp_path, "filmed", {"OpenDrawer": 1.0}, trials=2)
    data = gather([run])
    (result,) = data.policies[0].tasks
    film = run / "one.mp4"
    with VideoWriter(film, 10) as writer:
        for _ in range(12):
            writer.write(np.zeros((128, 384, 3), np.uint8))
    records = tuple(dataclasses.replace(record, video="one.mp4", success=True) for record in result.trials)
    found = dataclasses.replace(result, trials=records)
    policy = dataclasses.replace(data.policies[0], conditions={UNPERTURBED: (found,)})
    shown = dataclasses.replace(data, policies=(policy,))
    assert len(choose_films(shown)) == 1
    film.write_bytes(film.read_bytes()[:400])
    assert choose_films(shown) == []


@pytest.mark.parametrize(
    ("changes", "rates", "why"),
    [
        ({"split": "pretrain"}, None, "they differ in kitchens."),
        ({"render_preset": "quality"}, None, "they differ in rendering."),
        ({}, {"TurnOnStove": 0.5}, "they differ in tasks."),
        ({"seed": 1}, None, "they differ in seeds."),
        ({}, None, "their scenes are not the same ones."),
    ],
)
def test_policies_without_common_trials_are_said_to_have_none(
    changes: dict[str, Any], rates: dict[str, float] | None, why: str, tmp_path: Path
) -> None:
    old = a_run(tmp_path, "old", rates, trials=9, **changes)
    if why in ("they differ in seeds.", "their scenes are not the same ones."):
        lines = (old / TRIALS_FILE).read_text(encoding="utf-8")
        (old / TRIALS_FILE).write_text(lines.replace('"seed": 100', '"seed": 200'), encoding="utf-8")
    data = gather([old, a_run(tmp_path, "new", trials=9)])
    said = dict(summary.section(data).sentences)["Comparison"]
    assert said == f"new and old have no trial in common, so that nothing says which is better: {why}"
    assert comparison.section(data) is None
