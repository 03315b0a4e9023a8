"""Whole evaluations of policies behind sockets, as a user runs them: probe, faults, resuming, report."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policy_sockets import OpenpiServer
from remote_runs import PI0, command, comparable, evaluate, push

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.records.results import read_results

ROOT = Path(__file__).parents[2]


def test_outcomes_do_not_depend_on_connections_and_the_header_says_what_is_known(tmp_path: Path) -> None:
    def patient_push(request: Any) -> dict[str, Any]:
        # The first worker of the second evaluation waits for another: alone it may be done before that one has started.
        deadline = time.monotonic() + 60.0
        while len(server.connections) == 2 + 1 + 1 and time.monotonic() < deadline:
            time.sleep(0.05)
        return push(request)

    with OpenpiServer(patient_push, {"model": "pi", "reset_pose": [0.5]}) as server:
        one = evaluate(server.url, tmp_path / "one", "--trials=6")
        assert len(server.connections) == 2  # the probe's, and the worker's
        several = ["--workers=3", "--videos=1", "--remote.answer_seconds=120"]
        three = evaluate(server.url, tmp_path / "three", "--trials=6", *several)
        assert len(server.connections) >= 2 + 1 + 2
        address = server.url
    assert comparable(one) == comparable(three)
    assert all(record.error is None for record in one.trials)
    assert len({record.trajectory for record in one.trials}) == 6
    assert {record.success for record in one.trials} == {True, False}
    (header,) = one.headers.values()
    info = header.policies["theirs"]
    assert info.fingerprint.startswith("unknown:")
    assert info.remote is not None
    assert info.remote["address"] == info.path == address
    assert info.remote["metadata"] == {"model": "pi", "reset_pose": [0.5]}
    assert info.remote["weights"] == "unknown"
    assert info.remote["key_map"]["executed_steps"] == 5
    assert info.remote["outcomes"] == "depend on the server's random state"
    report = (tmp_path / "one" / "report.md").read_text()
    assert "weights unknown" in report
    assert "server: model" in report
    assert (tmp_path / "one" / "report.html").is_file()
    # No film is made by running a trial again: it need not take the same course.
    assert {record.trial for record in three.trials if record.video} == {0}


@contextlib.contextmanager
def answering(actions: Any) -> Iterator[str]:
    with OpenpiServer(lambda request: {"actions": actions} if isinstance(actions, np.ndarray) else actions) as server:
        yield server.url


NAN = np.full((50, 12), np.nan, np.float32)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (
            {"action": np.zeros((50, 12))},
            r"actions: not in the answer, which has action \(float64 \(50, 12\)\).*'action'",
        ),
        (
            {"actions": np.zeros((50, 7))},
            r"actions: found shape \(50, 7\), expected numbers of shape \(at least 5, 12\)",
        ),
        ({"actions": np.zeros((2, 50, 12))}, r"found shape \(2, 50, 12\)"),
        ({"actions": "no"}, "actions: found a str"),
        ({"actions": np.zeros((4, 12))}, r"found 4 action\(s\), expected at least 5.*--executed_steps=4"),
        ({"actions": NAN}, "actions: found 150 of 150 numbers of end_effector_position that are not finite"),
    ],
)
def test_the_first_answer_is_looked_at(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer: dict[str, Any], message: str
) -> None:
    import re

    with answering(answer) as url:
        assert main(command(url, tmp_path / "out")) == 2
    assert re.search(message, capsys.readouterr().err.replace("\n", " "))
    assert not (tmp_path / "out" / "trials.jsonl").exists()


def pi05(request: Any) -> dict[str, Any]:
    request["observation/right_image"]
    return push(request)


@pytest.mark.parametrize(
    ("keys", "more", "message"),
    [
        (PI0, "", "'observation/right_image' is in the key map robocasa365_pi05"),
        ("", "", "give --policy.keys, one of ours, robocasa365_pi0, robocasa365_pi05, robocasa_libero"),
        ("--policy.keys=robocasa365_pi", "", "Did you mean 'robocasa365_pi0"),
        ("--policy.keys=gr00t_n15", "", "the key map gr00t_n15 is for gr00t://"),
        ("--policy.keys=ours", "", "the server does not say that it is robocasa_lerobot's"),
        ("--policy.keys=a,b", "", "2 policy.keys for 1 policies behind a socket"),
        (PI0, "--executed_steps=51", "found 50 action(s), expected at least 51"),
        ("--policy.keys=robocasa365_pi05", "--remote.answer_seconds=0", "remote.answer_seconds: found 0"),
    ],
)
def test_keys_that_do_not_fit_are_found_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], keys: str, more: str, message: str
) -> None:
    with OpenpiServer(pi05 if not more else push) as server:
        assert main(command(server.url, tmp_path / "out", *filter(None, [more]), keys=keys)) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out" / "trials.jsonl").exists()


def test_nobody_there_is_said_as_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with OpenpiServer(push) as server:
        url = server.url
    assert main(command(url, tmp_path / "out", "--remote.connect_seconds=1")) == 2
    assert "refused, nobody listens there; tried for 1 s. Start the server" in capsys.readouterr().err


def test_an_env_that_shows_something_else_ends_the_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with OpenpiServer(push) as server:
        other = "--env.factory=remote_runs:OtherEnv"
        assert main(command(server.url, tmp_path / "out", other)) == 2
    assert "the env shows no picture of robot0_agentview_left" in capsys.readouterr().err
    assert read_results(tmp_path / "out").trials == []


class Faulty:
    """`push`, but from its request `after` on (the probe is number 1) one or all answers are faulty."""

    def __init__(self, fault: Callable[[dict[str, Any]], Any], after: int, once: bool) -> None:
        self._fault, self._after, self._once, self.asked = fault, after, once, 0

    def __call__(self, request: Any) -> Any:
        self.asked += 1
        hit = self.asked == self._after if self._once else self.asked >= self._after
        return self._fault(push(request)) if hit else push(request)


def raising(answer: dict[str, Any]) -> Any:
    raise MemoryError("the GPU is full")


FAULTS: dict[str, tuple[Callable[[dict[str, Any]], Any], str, str]] = {
    "nan": (lambda answer: {"actions": NAN}, "not finite", "diverged"),
    "shape": (lambda answer: {"actions": answer["actions"][:, :7]}, "found shape (50, 7)", "crashed"),
    "text": (raising, "MemoryError: the GPU is full", "crashed"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_answer_later_costs_an_attempt_and_one_that_stays_is_recorded(tmp_path: Path, fault: str) -> None:
    make, words, outcome = FAULTS[fault]
    with OpenpiServer(push) as server:
        healthy = evaluate(server.url, tmp_path / "healthy")
    with OpenpiServer(Faulty(make, after=4, once=True)) as server:
        results = evaluate(server.url, tmp_path / "once")
    assert comparable(results) == comparable(healthy)
    (retried,) = [record for record in results.trials if record.attempts == 2]
    assert words in str(retried.first_error)
    assert retried.first_outcome == outcome
    with OpenpiServer(Faulty(make, after=4, once=False)) as server:
        results = evaluate(server.url, tmp_path / "always", "--trials=2")
    assert {record.outcome for record in results.trials} == {outcome}
    assert all(words in str(record.error) for record in results.trials)
    assert words in (tmp_path / "always" / "report.md").read_text().replace("\\", "")


def stop_soon(server: OpenpiServer) -> None:
    threading.Thread(target=server.stop).start()
    time.sleep(1)  # this request is never answered


def test_a_server_that_is_killed_and_comes_back_costs_an_attempt(tmp_path: Path) -> None:
    with OpenpiServer(push) as server:
        healthy = evaluate(server.url, tmp_path / "healthy")
    with contextlib.ExitStack() as stack:
        first = stack.enter_context(OpenpiServer(Faulty(lambda answer: stop_soon(first), after=4, once=True)))

        def again() -> None:
            while first.running:
                time.sleep(0.02)
            stack.enter_context(OpenpiServer(push, port=first.port))

        threading.Thread(target=again).start()
        results = evaluate(first.url, tmp_path / "out")
    assert comparable(results) == comparable(healthy)
    (retried,) = [record for record in results.trials if record.attempts == 2]
    assert "LostError" in str(retried.first_error)
    assert "closed the connection" in str(retried.first_error)


def test_a_lost_connection_takes_no_attempt_from_an_error(tmp_path: Path) -> None:
    def lost(answer: dict[str, Any]) -> Any:
        server.connections[-1].socket.shutdown(socket.SHUT_RDWR)
        return answer

    faults = [lost, raising]
    with OpenpiServer(push) as server:
        healthy = evaluate(server.url, tmp_path / "healthy")
    fault = Faulty(lambda answer: faults.pop(0)(answer) if faults else answer, after=4, once=False)
    with OpenpiServer(fault) as server:
        results = evaluate(server.url, tmp_path / "out")
    assert comparable(results) == comparable(healthy)
    assert sorted(record.attempts for record in results.trials) == [1, 1, 1, 3]


def test_a_server_that_stays_away_ends_the_run_and_the_same_command_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    with OpenpiServer(push) as server:
        healthy = evaluate(server.url, tmp_path / "healthy", "--trials=8")
    with OpenpiServer(Faulty(lambda answer: stop_soon(server), after=12, once=True)) as server:
        assert main(command(server.url, out, "--trials=8", "--remote.connect_seconds=1")) == 2
    error = capsys.readouterr().err
    assert "refused, nobody listens there" in error
    assert "the same command goes on" in error
    before = (out / "trials.jsonl").read_text()
    recorded = [json.loads(line) for line in before.splitlines()][1:]
    assert 0 < len(recorded) < 8
    assert all(record["error"] is None for record in recorded)
    with OpenpiServer(push, port=server.port) as server:
        results = evaluate(server.url, out, "--trials=8")
    assert (out / "trials.jsonl").read_text().startswith(before)
    assert comparable(results) == comparable(healthy)
    # Another server under the same label is not mixed in.
    with OpenpiServer(push, {"model": "another"}) as server:
        assert main(command(server.url, out, "--trials=8")) == 2
    assert "policy 'theirs': key map or server's metadata unknown:" in capsys.readouterr().err


def test_a_server_that_answers_too_late_is_no_failed_trial(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def late(answer: dict[str, Any]) -> Any:
        time.sleep(2.0)
        return answer

    more = ["--remote.answer_seconds=1", "--remote.first_answer_seconds=1"]
    with OpenpiServer(Faulty(late, after=4, once=False)) as server:
        assert main(command(server.url, tmp_path / "out", *more)) == 2
    error = capsys.readouterr().err
    assert "policy 'theirs' was lost 3 times during Slide trial" in error
    assert "timed out, no answer within 1 s" in error
    assert all(record.error is None for record in read_results(tmp_path / "out").trials)


def test_a_long_first_answer_is_waited_for(tmp_path: Path) -> None:
    """Longer than an answer may take, and longer than a worker may be silent."""
    compiled = threading.Event()

    def compiling(request: Any) -> Any:
        if len(server.connections) == 2 and not compiled.is_set():
            time.sleep(4.0)
            compiled.set()
        return push(request)

    with OpenpiServer(compiling) as server:
        results = evaluate(server.url, tmp_path / "out", "--remote.answer_seconds=2", "--stall_seconds=2.5")
    assert [(record.error, record.attempts) for record in results.trials] == [(None, 1)] * 4


def test_shards_merge_when_the_server_has_gone(tmp_path: Path) -> None:
    """Also where it was asked as two policies, through two key maps."""
    maps = {"keys": "--policy.keys=robocasa365_pi0,robocasa365_pi05"}
    with OpenpiServer(push) as server:
        url, two = f"{server.url},{server.url}", "--policy.label=a,b"
        for shard in ("1/2", "2/2"):
            assert main(command(url, tmp_path / "out", f"--shard={shard}", two, **maps)) == 0
        whole = evaluate(url, tmp_path / "whole", two, **maps)
    assert main(command(url, tmp_path / "out", "--merge", two, **maps)) == 0
    assert comparable(read_results(tmp_path / "out")) == comparable(whole)


@pytest.mark.costly
@pytest.mark.render
def test_a_kitchen_goes_on_after_a_kill_of_the_evaluation(tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = threading.Event()

    def still(request: Any) -> Any:
        assert request["observation/image"].std() > 5 or request["prompt"] == "open the drawer"
        if len(server.connections) > 1:
            asked.set()
        return {"actions": np.zeros((50, 12), np.float32)}

    with OpenpiServer(still) as server:
        arguments = [f"--policy={server.url}", PI0, "--policy.label=theirs", "--env.tasks=OpenDrawer", "--trials=2"]
        more = ["--env.horizon=10", "--seed=100000", "--videos=0", "--workers=1", f"--out={out}", "--env.image_size=64"]
        eval_py = [sys.executable, str(ROOT / "eval.py"), *arguments, *more]
        process = subprocess.Popen(eval_py, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        assert asked.wait(120)
        process.kill()
        process.wait()
        subprocess.run(eval_py, cwd=ROOT, check=True, capture_output=True, timeout=200)
    records = read_results(out).trials
    assert [(record.error, record.steps) for record in records] == [(None, 10)] * 2
    assert "weights unknown" in (out / "report.md").read_text()
