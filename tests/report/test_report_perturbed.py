"""Trials under a perturbation are called so wherever they stand, and never taken for unperturbed ones."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import synthetic_runs

from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.lifelong_series import all_series
from robocasa_lerobot.evaluation.report.policies import same_trials
from robocasa_lerobot.evaluation.report.sections import comparison, data_efficiency, robustness

CALLED = "checkpoint (perturbed: camera)"


def make_run(folder: Path, *conditions: str, metres: float = 0.1, sets: int = 1, **labels: Any) -> Path:
    """A policy like a published one on the atomic tasks, as `--perturbation.names=CONDITIONS` leaves it."""
    own = {name: list(tasks) for name, tasks in published_task_sets().items() if name == "atomic_seen"}
    if labels.get("lifelong_phase"):
        own = {f"own_phase{k}": [f"Task{k}"] for k in range(1, sets + 1)}
    tasks = [task for members in own.values() for task in members]
    about = synthetic_runs.policy("checkpoint", type="groot", **labels)
    noise: dict[str, Any] = {name: {"camera_position_m": metres} if name == "camera" else {} for name in conditions}
    head = synthetic_runs.header(
        "paper", [about], tasks, task_sets=own, split="pretrain", trials=2, perturbations=noise
    )
    rates = dict.fromkeys(tasks, 0.5)
    trials = [t for name in conditions for t in synthetic_runs.trials(head, about.label, rates, 2, perturbation=name)]
    return synthetic_runs.write(folder, head, trials)


def make_report(*runs: Path) -> dict[str, str]:
    """The report's files by the ends of their names."""
    out = runs[0].parent / "report.html"
    assert main(["report", *map(str, runs), "--out", str(out), "--no-videos"]) == 0
    return {path.name.removeprefix("report"): path.read_text().replace("\\", "") for path in out.parent.glob("report*")}


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def test_perturbations_that_change_nothing_are_said_to_change_nothing(tmp_path: Path) -> None:
    data = gather([make_run(tmp_path / "run", "none", "camera", "joint")])
    same = [
        dataclasses.replace(policy, conditions=dict.fromkeys(policy.conditions, policy.conditions["none"]))
        for policy in data.policies
    ]
    said = robustness.sentence(dataclasses.replace(data, policies=tuple(same)))
    assert said == "None of 2 perturbations changes the success of checkpoint."
    assert "most" in str(robustness.sentence(data))
    # The greatest change is named, whichever way it goes.
    for one, other in (("none", "joint"), ("joint", "none")):
        conditions = [
            {name: policy.conditions[other if name == "joint" else one] for name in policy.conditions}
            for policy in data.policies
        ]
        changed = [dataclasses.replace(p, conditions=c) for p, c in zip(data.policies, conditions, strict=True)]
        assert "joint" in str(robustness.sentence(dataclasses.replace(data, policies=tuple(changed))))


def test_a_perturbation_alone_is_named_and_stands_beside_no_published_number(tmp_path: Path) -> None:
    report = make_report(make_run(tmp_path / "a/run", "camera"))
    text = report[".md"]
    assert f"\n{CALLED} solves" in text
    for said in (f"- **{CALLED}: ", "Perturbations: camera poses.", "| perturbations | camera |", f"| {CALLED} |"):
        assert said in text, said
    assert not [row for row in rows(report["_tables.csv"]) if row["policy"]]
    assert {row["published_rate"] for row in rows(report[".csv"])} == {""}
    assert "Published results stand beside ours" not in text
    assert '<section id="groups"' not in report[".html"]
    assert "best" not in report[".html"].partition('<table id="task-rates"')[2].partition("</thead>")[0]
    plain = make_report(make_run(tmp_path / "b/run", "none"))
    assert {row["table"] for row in rows(plain["_tables.csv"]) if row["policy"]} == {"multi_task"}
    assert "" not in {row["published_rate"] for row in rows(plain[".csv"]) if row["task"]}
    assert "Published results stand beside ours" in plain[".md"]
    assert not any(word in plain[".md"] for word in ("(perturbed", "Perturbations:", "| perturbations |"))


def test_policies_under_different_perturbations_are_not_compared(tmp_path: Path) -> None:
    plain, camera = make_run(tmp_path / "a", "none"), make_run(tmp_path / "b", "camera")
    data = gather([plain, camera])
    assert same_trials(*data.policies) == {}
    assert {policy.label for policy in data.policies} == {"checkpoint", CALLED}
    assert "have no trial in common" in (comparison.sentence(data) or "")
    assert comparison.section(data) is None
    again = gather([camera, make_run(tmp_path / "c", "camera")])
    assert len(same_trials(*again.policies)) == 18
    stronger = gather([camera, make_run(tmp_path / "d", "camera", metres=0.2)])
    assert same_trials(*stronger.policies) == {}
    # One run under both conditions pairs them with each other, and its unperturbed trials with those of others.
    both = gather([make_run(tmp_path / "e", "none", "camera"), plain])
    assert len(same_trials(*both.policies)) == 18
    assert robustness.section(both) is not None
    assert "changes the success" in str(robustness.sentence(both))
    assert not any("perturbed" in policy.label for policy in both.policies)


def test_curves_and_phases_hold_trials_of_one_perturbation(tmp_path: Path) -> None:
    only = [
        make_run(tmp_path / f"{share}", "none", demo_fraction=share, training_data="target only")
        for share in (0.1, 0.3, 1.0)
    ]
    camera = make_run(tmp_path / "camera", "camera", demo_fraction=0.1, training_data="pretraining + target")
    data = gather([*only, camera])
    assert [list(curve) for curve in data_efficiency.curves(data)] == [[50, 150, 500], []]
    section = data_efficiency.section(data)
    assert section is not None
    assert any("(perturbed: camera), all of whose trials are perturbed" in text for text in section.text)
    phases = [
        make_run(tmp_path / f"{k}-{name}", name, sets=k, lifelong_phase=k, experiment="own")
        for name in ("none", "camera")
        for k in (1, 2)
    ]
    series = all_series(gather(phases))
    assert {one.label: sorted(one.policies) for one in series} == {"own": [1, 2], "own (perturbed: camera)": [1, 2]}
