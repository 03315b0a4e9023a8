"""What is computed from stored runs, against numbers worked out by hand, and the page that shows them."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest
from evaluation_records import write_results
from source_tree import REPOSITORY

from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.study import costs
from robocasa_lerobot.study import stored as files
from robocasa_lerobot.study.page import write_page
from robocasa_lerobot.study.settings import PartConfig, RowConfig, StudyConfig
from robocasa_lerobot.study.stored import StoredRun, StoredTrial, read_stored
from robocasa_lerobot.study.tables import between_trainings, cell, difference, failure_terms, row_trials, summaries
from robocasa_lerobot.training.setup import builders

SETS = {"both": ["A", "B"], "first": ["A"], "second": ["B"]}
ABOUT = {
    "commit": "0123456789abcdef-dirty",
    "versions": {"torch": "1"},
    "machine": {"processor": "P", "cores": "2"},
    "device": "NVIDIA H200",
    "scale": None,
    "training_hours": 1.5,
    "trial_hours_of_one_process": 0.25,
}


def trials(phase: str, outcomes: dict[str, str], evaluation: str = "study_target") -> list[StoredTrial]:
    """A trial for each letter: `+` solved, `-` not."""
    return [
        StoredTrial(
            phase, evaluation, task, number, 100 + number, 1, 2, mark == "+", 50, "finished", ("open",) * (mark == "-")
        )
        for task, marks in outcomes.items()
        for number, mark in enumerate(marks)
    ]


def run(experiment: str, seed: int, *phases: list[StoredTrial]) -> StoredRun:
    curve = tuple((phase[0].phase, step, 1 / step) for phase in phases for step in (1, 2))
    return StoredRun(experiment, seed, tuple(trial for phase in phases for trial in phase), ABOUT, curve)


def row(experiment: str, phase: str = "train") -> RowConfig:
    return RowConfig(experiment, phase, "study_target")


PART = PartConfig("Which?", {"few": row("few"), "many": row("many")}, ["both", "first"], 2, tasks=True, reference="few")
RUNS = [
    run("few", 0, trials("train", {"A": "++--", "B": "----"})),
    run("few", 1, trials("train", {"A": "+---", "B": "----"})),
    run("many", 0, trials("train", {"A": "++++", "B": "++--"})),
    run("many", 1, trials("train", {"A": "+++-", "B": "+---"})),
    run("many", 2, trials("train", {"A": "++++", "B": "++++"})),  # a seed that the part does not have
]
STORED = {(one.experiment, one.seed): one for one in RUNS}


def test_rates_are_means_over_tasks_and_seeds() -> None:
    few, many = (row_trials(PART, name, STORED) for name in PART.rows)
    assert len(few) == len(many) == 16
    found = cell(many, SETS["both"])
    assert found is not None
    assert found.rate.value == pytest.approx((7 / 8 + 3 / 8) / 2)
    assert found.seeds == pytest.approx((0.75, 0.5))
    assert found.trials == 16
    assert cell(few, ["A", "C"]) is None, "a task that was not tried"
    apart = difference(many, few, SETS["both"])
    assert apart is not None
    assert apart.value == pytest.approx((4 / 8 + 3 / 8) / 2)
    assert apart.low < apart.value < apart.high
    assert difference(many, [], SETS["both"]) is None
    first = [pair for pair in few if pair[0] == 0]
    assert difference(many, first, SETS["both"]) is None, "more trainings than the other"
    one = [pair for pair in many if pair[0] == 0]
    assert difference(one, few, SETS["both"]) == difference(one, first, SETS["both"]), "of as many trainings as it has"
    assert failure_terms(few)[0] == ("B", "open", 8)


def test_a_row_has_more_trainings_than_its_part_where_it_says_so() -> None:
    more = PartConfig("Which?", {**PART.rows, "many": dataclasses.replace(row("many"), seeds=3)}, ["both"], 1)
    assert [more.seeds_of(name) for name in ("few", "many")] == [1, 3]
    found = {name: cell(row_trials(more, name, STORED), SETS["both"]) for name in more.rows}
    assert [len(one.seeds) for one in found.values() if one] == [1, 3]
    assert more.with_seeds(2).seeds_of("many") == 2
    # 0.75, 0.5 and 1, against their mean.
    deviation, rows = between_trainings([one.seeds for one in found.values() if one]) or (0.0, 0)
    assert rows == 1
    assert deviation == pytest.approx(0.25)
    assert between_trainings([one.seeds for one in found.values() if one][:1]) is None


def test_forgetting_of_two_phases() -> None:
    rows = {f"plain, after phase {k}": row("lifelong", f"phase{k}") for k in (1, 2)}
    part = PartConfig("What?", rows, ["first", "second"], 1, matrix=True)
    phases = [trials("phase1", {"A": "++++", "B": "+---"}), trials("phase2", {"A": "+---", "B": "++--"})]
    found = summaries(part, {("lifelong", 0): run("lifelong", 0, *phases)}, SETS)["plain"]
    assert found.forgetting[2].value == pytest.approx(0.75)
    assert found.average[2].value == pytest.approx((0.25 + 0.5) / 2)
    assert found.matrix[1][2].value == pytest.approx(0.25), "the next phase's tasks, before it"


def test_what_one_training_reached_is_not_compared_with_what_another_kept() -> None:
    rows = {f"plain, after phase {k}": row("lifelong", f"phase{k}") for k in (1, 2)}
    part = PartConfig("What?", rows, ["first", "second"], 2, matrix=True)
    whole = [trials("phase1", {"A": "++--", "B": "+---"}), trials("phase2", {"A": "+---", "B": "++--"})]
    begun = [trials("phase1", {"A": "++++", "B": "----"})]
    stored = {("lifelong", 0): run("lifelong", 0, *whole), ("lifelong", 1): run("lifelong", 1, *begun)}
    found = summaries(part, stored, SETS)["plain"]
    assert found.matrix[1][1].value == pytest.approx(0.5), "of the training that has ended"
    assert found.forgetting[2].value == pytest.approx(0.25)


def test_a_stored_run_comes_back_as_it_was(tmp_path: Path) -> None:
    one = RUNS[0].trials[0]
    kept = [one, dataclasses.replace(one, trial=1, layout_id=None, success=False, failed=("open", "let go"))]
    folder = files.stored_folder(tmp_path, "few", 0)
    folder.mkdir(parents=True)
    files._write_trials(folder / files.TRIALS, kept)
    (folder / files.CURVES).write_text("phase,step,loss\ntrain,1,0.5\n")
    assert read_stored(tmp_path, "few", 0) is None, "without its last file it has not ended"
    (folder / files.ABOUT).write_text('{"scale": null}')
    found = read_stored(tmp_path, "few", 0)
    assert found is not None
    assert list(found.trials) == kept
    assert found.curves == (("train", 1, 0.5),)
    packed = (folder / files.TRIALS).read_bytes()
    files._write_trials(folder / files.TRIALS, kept[::-1])
    assert (folder / files.TRIALS).read_bytes() == packed


def test_the_page_has_rates_differences_and_circumstances(tmp_path: Path) -> None:
    study = StudyConfig("r", "x", {"amount": PART, "later": PartConfig("When?", {"one": row("other")}, ["both"])})
    results, page = tmp_path / "results", tmp_path / "results.md"
    write_page(study, STORED, SETS, results, page)
    text = page.read_text(encoding="utf-8")
    assert "|many|62 % (" in text
    assert "|75, 50|+44 (" in text
    assert "|B|0 % (0 to 32)|38 % (" in text
    assert "4 of 4 trainings, 6.0 hours of training (on NVIDIA H200) and" in text
    assert "0123456789ab-dirty" in text
    assert "## In short\n\n- [Which?](#which) Most: many, 62 % (" in text, "the answers first"
    assert re.search(r"; against few: \+44 \(.*\)\.\n\n## Which\?\n", text)
    assert "Not run yet: `robocasa-lerobot study later`, with" in text
    drawn = (results / "amount_rates.svg").read_text(encoding="utf-8")
    assert "success rate at" in drawn, "of which tasks it is"
    for figure in ("amount_rates.svg", "amount_curves.svg"):
        assert f"(results/{figure})" in text
        assert (results / figure).read_text(encoding="utf-8").startswith("<?xml")
    before = (results / "amount_rates.svg").read_bytes()
    write_page(study, STORED, SETS, results, page)
    assert (results / "amount_rates.svg").read_bytes() == before
    small = {key: dataclasses.replace(one, about={**ABOUT, "scale": {"name": "tiny"}}) for key, one in STORED.items()}
    write_page(study, small, SETS, results, page)
    assert "these numbers mean nothing" in page.read_text(encoding="utf-8")


def test_the_table_of_phases(tmp_path: Path) -> None:
    rows = {f"plain, after phase {k}": row("lifelong", f"phase{k}") for k in (1, 2)}
    part = PartConfig("What?", rows, ["first", "second"], 1, matrix=True)
    phases = [trials("phase1", {"A": "++++", "B": "+---"}), trials("phase2", {"A": "+---", "B": "++--"})]
    stored = {("lifelong", 0): run("lifelong", 0, *phases)}
    write_page(StudyConfig("r", "x", {"lifelong": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    reached = "plain: the earlier phases reached 100 % (51 to 100), and after the last one 25 % (5 to 70), 25 % ("
    assert reached in text
    assert " of it, from one training." in text
    assert "|plain|38 % (" in text
    drawn = (tmp_path / "results" / "lifelong_rates.svg").read_text(encoding="utf-8")
    for words in ("plain", "after phase 2", "tasks of phase", "100 %", "25 %", "50 %"):
        assert f"<!-- {words} -->" in drawn, "a map of all phases, not of the first one's tasks alone"


def test_a_phase_that_variants_share_counts_once_among_trainings(tmp_path: Path) -> None:
    """The mean of both columns of phase 1 is 50 % and 25 %, of phase 2 it is 25 % of the one training that has it."""
    rows = {"plain, after phase 1": row("lifelong", "phase1"), "plain, after phase 2": row("lifelong", "phase2")}
    rows |= {"replay, after phase 1": row("lifelong", "phase1"), "replay, after phase 2": row("lifelong", "replay")}
    part = PartConfig("What?", rows, ["first", "second"], 3, matrix=True)
    first = [{"A": "++++", "B": "----"}, {"A": "++--", "B": "----"}]
    stored = {}
    for seed, outcomes in enumerate(first):
        phases = [trials("phase1", outcomes), trials("phase2", {"A": "----", "B": "++--"})]
        phases += [trials("replay", {"A": "+---", "B": "++--"})][:seed]
        stored["lifelong", seed] = run("lifelong", seed, *phases)
    write_page(StudyConfig("r", "x", {"lifelong": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    # Phase 1: 50 and 25 points, a variance of 312.5; phase 2: none.
    assert "differ by 12 points (standard deviation, from 2 rows, each the mean of its columns)." in text
    assert "|each training, first|" in text
    assert re.search(r"- plain: the earlier phases reached .*, from 2 of 3 trainings\.", text)
    assert re.search(r"- replay: the earlier phases reached .*, from one training\.", text)


def test_two_rows_say_how_many_trainings_they_rest_on(tmp_path: Path) -> None:
    part = dataclasses.replace(PART, reference=None, seeds=3)
    stored = {key: one for key, one in STORED.items() if key != ("few", 1)}
    write_page(StudyConfig("r", "x", {"some": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert re.search(r"few: 25 % \(.*\) of both, from one training\. many: 75 % \(.*\) of both\.\n", text)
    assert "the same in all rows with the same evaluation" in text.replace("\n", " ")


def test_rows_that_reach_as_much_are_named_together(tmp_path: Path) -> None:
    rows = {name: row(name) for name in ("few", "many", "more")}
    part = PartConfig("Which?", rows, ["both"], 1, reference="few")
    own = [run(name, 0, trials("train", {"A": "++--", "B": "+---"})) for name in ("many", "more")]
    stored = {(one.experiment, one.seed): one for one in (RUNS[0], *own)}
    write_page(StudyConfig("r", "x", {"some": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert re.search(r"\nMost: many, 38 % \(.*\), as much as more; against few: \+12 \(", text)


def phase_with_trials(folder: Path, steps: int, evaluation: str, finished: bool = True) -> None:
    """What a training leaves of a phase that has ended, with a trial of an evaluation and one in a perturbed scene."""
    line = {"step": steps, "loss": 0.5, "seconds_per_step": 0.1}
    out = folder / "evaluations" / evaluation
    write_results(out, [{"trial": 3}, {"trial": 3, "perturbation": "camera"}])
    (folder / "metrics.jsonl").write_text(json.dumps(line) + "\n")
    (folder / "phase.json").write_text(json.dumps({"device": "cpu"}))
    if finished:
        (out / "finished").touch()


def test_phases_are_stored_as_they_end(tmp_path: Path) -> None:
    run = files.Run("lifelong", 0, tmp_path, configs_folder())
    run.write_file()
    results = tmp_path / "results"
    with pytest.raises(UserError, match="lifelong/seed_0: none of its phases has ended"):
        files.store(run, results)
    steps = run.config.phases[0].steps
    phase_with_trials(run.folder / "phase1", steps, "study_validation")
    phase_with_trials(run.folder / "phase2", steps, "study_validation", finished=False)
    phase_with_trials(run.folder / "phase3", steps - 1, "study_validation")
    files.store(run, results)
    found = read_stored(results, "lifelong", 0)
    assert found is not None
    assert found.about["steps"] == {"phase1": steps}
    assert found.phases == ("phase1",)
    assert [(one.phase, one.trial) for one in found.trials] == [("phase1", 3)]
    assert files.stands_for(found.about, run)
    assert not files.is_stored(run, results), "the others are still to be trained"
    assert not files.stands_for({**found.about, "steps": {"phase1": steps - 1}}, run), "of other lengths"
    assert not files.stands_for({**found.about, "scale": "tiny"}, run)
    assert not files.stands_for({**found.about, "device": "NVIDIA H200"}, run)


def test_what_was_kept_stays_where_its_folder_is_gone(tmp_path: Path) -> None:
    run = files.Run("lifelong", 1, tmp_path, configs_folder())
    run.write_file()
    results = tmp_path / "results"
    steps, every = run.config.phases[0].steps, [phase.name for phase in run.config.phases]
    assert files.phases_left(run, results) == dict.fromkeys(every, True)
    for name in every[:-2]:
        phase_with_trials(run.folder / name, steps, "study_validation")
    files.store(run, results)
    # With what the two that are left build on, whose trials are kept.
    left = {"phase1": False, "lora_phase2": False, "lora_phase3": True, "lora_phase4": True}
    assert files.phases_left(run, results) == left
    assert [words[2:] for words in run.commands(1, left)[1:]] == [
        [f"--phase={name}", *["--evaluate"] * tried] for name, tried in left.items()
    ]
    shutil.rmtree(run.folder)
    phase_with_trials(run.folder / "phase1", steps, "study_validation", finished=False)
    phase_with_trials(run.folder / "lora_phase3", steps, "study_validation")
    for _ in range(2):  # the second time there is nothing new
        files.store(run, results)
        found = read_stored(results, "lifelong", 1)
        assert found is not None
        assert found.phases == tuple(every[:-1])
        assert [trial.phase for trial in found.trials] == sorted(every[:-1])
        assert found.about["phases"] == ["lora_phase3"]
        hours = [about["training_hours"] for about in files.circumstances(found.about)]
        assert hours == [pytest.approx(steps * 0.1 * trained / 3600, abs=0.001) for trained in (1, len(every) - 2)]
    phase_with_trials(run.folder / "lora_phase4", steps, "study_validation")
    files.store(run, results)
    assert files.is_stored(run, results)
    assert files.phases_left(run, results) == {}


def test_a_policy_that_is_corrected_is_trained_again_where_it_is_gone(tmp_path: Path) -> None:
    run = files.Run("corrections", 0, tmp_path, configs_folder())
    run.write_file()
    results = tmp_path / "results"
    for phase in run.config.phases:
        if phase.name != "corrected":
            phase_with_trials(run.folder / phase.name, phase.steps, "study_target")
    files.store(run, results)
    assert files.phases_left(run, results) == {"train": False, "corrected": True}


def test_a_run_without_a_device_of_its_own_is_of_the_machine_s(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = files.Run("multitask", 0, tmp_path, configs_folder())
    anywhere = dataclasses.replace(run.config, device=None)
    run.__dict__["config"] = anywhere  # as of a file that names none
    about = {"scale": None, "episodes": None, "steps": {"multitask": anywhere.phases[0].steps}}
    for here, trained_on in (("cpu", "cpu"), ("cuda", "NVIDIA H200")):
        monkeypatch.setattr(builders, "best_device", lambda wanted, here=here: here)
        assert files.stands_for({**about, "device": trained_on}, run)
        assert not files.stands_for({**about, "device": "cpu" if here == "cuda" else "NVIDIA H200"}, run)


def test_a_matrix_of_what_was_not_tried_says_so(tmp_path: Path) -> None:
    rows = {f"plain, after phase {k}": row("lifelong", f"phase{k}") for k in (1, 2)}
    part = PartConfig("What?", rows, ["first", "second"], 1, matrix=True)
    phases = [trials("phase1", {"A": "++++"}), trials("phase2", {"B": "++--"})]  # not the first phase's tasks again
    stored = {("lifelong", 0): run("lifelong", 0, *phases)}
    write_page(StudyConfig("r", "x", {"lifelong": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    assert "plain: not run to its end yet." in (tmp_path / "page.md").read_text(encoding="utf-8")


def test_phases_of_no_common_training_are_drawn_as_rates(tmp_path: Path) -> None:
    rows = {f"plain, after phase {k}": row("lifelong", f"phase{k}") for k in (1, 2)}
    part = PartConfig("What?", rows, ["first", "second"], 2, matrix=True)
    stored = {
        ("lifelong", seed): run("lifelong", seed, trials(f"phase{seed + 1}", {"A": "++--", "B": "+---"}))
        for seed in (0, 1)
    }
    write_page(StudyConfig("r", "x", {"lifelong": part}), stored, SETS, tmp_path / "results", tmp_path / "page.md")
    assert "plain: not run to its end yet." in (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "success rate at first" in (tmp_path / "results" / "lifelong_rates.svg").read_text(encoding="utf-8")


def test_fewer_tasks_than_rows_are_the_columns(tmp_path: Path) -> None:
    for sets, head, line in ((["first"], "||A|", "|few|38 % ("), (["both", "first"], "|task|few|many|", "|A|38 % (")):
        part = dataclasses.replace(PART, sets=sets)
        write_page(StudyConfig("r", "x", {"some": part}), STORED, SETS, tmp_path / "results", tmp_path / "page.md")
        lines = (tmp_path / "page.md").read_text(encoding="utf-8").splitlines()
        assert lines[lines.index(head) + 2].startswith(line)


def test_hours_of_trials_are_told_as_those_of_the_stored_runs_were() -> None:
    results = REPOSITORY / "docs" / "results"
    stored = [read_stored(results, file.parts[-3], int(file.parts[-2][5:])) for file in results.glob("*/*/about.json")]
    assert len(stored) > 20, "results of the study lie in docs/results"
    steps = horizons = seconds = 0.0
    for found in stored:
        assert found is not None
        steps += sum(trial.steps for trial in found.trials)
        horizons += sum(get_task(trial.task).horizon for trial in found.trials)
        seconds += 3600 * found.about["trial_hours_of_one_process"]
    assert costs.PART_OF_HORIZON == pytest.approx(steps / horizons, rel=0.1)
    assert costs.TRIAL_STEPS_PER_SECOND == pytest.approx(steps / seconds, rel=0.3)
