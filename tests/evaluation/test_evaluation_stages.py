"""How far trials come in their stages: counted in order, kept in records, shown in reports."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import pytest
from evaluation_records import record, write_results

from robocasa_lerobot.cli import main
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import DrawerClosed, DrawerOpen
from robocasa_lerobot.envs.tasks.stage_progress import StageProgress
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.records.results import StageSummary, read_results
from robocasa_lerobot.evaluation.statistics.progress import mean_progress
from robocasa_lerobot.evaluation.statistics.rates import success_rate


def test_stages_count_in_order_once_and_not_what_was_given() -> None:
    env = KitchenEnv("OpenDrawer", split="pretrain", cameras=())
    env.reset(seed=100_000)
    role = env.declaration.stages[0].target
    conditions = (
        DrawerClosed(role, at_most=0.05),
        DrawerOpen(role, at_least=0.2),
        DrawerOpen(role, at_least=0.8),
        DrawerClosed(role, at_most=0.05),
    )
    stages = tuple(Stage("drawers", "open", role, until=condition) for condition in conditions)
    task = dataclasses.replace(env.declaration, stages=stages)
    joint = env.data.joint(env.scene.fixture(role).joint)
    low, high = env.model.joint(joint.name).range

    def open_to(share: float) -> None:
        closed, out = (low, high) if abs(low) < abs(high) else (high, low)
        joint.qpos[0] = closed + share * (out - closed)

    open_to(0.0)
    progress = StageProgress(task, env.scene, env.data)
    assert (progress.total, progress.met, progress.given) == (4, 1, 1)  # it was closed: that is no merit
    met = []
    for share in (0.1, 0.3, 0.1, 0.3, 0.0, 0.9, 0.5, 0.0):
        open_to(share)
        progress.note(env.data, success=False)
        met.append(progress.met)
    assert met == [1, 2, 2, 2, 2, 3, 3, 4]  # closing again counts only after it was wide open
    assert progress.next_text is None
    assert progress.given == 1


def test_an_only_stage_is_met_with_the_goal_and_the_goal_meets_all() -> None:
    env = KitchenEnv("OpenDrawer", split="pretrain", cameras=())
    env.reset(seed=100_000)
    progress = StageProgress(env.declaration, env.scene, env.data)
    assert (progress.total, progress.met) == (1, 0)
    assert progress.next_text is not None
    assert "drawer" in progress.next_text
    progress.note(env.data, success=True)
    assert (progress.met, progress.given, progress.next_text) == (1, 0, None)


def test_progress_is_the_share_of_what_was_left_to_do() -> None:
    assert StageSummary(4, 1, 1, "x").progress == 0.0
    assert StageSummary(4, 3, 1, "x").progress == pytest.approx(2 / 3)
    assert StageSummary(4, 4, 1, None).progress == 1.0
    assert StageSummary(1, 1, 1, None).progress == 1.0
    estimate, rate = mean_progress([0.0, 1.0, 0.5, 0.5]), success_rate(2, 4)
    assert (estimate.value, estimate.low, estimate.high) == (0.5, rate.low, rate.high)
    with pytest.raises(UserError):
        mean_progress([])
    with pytest.raises(UserError):
        mean_progress([1.5])


@pytest.mark.costly
@pytest.mark.render
def test_the_command_records_how_far_any_policy_comes(tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["--policy=demonstrator,zero", "--env.tasks=MicrowaveThawing", "--trials=1", "--videos=0"]
    arguments += ["--env.split=pretrain", "--env.horizon=300", "--workers=1", f"--out={out}"]
    assert main(["eval", *arguments]) == 0
    solved, idle = sorted(read_results(out).trials, key=lambda r: r.label)
    assert solved.stages is not None
    assert idle.stages is not None
    assert solved.stages.total == idle.stages.total > 1
    assert idle.stages.met == idle.stages.given == solved.stages.given
    assert idle.stages.progress == 0.0
    assert idle.stages.next is not None
    # In 15 seconds a demonstrator opens the door, and nobody does not.
    assert solved.stages.met > idle.stages.met
    assert solved.success is (solved.stages.met == solved.stages.total)


def test_reports_show_progress_success_and_where_trials_end(tmp_path: Path) -> None:
    def trial(number: int, met: int, words: str | None, **changes: object) -> dict[str, object]:
        done = words is None
        return {
            "task": "PrepareCoffee",
            "trial": number,
            "success": done,
            "first_success_step": 80 if done else None,
            "stages": StageSummary(4, met, 0, words),
            **changes,
        }

    broken = trial(4, 0, "x", outcome="crashed", error="Traceback", stages=None)
    trials = [trial(0, 4, None), trial(1, 1, "lift the mug"), trial(2, 1, "lift the mug"), trial(3, 2, "press"), broken]
    folder = write_results(tmp_path / "run", trials)
    assert main(["report", str(folder), "--out", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "How far trials come" in text
    assert "40.0\N{NO-BREAK SPACE}%" in text  # (1 + 1/4 + 1/4 + 2/4 + 0) / 5
    assert "solved 1/5" in text
    assert "lift the mug" in text
    assert "2 of 3" in text
    rows = list(csv.DictReader((tmp_path / "report.csv").open(encoding="utf-8")))
    (row,) = [row for row in rows if row["task"] == "PrepareCoffee"]
    assert (row["stages"], row["mean_progress"]) == ("4", "0.400000")
    assert float(row["progress_low"]) < 0.4 < float(row["progress_high"])


def test_trials_of_the_version_before_are_read_and_say_nothing_of_stages(tmp_path: Path) -> None:
    folder = write_results(tmp_path / "run", [{}])
    lines = [json.loads(line) for line in (folder / "trials.jsonl").read_text(encoding="utf-8").splitlines()]
    old = dataclasses.replace(read_results(folder).headers[record().run], schema=3)
    del lines[1]["stages"]
    trial = {**lines[1], "schema": 3, "run": old.id}
    (folder / "trials.jsonl").write_text(f"{old.to_line()}\n{json.dumps(trial)}\n", encoding="utf-8")
    (read,) = read_results(folder).trials
    assert read.stages is None
    assert main(["report", str(folder), "--out", str(tmp_path / "report.html")]) == 0
    assert "How far trials come" not in (tmp_path / "report.md").read_text(encoding="utf-8")
