"""Recording many tasks: which are chosen, where, what is kept of failures, and that a kill changes nothing."""

from __future__ import annotations

import dataclasses
import json
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import mujoco
import numpy as np
import pytest
from cluster_work import hdf5_content
from killed_runs import run_killed
from ray_support import StandIn
from slurm_support import stand_in

from robocasa_lerobot import cli
from robocasa_lerobot.cli.demos import EXAMPLE
from robocasa_lerobot.demos.attempts import HOPELESS, MAX_ATTEMPTS_PER_EPISODE, Parts, RecordingSettings, Tally
from robocasa_lerobot.demos.choose import choose_tasks, expand_names
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.distributed import record_distributed
from robocasa_lerobot.demos.hdf5 import Failure, read_summary
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.progress import Board
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.recording import FAILURES_FOLDER, record_task, record_tasks
from robocasa_lerobot.demos.skills import SKILLS, SkillError
from robocasa_lerobot.demos.stages import ATTEMPTS, PATIENCE_STEPS
from robocasa_lerobot.demos.summary import print_summary
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.robots.panda_omron import model as panda_model
from robocasa_lerobot.envs.tasks.registry import get_task, task_names, task_set
from robocasa_lerobot.errors import LackingMachineError, UnknownNameError, UserError
from robocasa_lerobot.jobs.executors import Execution, RaySettings
from robocasa_lerobot.video import frames_and_rate

QUICK = ("CloseDrawer", "OpenDrawer")


def test_tasks_are_chosen_by_name_set_or_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(SKILLS, ("drawers", "close"))
    assert "--tasks" in EXAMPLE
    everything = choose_tasks("all")
    assert sorted((*everything.names, *everything.left_out)) == list(task_names())
    assert all(can_demonstrate(get_task(name)) for name in everything.names)
    assert not any(can_demonstrate(get_task(name)) for name in everything.left_out)
    assert set(expand_names("atomic_seen")) == set(task_set("atomic_seen"))
    assert [len(expand_names(kind)) for kind in ("atomic", "composite", "all")] == [65, 300, 365]
    assert set(expand_names("composite,atomic")) == set(expand_names("all"))
    assert expand_names("OpenDrawer, CloseDrawer,OpenDrawer") == ("OpenDrawer", "CloseDrawer")
    with pytest.raises(UnknownNameError, match="atomic_seen"):
        expand_names("atomic_sen")
    with pytest.raises(UserError, match="give names or sets"):
        expand_names(" , ")
    assert "CloseDrawer" in everything.left_out  # a set may name what cannot be shown, a user may not
    with pytest.raises(UserError, match="no demonstrator yet"):
        choose_tasks("OpenDrawer,CloseDrawer")


def test_kitchens_can_be_restricted() -> None:
    env = KitchenEnv("CloseDrawer", split="pretrain", cameras=(), layouts=(12, 14), styles=(20,))
    for seed in range(3):  # of 2,500 kitchens
        scene = env.reset(seed=seed)[1]["scene"]
        assert scene["layout_id"] in (12, 14)
        assert scene["style_id"] == 20
    settings = RecordingSettings("CloseDrawer", 1, layouts=(-4,))
    assert settings.env_kwargs()["layouts"] == (-4,)
    assert settings.identity()["layouts"] == [-4]
    with pytest.raises(UnknownNameError, match="layout"):
        record_task(RecordingSettings("CloseDrawer", 1, layouts=(99,)), Path("nowhere"))
    assert not Path("nowhere").exists()


def _tally(outcomes: list[bool | None], wanted: int) -> tuple[Tally, RecordingSettings]:
    done = {number: ok for number, ok in enumerate(outcomes) if ok is not None}
    chosen, failures, tried = [], [], 0
    while tried in done and len(chosen) < wanted:
        if done[tried]:
            chosen.append(tried)
        else:
            failures.append(Failure(tried, "no"))
        tried += 1
    return Tally(chosen, tried, failures, done), RecordingSettings("CloseDrawer", wanted)


def test_attempts_that_are_made_next() -> None:
    def wanted(outcomes: list[bool | None], episodes: int) -> list[int]:
        tally, settings = _tally(outcomes, episodes)
        return Parts(Path("out"), settings).wanted(tally)

    assert wanted([], 3) == [0, 1, 2]
    assert wanted([], 100) == list(range(HOPELESS))
    assert wanted([True, None, False], 3) == [1, 3]  # the one that was jumped over, and one more
    assert wanted([True, None, True], 2) == [1]  # decides which two are the first
    assert wanted([True, False] * 6, 10) == list(range(12, 20))  # four are missing, and half of them fail
    for episodes, outcomes, given_up in (
        (1, [False] * 10, True),
        (1, [False] * 9, False),
        (50, [False] * HOPELESS, True),
        (50, [False] * (HOPELESS - 1) + [True], False),
    ):
        tally, settings = _tally(outcomes, episodes)
        assert bool(Parts(Path("out"), settings).gave_up(tally)) == given_up


@pytest.mark.parametrize("workers", [1, 16])
def test_a_hopeless_task_is_given_up_after_as_many_attempts_by_any_number_of_processes(
    workers: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_vain(jobs: list[tuple[Parts, int]], workers: int, board: Board) -> None:
        for parts, number in jobs:
            (parts.folder / f"{number:06d}.json").write_text(json.dumps(dataclasses.asdict(Failure(number, "no"))))

    monkeypatch.setattr("robocasa_lerobot.demos.recording._run_round", in_vain)
    settings = RecordingSettings("CloseDrawer", 50, layouts=(2,))
    (result,) = record_tasks([settings], tmp_path, workers=workers, show_progress=False)
    assert result.tried == HOPELESS
    # The kitchens may be none that the task can be set up in.
    assert "less --action-noise, other --layouts, or another --seed." in result.gave_up


class Elsewhere(RecordingSettings):
    """Attempts that fail in the kitchen of another seed, as replays do."""

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        """Say so."""
        return cast(Recording, SimpleNamespace(success=False, seed=7, reason="it fell", false_terms=(), ep_meta={}))


def test_a_failure_says_in_which_kitchen_it_was(tmp_path: Path) -> None:
    parts = Parts(tmp_path, Elsewhere("CloseDrawer", 1, seed=100))
    parts.prepare()
    for number in range(2):
        parts.attempt(number, cast(KitchenEnv, None))
    failures = parts.tally().failures
    assert [(one.seed, one.scene_seed) for one in failures] == [(100, 7), (101, 7)]
    assert Failure(3, "it fell").scene_seed == 3
    assert Parts(tmp_path, parts.settings).tally() == parts.tally()


def test_a_changed_option_throws_nothing_away(tmp_path: Path) -> None:
    settings = RecordingSettings("CloseDrawer", 2, seed=1)
    noisy = dataclasses.replace(settings, action_noise=0.1)
    parts = Parts(tmp_path, settings)
    parts.prepare()
    parts.episode(1).touch()
    with pytest.raises(UserError, match=r"holds 1 demonstration.* \(action_noise: 0\.0, now 0\.1\)\. Give those"):
        record_tasks([noisy], tmp_path, show_progress=False)
    assert [path.name for path in tmp_path.iterdir()] == [parts.folder.name]
    Parts(tmp_path, dataclasses.replace(settings, episodes=3)).prepare()  # more of the same are no other settings
    assert parts.tally().done == {1: True}
    parts.episode(1).rename(parts.folder / "000001.json")  # where nothing has succeeded, nothing is lost
    Parts(tmp_path, noisy).prepare()
    assert not (parts.folder / "000001.json").exists()


def test_a_recording_does_not_go_on_under_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = RecordingSettings("CloseDrawer", 2, seed=1)
    parts = Parts(tmp_path, settings)
    parts.prepare()
    parts.episode(1).touch()
    monkeypatch.setattr(mujoco, "__version__", "2.0")
    with pytest.raises(UserError, match=r"\(mujoco_version: '3.*', now '2\.0'\)\. Install those"):
        record_tasks([settings], tmp_path, show_progress=False)
    parts.episode(1).rename(parts.folder / "000001.json")  # failed, as may be mended since
    Parts(tmp_path, settings).prepare()
    assert parts.tally().done == {}


@pytest.mark.parametrize("noise", [-0.1, float("nan"), float("inf")])
def test_noise_that_is_none_is_refused(noise: float) -> None:
    with pytest.raises(UserError, match="action_noise: found"):
        RecordingSettings("CloseDrawer", 1, action_noise=noise).check()


def test_attempts_may_not_run_out_of_seeds() -> None:
    last = 2**63 - MAX_ATTEMPTS_PER_EPISODE
    RecordingSettings("CloseDrawer", 1, seed=last).check()
    with pytest.raises(UserError, match="a whole number from 0"):
        RecordingSettings("CloseDrawer", 1, seed=last + 1).check()


def test_seeds_that_no_scene_can_have_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["demos", "--tasks", "CloseDrawer", "--episodes", "1", "--seed", "-5", "--out", str(tmp_path)]
    assert cli.main(command) == 2
    assert "a whole number from 0" in capsys.readouterr().err
    settings = [RecordingSettings("CloseDrawer", 1, seed=-5)]
    with pytest.raises(UserError, match="a whole number from 0"):
        record_distributed(settings, tmp_path, cast(Any, SimpleNamespace(kind="ray")), keep_failures=False)
    assert not list(tmp_path.iterdir())


def test_time_left_follows_from_what_this_run_has_done(capsys: pytest.CaptureFixture[str]) -> None:
    now = [0.0]
    settings = RecordingSettings("CloseDrawer", 10)
    with Board([settings], clock=lambda: now[0]) as board:
        board.update(settings, _tally([True, False], 10)[0])  # done before
        assert board.seconds_left(settings, _tally([True, False], 10)[0]) is None
        now[0] = 40.0
        later = _tally([True, False, True, True, True, False], 10)[0]
        # 10 s an attempt, two of three succeed, six are missing
        assert board.seconds_left(settings, later) == pytest.approx(90.0)
        board.update(settings, later)
        board.finish(settings, later)
    shown = capsys.readouterr().err
    assert "CloseDrawer  4/10 episodes, 67% of 6 attempts succeed, 2 min left" in shown
    assert "[1/1] CloseDrawer" in shown


def _clumsy(env: KitchenEnv, stage: Any) -> Iterator[Array]:
    for _ in range(4):
        yield action(gripper=1.0)
    raise SkillError("the hand is greased")


@pytest.mark.render
def test_failures_are_kept_with_a_film_and_the_missing_terms(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("robocasa_lerobot.demos.attempts.MAX_ATTEMPTS_PER_EPISODE", 1)
    monkeypatch.setitem(SKILLS, ("drawers", "close"), _clumsy)
    settings = RecordingSettings("CloseDrawer", episodes=1, seed=7)
    results = record_tasks([settings], tmp_path, keep_failures=True, show_progress=False)
    folder = tmp_path / FAILURES_FOLDER / "CloseDrawer"
    described = json.loads((folder / "seed_000007.json").read_text())
    assert described["reason"] == "the hand is greased"
    assert described["false_terms"]
    steps = ATTEMPTS * (4 + PATIENCE_STEPS)
    assert (described["seed"], described["steps"]) == (7, steps)
    assert frames_and_rate(folder / described["film"]) == (steps // 2, 10.0)
    assert print_summary(results) == 1
    printed = capsys.readouterr().out
    assert "given up" in printed
    assert f"[false: {described['false_terms'][0]}" in printed
    # What a recording without --keep-failures noted is attempted again when it is wanted, and then left alone.
    (folder / "seed_000007.json").unlink()
    assert Parts(tmp_path, settings).tally().done == {0: False}
    assert Parts(tmp_path, settings, folder).tally().done == {}


@pytest.mark.render
def test_a_kill_as_the_file_appears_leaves_no_film_of_what_was_not_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = RecordingSettings("CloseDrawer", 1, seed=7)
    films = tmp_path / FAILURES_FOLDER / "CloseDrawer"
    parts = Parts(tmp_path, settings, films)
    parts.prepare()
    parts.episode(0).touch()
    (parts.folder / "000001.json").write_text(json.dumps(dataclasses.asdict(Failure(8, "made meanwhile"))))
    films.mkdir(parents=True)
    (films / "seed_000008.json").touch()

    def killed(*_: Any, **__: Any) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("robocasa_lerobot.demos.recording.merge_parts", killed)
    with pytest.raises(KeyboardInterrupt):
        record_tasks([settings], tmp_path, keep_failures=True, show_progress=False)
    assert not list(films.iterdir())


def test_what_a_skill_should_not_raise_is_a_failure_of_its_attempt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(env: KitchenEnv, stage: Any) -> Iterator[Array]:
        raise IndexError("list index out of range")
        yield

    monkeypatch.setattr("robocasa_lerobot.demos.attempts.MAX_ATTEMPTS_PER_EPISODE", 1)
    monkeypatch.setitem(SKILLS, ("drawers", "close"), broken)
    result = record_tasks([RecordingSettings("CloseDrawer", 1)], tmp_path, show_progress=False)[0]
    assert result.failures == [Failure(0, "IndexError: list index out of range")]
    assert result.gave_up


def test_what_the_machine_lacks_ends_the_recording_and_counts_as_no_attempt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(panda_model, "find_spec", lambda name: None)
    panda_model.mesh_bytes.cache_clear()  # an error is not kept in it
    settings = RecordingSettings("CloseDrawer", 1)
    with pytest.raises(LackingMachineError, match="gymnasium-robotics"):
        record_tasks([settings], tmp_path, show_progress=False)
    assert Parts(tmp_path, settings).tally().done == {}  # once it is mended, the same command starts afresh


def test_a_file_that_was_removed_is_a_piece_of_the_cluster_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = StandIn()
    monkeypatch.setitem(sys.modules, "ray", ray)
    settings = [RecordingSettings("CloseDrawer", 1, seed=1)]
    execution = Execution("ray", ray=RaySettings(cpus=1))
    for times in (1, 2):  # of which the second finds the markers of the first
        assert record_distributed(settings, tmp_path, execution, keep_failures=False) == ("", 0)
        assert len(ray.asked) == times
        (tmp_path / "CloseDrawer.hdf5").unlink()


@pytest.mark.slow
def test_a_cluster_records_what_this_machine_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = stand_in(tmp_path, monkeypatch)
    options = ["--tasks", ",".join(QUICK), "--episodes", "1", "--seed", "40", "--action-noise", "0.1"]
    slurm = ["--executor", "slurm", "--slurm.partition", "cpu", "--slurm.time", "00:10:00", "--slurm.cpus", "1"]
    assert cli.main(["demos", *options, *slurm, "--out", str(tmp_path / "slurm_out")]) == 0
    assert "2 tasks in job 1, summed up by job 2" in capfd.readouterr().out
    assert len(list(folder.glob("*.script"))) == 2
    (joined,) = (tmp_path / "slurm_out" / "slurm").glob("join-*.out")
    assert all(task in joined.read_text() for task in QUICK)
    settings = [RecordingSettings(task, 1, seed=40, action_noise=0.1) for task in QUICK]
    record_tasks(settings, tmp_path / "here", show_progress=False)
    for task in QUICK:
        there, here = (hdf5_content(tmp_path / place / f"{task}.hdf5") for place in ("slurm_out", "here"))
        assert all(np.array_equal(value, there[key]) for key, value in here.items())


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("chance", range(3))
def test_a_recording_that_is_killed_again_and_again_is_that_of_an_uninterrupted_one(
    chance: int, tmp_path: Path
) -> None:
    """Killed at random moments, the whole group or the first process alone, with one worker or several."""
    rng = random.Random(chance)
    settings = [RecordingSettings(task, 8, seed=40, action_noise=0.1) for task in QUICK]
    record_tasks(settings, tmp_path / "whole", show_progress=False)
    words = ["demos", "--tasks", ",".join(QUICK), "--episodes", "8", "--seed", "40", "--action-noise", "0.1"]
    assert run_killed(words, tmp_path / "killed", rng) > 0
    for one in settings:
        whole, killed = (hdf5_content(tmp_path / place / f"{one.task}.hdf5") for place in ("whole", "killed"))
        assert list(whole) == list(killed)
        for key, value in whole.items():
            assert np.array_equal(value, killed[key]), key
        assert read_summary(tmp_path / "killed" / f"{one.task}.hdf5").episodes == 8
    assert sorted(path.name for path in (tmp_path / "killed").iterdir()) == [f"{task}.hdf5" for task in QUICK]
