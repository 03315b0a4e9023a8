"""What a report says of tasks, phases and evaluations that were left out, and how equal labels are told apart."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
import synthetic_runs
from evaluation_records import header, record, write_results

from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.records.results import RunHeader, TrialRecord
from robocasa_lerobot.evaluation.report import left_out, output
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.policies import ReportData
from robocasa_lerobot.evaluation.report.sections import lifelong, summary
from robocasa_lerobot.training.planning import skipped
from robocasa_lerobot.training.planning.skipped import Skipped


def test_what_a_training_left_out_and_what_a_run_lacks_is_said(tmp_path: Path) -> None:
    out = tmp_path / "out"
    lines = [
        Skipped("phase", "phase2", None, "none of its 20 tasks is in this version yet."),
        Skipped("evaluation", "phase1", "robustness", "it ended with status 2"),
        Skipped("partial", "phase1", "paper", "partial: its run says so itself"),
    ]
    skipped.record(out, lines)
    sets = {"task_sets": {"atomic_seen": ["OpenDrawer"], "composite_seen": []}}
    lacking = {"missing_tasks": ["WashLettuce"], "missing_by_set": {"composite_seen": ["WashLettuce"]}}
    one = dataclasses.replace(header(experiment="lifelong"), **sets, **lacking)
    folder = out / "phase1/evaluations/paper"
    folder.mkdir(parents=True)
    for item in (one, *(record(run=one.id, trial=t, seed=t) for t in range(3))):
        trials_file.append(folder / results.TRIALS_FILE, item)
    output.write_report([folder], out=folder / "report.html")
    text = (folder / "report.md").read_text()
    for said in (
        "lifelong: phase phase2 is left out: none of its 20 tasks is in this version yet.",
        "lifelong: evaluation robustness of phase phase1 is left out: it ended with status 2.",
        "finetune-000400: partial: without 1 of 1 tasks of composite",
        "of a partial run", "1 task · partial",
    ):  # fmt: skip
        assert said in text.replace("\\", "")
    assert "its run says so itself" not in text
    skipped.record(out, [])
    output.write_report([folder], out=folder / "report.html")
    assert "What was left out" not in (folder / "report.md").read_text()


def test_equal_labels_are_told_apart_by_as_much_of_their_folders_as_it_takes(tmp_path: Path) -> None:
    places = [tmp_path / name / "atomic/evaluations/foundation" for name in ("a", "b")]
    folders = [write_results(place, [{"label": "x", "trial": t} for t in range(2)]) for place in places]
    assert [p.label for p in gather(folders).policies] == [
        "x (a/atomic/evaluations/foundation)", "x (b/atomic/evaluations/foundation)",
    ]  # fmt: skip


def killed(folder: Path, heads: list[RunHeader], trials: list[TrialRecord]) -> ReportData:
    folder.mkdir(parents=True)
    for item in (*heads, *trials):
        trials_file.append(folder / results.TRIALS_FILE, item)
    return gather([folder])


def test_a_run_that_was_killed_says_what_it_has_not_done(tmp_path: Path) -> None:
    tasks = ["OpenDrawer", "CloseDrawer", "TurnOnStove"]
    about = [synthetic_runs.policy(label) for label in ("first", "second")]
    head = synthetic_runs.header("custom", about, tasks, task_sets={}, trials=6)
    whole = synthetic_runs.trials(head, "first", dict.fromkeys(tasks, 0.5), 6)
    data = killed(tmp_path / "killed", [head], whole[:8])
    assert "of a partial run" in summary.headline(data)
    assert left_out.partial_runs(data) == (
        "first: unfinished: 8 of 18 planned trials are recorded, and 1 of 3 tasks has none; the command that made it "
        "goes on where it stopped. second: planned, and none of its trials is recorded."
    )
    output.write_report([tmp_path / "killed"], out=tmp_path / "report.html")
    said = (tmp_path / "report.md").read_text()
    assert "2 tasks · partial)" in said
    assert "second: planned, and none of its trials is recorded" in said
    complete = killed(tmp_path / "complete", [head], [*whole, *synthetic_runs.trials(head, "second", {}, 6)])
    assert "partial" not in summary.headline(complete)
    assert left_out.partial_runs(complete) == "second: planned, and none of its trials is recorded."
    # More or fewer trials in the same folder later: the last plan of a task counts.
    heads = [dataclasses.replace(head, policies={"first": about[0]}, tasks=tasks[:1], trials=n) for n in (6, 9)]
    six = [dataclasses.replace(record, run=heads[0].id) for record in whole[:6]]
    assert "6 of 9" in str(left_out.partial_runs(killed(tmp_path / "more", heads, six)))
    assert left_out.partial_runs(killed(tmp_path / "fewer", heads[::-1], six)) is None


@pytest.fixture
def phases(tmp_path: Path) -> tuple[RunHeader, list[TrialRecord]]:
    """A whole lifelong run of three checkpoints in one file."""
    sets = {"own_phase1": ["A", "B", "C"], "own_phase2": ["D", "E"], "own_phase3": ["F"]}
    about = [synthetic_runs.policy(f"phase{k}", experiment="own", lifelong_phase=k) for k in (1, 2, 3)]
    tasks = [task for members in sets.values() for task in members]
    head = synthetic_runs.header("lifelong", about, tasks, task_sets=sets, trials=4)
    records = []
    for k, one in enumerate(about, start=1):
        own = [task for members in list(sets.values())[:k] for task in members]
        records += synthetic_runs.trials(head, one.label, dict.fromkeys(own, 0.5), 4)
    return head, records


def test_a_lifelong_run_plans_the_tasks_of_its_policies_phases(
    phases: tuple[RunHeader, list[TrialRecord]], tmp_path: Path
) -> None:
    head, records = phases
    data = killed(tmp_path / "whole", [head], records)
    assert left_out.partial_runs(data) is None
    assert "After phase 3 the policy solves" in summary.headline(data)
    assert "partial" not in summary.headline(data)
    # A label alone: all policies run all tasks.
    everywhere = synthetic_runs.trials(head, "phase1", dict.fromkeys(head.tasks[:5], 0.5), 4)
    rest = [r for r in records if r.label != "phase1"]
    assert "phase1: unfinished: 20 of 24" in str(
        left_out.partial_runs(killed(tmp_path / "label", [head], [*everywhere, *rest]))
    )


def test_columns_of_the_lifelong_matrix_compare_the_same_tasks(
    phases: tuple[RunHeader, list[TrialRecord]], tmp_path: Path
) -> None:
    head, records = phases
    # The longest horizons come first: of the last policy's tasks B and C of the first phase are missing.
    some = [r for r in records if r.label != "phase3" or r.task not in ("B", "C")]
    data = killed(tmp_path / "killed", [head], some)
    found = lifelong.matrix(data)
    assert found is not None
    assert {k: set(row) for k, row in found.matrix.items()} == {1: {1}, 2: {1, 2}, 3: {2, 3}}
    assert set(found.average) == {1, 2}
    assert set(found.forgetting) == {2}
    assert found.backward_transfer is None
    section = lifelong.section(data)
    assert section is not None
    assert any("phase 3 on the tasks of phase 1 (1 of 3 were run)" in text for text in section.text)
    headline = summary.headline(data)
    assert "After phase 2 the policy solves" in headline
    assert headline.endswith("phase 3 was not evaluated on all tasks. Some of the runs are partial.")
    # Two commands with different tasks: what both have is compared, and a policy with fewer has no cell.
    fewer = dataclasses.replace(head, tasks=[task for task in head.tasks if task != "B"])
    asked = [dataclasses.replace(r, run=fewer.id) for r in records if r.label == "phase2" and r.task != "B"]
    one = synthetic_runs.write(tmp_path / "one", head, [r for r in records if r.label == "phase1"])
    two = synthetic_runs.write(tmp_path / "two", fewer, asked)
    found = lifelong.matrix(gather([one, two]))
    assert found is not None
    assert {k: set(row) for k, row in found.matrix.items()} == {1: {1}, 2: {2}}
