"""What a report says of tasks, phases and evaluations that were left out, and how equal labels are told apart."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from evaluation_records import header, record, write_results

from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.report import output
from robocasa_lerobot.evaluation.report.gather import gather
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
