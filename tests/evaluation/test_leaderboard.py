"""Submissions: only runs that follow the protocol, only files that fit the schema."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
import synthetic_runs

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.leaderboard import protocol
from robocasa_lerobot.evaluation.leaderboard.submission import SubmissionFacts, overall, problems
from robocasa_lerobot.evaluation.records.results import RunHeader, TrialRecord
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.policies.origin import Origin

FACTS = ("--model-name", "Test", "--batch-size", "128", "--num-training-steps", "1000")
RATES = {"atomic_seen": 43.0, "composite_seen": 9.6, "composite_unseen": 4.4}


def make_run(
    folder: Path, header: dict[str, Any] | None = None, trial: dict[str, Any] | None = None, n: int = 50
) -> Path:
    """A run that follows the protocol but for `header` and `trial`; its trials are made, which only its fields say."""
    tasks = list(synthetic_runs.GROUPS)
    changes = {"split": "pretrain", "trials": n, "settings": {}, **(header or {})}
    policies = changes.pop("policies", {"p": synthetic_runs.policy("p")})
    head = synthetic_runs.header("leaderboard", list(policies.values()), tasks, **changes)
    records = synthetic_runs.trials(head, "p", synthetic_runs.scaled(RATES, tasks), n)
    whole = {"outcome": "finished", "error": None, "attempts": 1, "first_outcome": None, "first_error": None}
    return synthetic_runs.write(folder, head, [dataclasses.replace(r, **{**whole, **(trial or {})}) for r in records])


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_run(tmp_path_factory.mktemp("runs") / "good")


def test_a_run_by_the_protocol_becomes_a_submission(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "submission.json"
    assert main(["leaderboard", str(good), "-o", str(out), *FACTS, "--notes", "Eight GPUs."]) == 0
    values = json.loads(out.read_text())
    assert problems(values) == []
    successes: dict[str, list[bool]] = {}
    for result in gather([good]).policies[0].tasks:
        successes.setdefault(synthetic_runs.GROUPS[result.task], []).extend(r.success for r in result.trials)
    for group, own in successes.items():
        assert values[f"{group}_success"] == pytest.approx(100 * sum(own) / len(own), abs=0.006)
    assert values["training_config"] == {"batch_size": 128, "num_training_steps": 1000}
    assert values["notes"].startswith("Eight GPUs. Evaluated in robocasa_lerobot's kitchens")
    assert "not comparable one to one" in values["notes"]
    assert "not RoboCasa's simulator" in values["robocasa_version"]
    assert (values["submission_source"], values["open_source"], values["paper_link"]) == ("external", "yes", "N/A")
    assert f"overall {overall(values)} %" in capsys.readouterr().out
    assert main(["leaderboard", "--check", str(out)]) == 0


def test_each_fact_that_is_given_stands_in_the_submission(good: Path, tmp_path: Path) -> None:
    out = tmp_path / "submission.json"
    asked = {
        "model_name": "Test", "policy_family": "VLA", "date": "2026-01-31", "submission_source": "internal",
        "open_source": "no", "code_url": "https://example.org/code", "checkpoint_url": "https://example.org/weights",
        "paper_link": "https://example.org/paper", "commit_hash": "0123abc", "wandb": "https://example.org/runs",
        "batch_size": 64, "num_training_steps": 9, "notes": "Eight GPUs.",
    }  # fmt: skip
    assert asked.keys() == {field.name for field in dataclasses.fields(SubmissionFacts)}
    words = [f"--{name.replace('_', '-')}={value}" for name, value in asked.items()]
    assert main(["leaderboard", str(good), "-o", str(out), *words]) == 0
    values = json.loads(out.read_text())
    assert values["notes"].startswith("Eight GPUs. ")
    found = {**values, **values["training_config"]}
    assert {name: found[name] for name in asked} == {**asked, "notes": values["notes"]}
    assert main(["leaderboard", "--check", str(out)]) == 0


@pytest.mark.parametrize(
    ("header", "trial", "reason"),
    [
        ({"split": "target"}, {"split": "target"}, "split is 'target'"),
        ({"horizon_multiplier": 1.5}, {}, "1.5 times"),
        ({"horizon_rule": "fixed"}, {}, "horizons are 'fixed'"),
        ({"success_rule": "hold", "success_hold_steps": 10}, {}, "'hold' for 10 step"),
        ({"success_rule": "at_end"}, {}, "'at_end'"),
        ({"settings": {"synthetic": True}}, {}, "synthetic"),
        ({}, {"seed": 7}, "seeds were used twice"),
        ({}, {"split": "target"}, "trials are not in 'pretrain' scenes"),
        ({}, {"perturbation": "camera"}, "no unperturbed trials"),
        (
            {},
            {"success": False, "first_success_step": None, "outcome": "hung", "error": "hung"},
            "trials ended in an error",
        ),
        *(
            ({"policies": {"p": synthetic_runs.policy("p", path=path, type=kind)}}, {}, f"reference policy ({path})")
            for kind, path in (("demonstrator", "demonstrator"), ("replay", "replay:demos.hdf5"))
        ),
    ],
)
def test_a_run_that_breaks_a_rule_is_refused_with_the_reason(
    header: dict[str, Any], trial: dict[str, Any], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = make_run(tmp_path / "run", header, trial, n=2)
    out = tmp_path / "submission.json"
    assert main(["leaderboard", str(run), "-o", str(out), *FACTS]) == 2
    assert reason in capsys.readouterr().err
    assert not out.exists()


def test_too_few_trials_and_missing_tasks_are_named(good: Path, tmp_path: Path) -> None:
    policy = gather([good]).policies[0]
    assert protocol.reasons(policy) == []
    shorter = dataclasses.replace(policy.tasks[3], trials=policy.tasks[3].trials[:49])
    for tasks, reason in (
        (policy.tasks[1:], "1 of the 50 tasks are missing: TurnOnElectricKettle"),
        ((*policy.tasks[:3], shorter, *policy.tasks[4:]), f"fewer than 50 trials: {policy.tasks[3].task} (49)"),
    ):
        (found,) = protocol.reasons(dataclasses.replace(policy, conditions={"none": tasks}))
        assert found == reason


def test_facts_that_are_missing_or_wrong_are_named(
    good: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "s.json")
    assert main(["leaderboard", str(good), "-o", out]) == 2
    said = capsys.readouterr().err
    for name in ("model-name", "batch-size", "num-training-steps"):
        assert f"(give --{name})" in said
    assert main(["leaderboard", str(good), "-o", out, *FACTS, "--date", "2026-13-01"]) == 2
    assert "is not a 'date'" in capsys.readouterr().err
    assert main(["leaderboard", str(good), "-o", out, *FACTS, "--policy", "q"]) == 2
    assert "unknown policy 'q'" in capsys.readouterr().err
    assert main(["leaderboard"]) == 2


def test_batch_and_steps_come_from_the_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    checkpoint = tmp_path / "pretrained_model"
    checkpoint.mkdir()
    (checkpoint / "train_config.json").write_text(json.dumps({"batch_size": 96, "steps": 777}))
    run = make_run(tmp_path / "run", {"policies": {"p": synthetic_runs.policy("p", path=str(checkpoint))}})
    out = tmp_path / "s.json"
    words = ["leaderboard", str(run), "-o", str(out), "--model-name", "M"]
    assert main(words) == 2, "lerobot-train's, of as many processes as nobody knows"
    assert "batch_size of 96, which lerobot-train counts for each process: give --batch-size" in capsys.readouterr().err
    assert main([*words, "--batch-size=768"]) == 0
    assert json.loads(out.read_text())["training_config"] == {"batch_size": 768, "num_training_steps": 777}
    Origin(experiment="e").write(checkpoint)
    assert main(words) == 0
    assert json.loads(out.read_text())["training_config"] == {"batch_size": 96, "num_training_steps": 777}


@pytest.mark.parametrize(
    "change",
    [
        {"extra": 1},
        {"model_name": " "},
        {"atomic_seen_success": 101},
        {"atomic_seen_success": "43"},
        {"open_source": "maybe"},
        {"training_config": {"batch_size": "N/A", "num_training_steps": 1}},
        {"training_config": {"batch_size": 1, "num_training_steps": 0}},
        {"training_config": {"batch_size": 1, "num_training_steps": 1, "gpus": 8}},
        {"notes": None},
        {"date": "today"},
    ],
)
def test_the_schema_refuses_what_the_leaderboard_refuses(
    change: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {
        "model_name": "m",
        "policy_family": "f",
        "date": "2026-01-01",
        "submission_source": "external",
        "robocasa_version": "1.0.1",
        "atomic_seen_success": 43.0,
        "composite_seen_success": 9.6,
        "composite_unseen_success": 4.4,
        "code_url": "N/A",
        "commit_hash": "N/A",
        "checkpoint_url": "N/A",
        "paper_link": "N/A",
        "open_source": "yes",
        "training_config": {"batch_size": 128, "num_training_steps": 120000},
        "notes": "n",
    }
    assert problems(values) == []
    assert overall(values) == 20.0  # as published for GR00T N1.5
    changed = {**values, **change}
    if change == {"notes": None}:
        del changed["notes"]
    assert len(problems(changed)) == 1
    path = tmp_path / "s.json"
    path.write_text(json.dumps(changed))
    assert main(["leaderboard", "--check", str(path)]) == 2
    assert "is no submission" in capsys.readouterr().err


def test_records_and_headers_of_the_test_are_of_the_real_schema(good: Path) -> None:
    policy = gather([good]).policies[0]
    assert isinstance(policy.header, RunHeader)
    assert all(isinstance(r, TrialRecord) for result in policy.tasks for r in result.trials)
