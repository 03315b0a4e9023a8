"""The checker of tasks finds what is wrong with one: goals that hold by themselves, chance, demonstrators that fail."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.demos import task_check
from robocasa_lerobot.envs.checks.tasks import check_task
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.splits import SPLITS
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import LackingMachineError

pytestmark = pytest.mark.render
TASK = "OpenDrawer"


def test_a_goal_that_comes_to_hold_by_itself_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    real = KitchenEnv._info
    monkeypatch.setattr(KitchenEnv, "_info", lambda env: {**real(env), "success": env._steps >= 97})
    assert check_task(TASK, seeds=(0,)) == ["seed 0, step 97: the goal holds although nothing was done"]


def test_a_scene_that_depends_on_more_than_the_seed_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    real = KitchenEnv.reset
    made: list[int] = []

    def reset(env: KitchenEnv, *, seed: int | None = None, options: dict | None = None):
        made.append(0)
        return real(env, seed=len(made), options=options)

    monkeypatch.setattr(KitchenEnv, "reset", reset)
    faults = check_task("CloseDrawer", seeds=(0,))
    assert "seed 0, step 0: the same seed gave another state" in faults
    assert "seed 0, step 0: the same seed gave another observation" in faults


def test_a_demonstrator_that_solves_nothing_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task_check, "check_task", lambda *_: [])
    real = task_check.record_episode
    monkeypatch.setattr(task_check, "record_episode", lambda *a, **k: replace(real(*a, **k), success=False))
    found = task_check.check(TASK, "target", (0, 1))
    assert (found.solved, found.failed) == (None, (0, 1))
    assert found.faults == ("the demonstrator solved none of 2 seeds",)


def test_a_task_that_raises_is_a_fault_and_the_others_are_checked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(name: str, split: str, seeds: Sequence[int]) -> list[str]:
        if name == TASK:
            raise KeyError("knife")
        return []

    def lacking(name: str, split: str, seeds: Sequence[int]) -> list[str]:
        raise LackingMachineError("no OpenGL")

    monkeypatch.setattr(task_check, "can_demonstrate", lambda task: False)
    monkeypatch.setattr(task_check, "check_task", broken)
    assert cli.main(["tasks", TASK, "CloseDrawer", "--check", "--workers", "1"]) == 1
    lines = capsys.readouterr().out.splitlines()
    for split in SPLITS:
        assert f"{TASK}, {split}: KeyError: 'knife'" in lines
        assert f"CloseDrawer, {split}: ok, no demonstrator" in lines
    monkeypatch.setattr(task_check, "check_task", lacking)
    with pytest.raises(LackingMachineError):
        task_check.check(TASK, "target", (0,))


def test_what_is_sunk_into_something_is_found_though_it_sleeps(monkeypatch: pytest.MonkeyPatch) -> None:
    real = KitchenEnv.reset

    def reset(env: KitchenEnv, *, seed: int | None = None, options: dict | None = None):
        found = real(env, seed=seed, options=options)
        env.data.qpos[env.model.joint("obj_joint0").qposadr[0] + 2] -= 0.012
        return found

    assert check_task("PickPlaceCounterToSink", seeds=(0,)) == []
    monkeypatch.setattr(KitchenEnv, "reset", reset)
    faults = check_task("PickPlaceCounterToSink", seeds=(0,))
    assert any(re.fullmatch(r"seed 0, step 0: \w+ reaches \d+ mm into \w+, and .*", one) for one in faults)


def test_a_check_goes_on_from_its_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[str, str]] = []

    def check(task: str, split: str, seeds: Sequence[int]) -> task_check.Checked:
        made.append((task, split))
        return task_check.Checked(task, split, (), 1, (0,))

    monkeypatch.setattr(task_check, "check", check)
    log = tmp_path / "new" / "check.jsonl"
    names = [TASK, "CloseDrawer"]
    first = list(task_check.check_all(names[:1], SPLITS, (0, 1), log=log))
    log.write_text(log.read_text() + '{"task": "CloseDr')  # as a kill may leave it
    both = list(task_check.check_all(names, SPLITS, (0, 1), log=log))
    assert made == [(name, split) for name in names for split in SPLITS]
    assert set(first) < set(both)
    assert len(both) == 4
    list(task_check.check_all(names, SPLITS, (0,), log=log))
    assert len(made) == 8  # other seeds are another check
    monkeypatch.setattr(task_check, "code_digest", lambda: "mended since")
    list(task_check.check_all(names, SPLITS, (0,), log=log))
    assert len(made) == 12


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize("task", task_names())
def test_every_task_is_sound_and_solved_in_both_splits(task: str, split: str) -> None:
    assert task_check.check(task, split).faults == ()


@pytest.mark.slow
def test_the_command_says_what_it_found(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["tasks", TASK, "--check", "--workers", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sorted(line.split(":")[0] for line in lines) == [f"{TASK}, {split}" for split in SPLITS]
    assert all("ok, solved on seed" in line for line in lines)
