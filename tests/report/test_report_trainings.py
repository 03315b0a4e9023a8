"""What a report puts together, pairs and averages, and what it does not: policies of several runs and trainings."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import synthetic_runs
from evaluation_records import write_results

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.config.evaluation import KITCHEN_ENV_FACTORY, EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.report import output
from robocasa_lerobot.evaluation.report.formats import tidy_csv
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.lifelong_series import all_series
from robocasa_lerobot.evaluation.report.model import Figure
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData, describe_policy, same_trials
from robocasa_lerobot.evaluation.report.sections import comparison, data_efficiency, lifelong

ATOMIC = [task for task, group in synthetic_runs.GROUPS.items() if group == "atomic_seen"]
SETS = {"own_phase1": ["A", "B"], "own_phase2": ["C"]}


def run(folder: Path, label: str, tasks: list[str], sets: dict[str, list[str]] | None = None, **about: Any) -> Path:
    """A run of one policy, four trials of each task."""
    one = synthetic_runs.policy(label, **about)
    changes: dict[str, Any] = {} if sets is None else {"task_sets": sets}
    head = synthetic_runs.header("custom", [one], tasks, trials=4, **changes)
    return synthetic_runs.write(folder / label, head, synthetic_runs.trials(head, label, dict.fromkeys(tasks, 0.5), 4))


def test_the_tidy_file_has_no_average_of_a_part_of_a_set(tmp_path: Path) -> None:
    def groups(tasks: list[str], **sets: list[str]) -> set[str]:
        data = gather([run(tmp_path / f"{len(tasks)}-{len(sets)}", "one", tasks, sets or None)])
        return {row["group"] for row in csv.DictReader(tidy_csv.render(data).splitlines()) if not row["task"]}

    assert groups(ATOMIC) == {"all", "atomic_seen"}
    assert groups(ATOMIC[:-1]) == {"all"}
    assert groups(["A", "B"], own=["A", "B"]) == {"all", "own"}
    assert groups(["A"], own=["A", "B"], other=["A"]) == {"all", "other"}
    assert groups(["A", "B", "C"], lifelong_phase1=["A", "B"]) == {"all"}, "not those of the benchmark"


def test_single_points_of_several_experiments_make_a_curve_and_the_section_says_so(tmp_path: Path) -> None:
    given = [("target only", 0.1), ("target only", 0.3), ("pretraining + target", 0.1)]
    runs = [
        run(tmp_path, f"p{number}", ATOMIC, experiment=f"mine{number}", demo_fraction=share, training_data=data)
        for number, (data, share) in enumerate(given)
    ]
    data = gather(runs)
    assert [list(side) for side in data_efficiency.curves(data)] == [[50, 150], [50]]
    section = data_efficiency.section(data)
    assert section is not None
    assert any("The points of mine0 + mine1 are of several experiments" in text for text in section.text)
    # Other data, or another type of policy, is another curve.
    labels: dict[str, Any] = {"experiment": "mine3", "demo_fraction": 1.0}
    other = run(tmp_path, "p3", ATOMIC, type="other", training_data="target only", **labels)
    assert [list(side) for side in data_efficiency.curves(gather([*runs, other]))] == [[50, 150], [50]]
    other = run(tmp_path, "p4", ATOMIC, training_data="other data", **labels)
    assert [list(side) for side in data_efficiency.curves(gather([*runs, other]))] == [[50, 150], [50]]


def test_a_policy_with_more_tasks_than_the_others_takes_no_curve_away(tmp_path: Path) -> None:
    def labelled(number: int, tasks: list[str], pretrained: bool, share: float) -> Path:
        kind = ("scratch", "target only") if not pretrained else ("tuned", "pretraining + target")
        about = {"experiment": kind[0], "training_data": kind[1], "demo_fraction": share, "phase": f"p{number}"}
        return run(tmp_path, f"p{number}", tasks, **about)

    cases = [(share, pretrained) for share in (0.1, 0.3, 1.0) for pretrained in (False, True)]
    runs = [labelled(number, ATOMIC[:2], pretrained, share) for number, (share, pretrained) in enumerate(cases)]
    before = data_efficiency.sentence(gather(runs))
    assert before is not None
    everywhere = [task for task, group in synthetic_runs.GROUPS.items() if group != "composite_unseen"]
    for number, more in enumerate((ATOMIC, everywhere), start=7):
        data = gather([*runs, labelled(number, more, True, 0.0)])
        assert data_efficiency.sentence(data) == before
        section = data_efficiency.section(data)
        assert section is not None
        titles = [part.title for part in section.parts if isinstance(part, Figure)]
        assert titles == ["Atomic, 2 of 18 tasks"]
        told = [text for text in section.text if "no curve, since no 3 of these policies have tasks of it" in text]
        assert [text.partition(":")[0] for text in told] == (["Composite, seen"] if more == everywhere else [])
    # No tasks in common at all: the section says why there is nothing to see.
    apart = [labelled(20 + number, [ATOMIC[number]], False, share) for number, share in enumerate((0.1, 0.3, 1.0))]
    output.write_report(apart, out=tmp_path / "report.html")
    assert "Atomic: no curve, since no 3 of these policies" in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_phases_of_several_trainings_make_a_matrix_with_the_untrained_policy(tmp_path: Path) -> None:
    tasks = [task for members in SETS.values() for task in members]
    runs = [
        run(tmp_path, f"p{k}", tasks, SETS, experiment=f"mine{k}" if k else None, lifelong_phase=k) for k in (0, 1, 2)
    ]
    data = gather(runs)
    assert [(one.label, list(one.policies)) for one in all_series(data)] == [("mine1 + mine2", [0, 1, 2])]
    found = lifelong.matrix(data)
    assert found is not None
    assert found.forward_transfer is not None
    assert list(found.matrix) == [1, 2]
    section = lifelong.section(data)
    assert section is not None
    assert any("policies of several trainings" in text for text in section.text)
    assert "before lifelong phase 1" in describe_policy(data.policies[0])
    # A training with several phases takes the untrained policy, and no phase of another training.
    own = [run(tmp_path, f"own{k}", tasks, SETS, experiment="own", lifelong_phase=k) for k in (1, 2)]
    series = {one.label: list(one.policies) for one in all_series(gather([*runs, *own]))}
    assert series == {"own": [0, 1, 2], "mine1": [1], "mine2": [2]}


def test_phase_0_is_a_label_that_can_be_given() -> None:
    given = ["--policy.path=zero,random", "--env.task_sets=lifelong_phase1", "--policy.lifelong_phase=0,1"]
    config = load_config(EvaluationConfig, given)
    assert config.policy.lifelong_phase == [0, 1]
    assert config.first_sets is None


def test_trials_of_other_simulators_and_other_kitchens_are_not_paired(tmp_path: Path) -> None:
    def policy(name: str, **changes: Any) -> PolicyResult:
        return gather([write_results(tmp_path / name, [{"trial": t, **changes} for t in range(3)])]).policies[0]

    def elsewhere(**settings: Any) -> PolicyResult:
        head = dataclasses.replace(one.header, settings={**one.header.settings, **settings})
        return dataclasses.replace(one, headers=(head,))

    one = policy("one")
    assert len(same_trials(one, policy("again"))["OpenDrawer"][0]) == 3
    assert len(same_trials(one, policy("unknown", layout_id=None))["OpenDrawer"][0]) == 3
    assert same_trials(one, policy("moved", layout_id=2)) == {}
    assert same_trials(one, elsewhere(factory=KITCHEN_ENV_FACTORY))
    others: list[dict[str, Any]] = [
        {"factory": "other:make"},
        {"simulator": {"adapter": "0"}},
        {"options": {"robot": "Sawyer"}},
    ]
    for settings in others:
        assert same_trials(one, elsewhere(**settings)) == {}
        assert same_trials(elsewhere(**settings), elsewhere(**settings))


def pair(tmp_path: Path, solved: dict[str, tuple[int, int, int]]) -> ReportData:
    """Two policies: of each task so many trials, of which A alone and B alone solved the first ones."""
    runs = []
    for side, label in enumerate("ab"):
        lines: list[dict[str, Any]] = []
        for task, (trials, only_a, only_b) in solved.items():
            mine = (range(only_a), range(only_a, only_a + only_b))[side]
            for t in range(trials):
                first = 80 if t in mine else None
                lines.append(
                    {"label": label, "task": task, "trial": t, "success": t in mine, "first_success_step": first}
                )
        runs.append(write_results(tmp_path / label, lines))
    return gather(runs)


def test_no_verdict_where_trials_and_tasks_point_different_ways(tmp_path: Path) -> None:
    said = str(comparison.sentence(pair(tmp_path / "agree", {"Large": (40, 0, 20), "Small": (2, 0, 1)})))
    assert "b is better than a by 50.0 points" in said
    said = str(comparison.sentence(pair(tmp_path / "disagree", {"Large": (40, 0, 20), "Small": (2, 2, 0)})))
    assert said.startswith("b and a cannot be ranked, since the tasks disagree")
    assert "better than" not in said


def test_learning_curves_are_found_of_policies_that_are_one_row(tmp_path: Path) -> None:
    """Two phases of a training, each for its own tasks, are joined; their training is one."""
    runs = []
    for task in ("OpenDrawer", "CloseDrawer"):
        phase = tmp_path / "out" / f"finetune_{task}"
        checkpoint = phase / "checkpoints/000400/pretrained_model"
        checkpoint.mkdir(parents=True)
        (phase / "metrics.jsonl").write_text('{"step": 1, "loss": 0.5}\n{"step": 2, "loss": 0.25}\n')
        policy = {"path": str(checkpoint), "phase": phase.name, "experiment": "mine", "training_data": "target only"}
        runs.append(
            write_results(phase / "evaluations/own", [{"policy": policy, "task": task, "trial": t} for t in range(2)])
        )
    (joined,) = gather(runs).policies
    assert len(joined.parts) == 2
    assert main(["report", *map(str, runs), "--out", str(tmp_path / "report.html"), "--no-videos"]) == 0
    text = (tmp_path / "report.html").read_text()
    assert 'id="learning-1-1-numbers"' in text
    assert 'id="learning-1-2-numbers"' in text
    assert "learning-2" not in text


def test_results_files_of_any_name_are_reported_beside_them(tmp_path: Path) -> None:
    files = []
    for label, success in (("a", True), ("b", False)):
        outcome = {"success": success, "first_success_step": 80 if success else None}
        folder = write_results(tmp_path / label, [{"trial": t, **outcome} for t in range(3)])
        files.append((folder / "trials.jsonl").rename(tmp_path / f"run_{label}.jsonl"))
    assert main(["report", *map(str, files), "--no-videos"]) == 0
    text = (tmp_path / "report.md").read_text().replace("\\", "")
    assert "finetune-000400 (run_a.jsonl)" in text
    assert "finetune-000400 (run_b.jsonl)" in text
    found = {policy.label: policy for policy in gather(files).policies}
    assert {policy.folder for policy in found.values()} == {tmp_path}, "where films are looked for"
