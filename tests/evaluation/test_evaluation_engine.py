"""Trials through worker processes: the same outcomes however they are spread, and faults that cost only their trial."""

from __future__ import annotations

import collections
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import evaluation_records
import pytest
from evaluation_env import SlideEnv
from full_disk import full_after

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.reference_policies import RandomPolicy, ZeroPolicy
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.trials import make_plan
from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.records.eval_info import write_eval_info
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.report import left_out
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.run import engine
from robocasa_lerobot.evaluation.run.film import Film, FilmError
from robocasa_lerobot.evaluation.run.rollout import RolloutError, run_trial
from robocasa_lerobot.evaluation.run.worker_pool import WorkerPool
from robocasa_lerobot.video import FILM_EVERY, frames_and_rate

ROOT = Path(__file__).parents[2]
FACTORY = "evaluation_env:SlideEnv"


@pytest.fixture(autouse=True)
def faults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "faults"
    folder.mkdir()
    monkeypatch.setenv("SLIDE_FAULTS", str(folder))
    return folder


def settings(out: Path, tasks: str = "Slide", **changes: Any) -> list[str]:
    values = {"policy.path": "random", "trials": 4, "videos": 0, "workers": 1, "env.image_size": 32, **changes}
    given = [f"--{name}={value}" for name, value in values.items()]
    return [f"--env.factory={FACTORY}", f"--env.tasks={tasks}", f"--out={out}", *given]


def evaluate(out: Path, tasks: str = "Slide", **changes: Any) -> list[TrialRecord]:
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, settings(out, tasks, **changes))))


def comparable(records: list[TrialRecord]) -> list[dict[str, Any]]:
    return [r.comparable() for r in sorted(records, key=lambda r: r.key)]


def test_outcomes_do_not_depend_on_workers_order_or_films(tmp_path: Path) -> None:
    one = evaluate(tmp_path / "one", "Slide,Push", trials=6, **{"policy.path": "random,zero"})
    two = evaluate(tmp_path / "two", "Push,Slide", trials=6, workers=3, videos=2, **{"policy.path": "zero,random"})
    assert comparable(one) == comparable(two)
    assert len({r.trajectory for r in one}) == len(one) == 24
    assert 0 < sum(r.success for r in one) < 24
    filmed = [r for r in two if r.video is not None]
    for label, task in {(r.label, r.task) for r in two}:
        group = [r for r in two if (r.label, r.task) == (label, task)]
        assert {r.success for r in group} == {r.success for r in group if r.video is not None}
        assert {r.trial for r in group if r.video is not None} >= {0, 1}
    for record in filmed:
        frames, rate = frames_and_rate(tmp_path / "two" / str(record.video))
        assert (frames, rate) == (1 + record.steps // FILM_EVERY, contract.CONTROL_HZ / FILM_EVERY)
    assert not list((tmp_path / "two").rglob("*.partial"))


def test_records_say_what_happened_and_what_made_it(tmp_path: Path) -> None:
    records = evaluate(tmp_path / "out", trials=8, **{"policy.path": "zero"})
    assert results.read_results(tmp_path / "out").trials == records
    for record in records:
        assert record.instruction == "slide the block"
        assert record.success is (record.first_success_step is not None) is record.terms["very far"].final
        assert record.steps == (record.first_success_step or 30)
        assert set(record.terms) == {"far", "very far"}
    (header,) = results.read_results(tmp_path / "out").headers.values()
    assert header.settings["seed"] == 0
    assert header.settings["factory"] == FACTORY
    assert {"robocasa_lerobot", "lerobot", "mujoco", "torch"} <= set(header.versions)


def test_a_label_with_a_slash_is_one_folder_of_films_and_one_file_of_rates(tmp_path: Path) -> None:
    out = tmp_path / "out"
    names = "demo/tune-000400,demo/tune-000800"
    records = evaluate(out, trials=1, videos=1, **{"policy.path": "zero,random", "policy.label": names})
    assert {Path(str(r.video)).parts[:2] for r in records} == {
        ("videos", "demo__tune-000400"), ("videos", "demo__tune-000800"),
    }  # fmt: skip
    (out / "eval_info.json").write_text("{}")  # of when the folder had one policy
    written = {path.name for path in write_eval_info(results.read_results(out), out)}
    assert written == {"eval_info_demo__tune-000400.json", "eval_info_demo__tune-000800.json"}
    assert {path.name for path in out.glob("eval_info*")} == written
    with pytest.raises(UserError, match="would have one folder"):
        evaluate(out, **{"policy.path": "zero,random", "policy.label": "a/b,a__b"})


@pytest.mark.parametrize(
    ("fault", "words", "outcome"),
    [
        ("crash", "RuntimeError: the block fell off", "crashed"),
        ("pipe", "BrokenPipeError: the env's own simulator ended", "crashed"),
        ("diverge", "DivergedError: the simulation diverged", "diverged"),
        ("kill", "ended with exit status 7", "crashed"),
        ("hang", "no progress for 2 s", "hung"),
    ],
)
def test_a_fault_costs_one_attempt(tmp_path: Path, fault: str, words: str, outcome: str) -> None:
    healthy = evaluate(tmp_path / "healthy")
    records = evaluate(tmp_path / "out", f"Slide+{fault}", stall_seconds=2)
    assert [r.error for r in records] == [None] * 4
    assert sorted(r.attempts for r in records) == [1, 1, 1, 2]
    (retried,) = [r for r in records if r.attempts == 2]
    assert words in str(retried.first_error)
    assert retried.first_outcome == outcome
    assert len(healthy) == len(records)


def test_a_fault_that_repeats_is_recorded_and_the_run_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "out"
    records = evaluate(out, "Slide+crashx2", workers=1, trials=3)
    assert [r.error is not None for r in records] == [True, False, False]
    assert "RuntimeError: the block fell off" in str(records[0].error)
    assert (records[0].success, records[0].attempts) == (False, 2)
    # The record stands on a second call, unless errors are asked to run again.
    assert comparable(evaluate(out, "Slide+crashx2", trials=3)) == comparable(records)
    again = evaluate(out, "Slide+crashx2", trials=3, retry_errors=True)
    assert [r.error for r in again] == [None] * 3
    assert comparable(again)[1:] == comparable(records)[1:]


def test_a_killed_evaluation_runs_only_what_is_missing(tmp_path: Path) -> None:
    out, path = tmp_path / "out", tmp_path / "out" / results.TRIALS_FILE
    # Every trial lasts 30 slow steps, because the zero policy never arrives from most places.
    arguments = settings(out, "Slide+slow", trials=12, workers=2, **{"policy.path": "zero", "report": "false"})
    command = [sys.executable, str(ROOT / "eval.py"), *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "tests" / "support")}
    process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not (path.exists() and path.read_bytes().count(b"\n") >= 4):
        assert process.poll() is None, "the evaluation ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = path.read_bytes()
    complete = before[: before.rfind(b"\n") + 1]
    path.write_bytes(complete + b'{"label": "zero", "ta')  # as if it had been cut off inside a write
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
    assert "cut off by a kill" in done.stderr
    assert path.read_bytes().startswith(complete)
    keys = collections.Counter(
        (r["task"], r["trial"]) for r in map(json.loads, path.read_text().splitlines()) if r["kind"] == "trial"
    )
    assert sorted(keys) == [("Slide+slow", trial) for trial in range(12)]
    assert set(keys.values()) == {1}
    whole = evaluate(tmp_path / "whole", "Slide+slow", trials=12, **{"policy.path": "zero"})
    assert comparable(results.read_results(path).trials) == comparable(whole)


def test_more_trials_tasks_or_policies_can_be_added_but_settings_cannot_change(tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = evaluate(out, trials=2)
    more = evaluate(out, "Slide,Push", trials=3, **{"policy.path": "random,zero"})
    assert len(more) == 12
    assert {r.key: r for r in more}[first[0].key] == first[0]
    assert len(results.read_results(out).trials) == 12
    with pytest.raises(UserError, match=r"(?s)seed: 0 in the file, 1 now.*choose another --out"):
        evaluate(out, trials=2, seed=1)


def test_labels_and_plans_of_before_count_again_when_they_are_given_again(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for data in ("none", "all", "none"):
        evaluate(out, trials=2, **{"policy.training_data": data})
    (policy,) = gather([out]).policies
    assert policy.info.training_data == "none"
    # More trials are asked for, the command is killed before the first of them, and as few as before are asked for.
    more = dataclasses.replace(policy.header, trials=50)
    trials_file.append(out / results.TRIALS_FILE, more)
    assert left_out.partial_runs(gather([out])) is not None
    evaluate(out, trials=2, **{"policy.training_data": "none"})
    assert left_out.partial_runs(gather([out])) is None
    before = (out / results.TRIALS_FILE).read_bytes()
    evaluate(out, trials=2, **{"policy.training_data": "none"})
    assert (out / results.TRIALS_FILE).read_bytes() == before, "a header that is the last one is not written again"


def test_two_evaluations_do_not_write_to_one_folder(tmp_path: Path) -> None:
    tmp_path.joinpath("out").mkdir()
    with engine.only_writer(tmp_path / "out"), pytest.raises(UserError, match="another evaluation is writing here"):
        evaluate(tmp_path / "out")


def test_what_no_trial_can_get_around_ends_the_run_with_its_reason(tmp_path: Path) -> None:
    changes: list[tuple[dict[str, Any], str]] = [
        ({"env.factory": "evaluation_env:Slider"}, "cannot be imported"),
        ({"env.factory": "evaluation_env:make_without_horizon"}, "give --env.horizon"),
        ({"env.factory": "evaluation_env"}, "expected module:callable"),
        ({"env.horizon_multiplier": 1.5}, "needs the kitchen env"),
        ({"policy.path": "zero,zero"}, "two policies are called 'zero'"),
        ({"policy.label": ".a/b"}, "no leading"),
    ]
    for number, (change, message) in enumerate(changes):
        with pytest.raises(UserError, match=message):
            evaluate(tmp_path / str(number), **change)


@pytest.mark.slow
def test_a_checkpoint_that_cannot_be_loaded_ends_the_run(tmp_path: Path) -> None:
    broken = evaluation_records.make_checkpoint(tmp_path / "checkpoint")
    with pytest.raises(UserError, match="policy 'checkpoint' cannot be loaded"):
        evaluate(tmp_path / "out", **{"policy.path": broken})


class Endless(SlideEnv):
    def step(self, action: Any) -> Any:
        observation, reward, _, _, info = super().step(action)
        return observation, reward, False, False, {**info, "is_success": False}


class NotFinite(ZeroPolicy):
    def act(self, observation: Any, instruction: str) -> Any:
        return super().act(observation, instruction) * float("nan")


def test_a_trial_that_cannot_go_on_says_why() -> None:
    (spec,) = make_plan(["zero"], {"Slide": 20}, trials=1, seed=0, videos=0)
    with pytest.raises(RolloutError, match="past its horizon of 20 steps"):
        run_trial(Endless("Slide", horizon=20), ZeroPolicy(), spec)
    with pytest.raises(RolloutError, match="not finite at step 0"):
        run_trial(SlideEnv("Slide", horizon=20), NotFinite(), spec)


def test_a_film_of_a_trial_that_fails_leaves_no_file(tmp_path: Path) -> None:
    (spec,) = make_plan(["zero"], {"Slide": 20}, trials=1, seed=0, videos=1)
    with pytest.raises(RolloutError), Film(tmp_path / "videos/trial.mp4") as film:
        run_trial(Endless("Slide", horizon=20), ZeroPolicy(), spec, film)
    assert list((tmp_path / "videos").iterdir()) == []


@pytest.mark.parametrize("size", [0, 600])
def test_a_film_that_cannot_be_written_is_no_failure_of_its_trial(tmp_path: Path, size: int) -> None:
    (spec,) = make_plan(["zero"], {"Slide": 20}, trials=1, seed=0, videos=1)
    path = tmp_path / "videos/trial.mp4"
    with full_after(size), pytest.raises(FilmError, match="--videos=0"), Film(path) as film:
        run_trial(SlideEnv("Slide", horizon=20), ZeroPolicy(), spec, film)
    assert not list((tmp_path / "videos").iterdir())


def test_random_actions_depend_on_the_seed_alone() -> None:
    plan = make_plan(["random"], {"Slide": 20}, trials=2, seed=0, videos=0)
    env, policy = SlideEnv("Slide", horizon=20), RandomPolicy()
    first, second, again = (run_trial(env, policy, plan[i]) for i in (0, 1, 0))
    assert first == again
    assert first.trajectory != second.trajectory


def test_what_no_film_shows_is_run_again_and_must_go_the_same_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments: dict[str, Any] = {"policy.path": "zero", "trials": 6}
    plain = evaluate(out, **arguments)
    assert {r.success for r in plain} == {True, False}
    filmed = evaluate(out, videos=1, **arguments)
    assert comparable(filmed) == comparable(plain)
    with_film = [r for r in filmed if r.video is not None]
    assert {r.success for r in with_film} == {True, False}
    assert all((out / str(r.video)).is_file() for r in with_film)
    evaluate(out, videos=1, **arguments)
    assert "nothing to run" in capsys.readouterr().out
    more = evaluate(out, videos=3, **arguments)
    assert comparable(more) == comparable(plain)
    assert all(record.video for record in more[:3]), "what is asked for later is filmed later"
    assert {record.video for record in filmed} <= {record.video for record in more}
    capsys.readouterr()
    evaluate(out, videos=3, **arguments)
    assert "nothing to run" in capsys.readouterr().out
    # A record whose trial goes another way keeps its outcome and gets no film.
    other = tmp_path / "other"
    other.mkdir()
    (header,) = results.read_results(out).headers.values()
    trials_file.append(other / results.TRIALS_FILE, header)
    for record in plain:
        trials_file.append(other / results.TRIALS_FILE, dataclasses.replace(record, trajectory="another"))
    again = evaluate(other, videos=1, **arguments)
    assert "not deterministic" in capsys.readouterr().err
    assert [r.success for r in again] == [r.success for r in plain]
    assert {r.video for r in again} == {None}
    assert not list(other.rglob("*.mp4"))


def test_an_error_of_a_film_is_called_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments: dict[str, Any] = {"policy.path": "zero", "trials": 6}
    plain = evaluate(tmp_path / "out", **arguments)
    monkeypatch.setenv("SLIDE_FAULTY_SEEDS", json.dumps({str(record.seed): "crash" for record in plain}))
    again = evaluate(tmp_path / "out", videos=1, **arguments)
    assert comparable(again) == comparable(plain)
    said = capsys.readouterr().err
    assert (
        "ended in an error when it was run again for its film: RuntimeError: the block fell off. The first run" in said
    )
    assert "not deterministic" not in said


def test_films_that_are_asked_for_later_have_all_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arguments: dict[str, Any] = {"policy.path": "zero", "trials": 6, "workers": 2}
    evaluate(tmp_path / "out", **arguments)
    started = []
    start = WorkerPool._start

    def counted(pool: WorkerPool) -> Any:
        started.append(1)
        return start(pool)

    monkeypatch.setattr(WorkerPool, "_start", counted)
    filmed = evaluate(tmp_path / "out", videos=1, **arguments)
    assert len([record for record in filmed if record.video]) == 2
    assert len(started) == 2
