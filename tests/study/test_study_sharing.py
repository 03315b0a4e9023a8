"""A study that several processes carry out together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.jobs.locks import locked
from robocasa_lerobot.study.runs import Run, StoppedError, root_for
from robocasa_lerobot.study.settings import load_study
from robocasa_lerobot.study.sharing import alone, helped_by, shared_runs, threads_of_each, trainings_at_once


@pytest.fixture
def runs(tmp_path: Path) -> list[Run]:
    return [Run("multitask", seed, tmp_path, configs_folder()) for seed in range(3)]


def test_each_run_is_one_process_at_a_time(runs: list[Run], tmp_path: Path) -> None:
    done: list[str] = []
    first = shared_runs(runs, lambda run: run.name in done, tmp_path)
    second = shared_runs(runs, lambda run: run.name in done, tmp_path)
    assert next(first) == runs[0]
    assert next(second) == runs[1]
    done.append(runs[0].name)
    assert next(first) == runs[2], "the second one's is left to it"
    done.append(runs[1].name)
    done.append(runs[2].name)
    assert not list(second)
    assert not list(first)


def test_what_another_process_gave_up_is_taken_over(
    runs: list[Run], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done: list[str] = []
    began = threading.Event()

    def hold_a_while() -> None:
        with locked(tmp_path / ".multitask-seed_0.lock", wait=False):
            began.set()
            time.sleep(0.5)

    other = threading.Thread(target=hold_a_while)
    other.start()
    assert began.wait(10)
    taken = []
    for run in shared_runs(runs, lambda run: run.name in done, tmp_path):
        taken.append(run.seed)
        done.append(run.name)
    other.join()
    assert taken == [1, 2, 0]
    assert "multitask/seed_0 is run by another process: waiting" in capsys.readouterr().out


def test_data_are_made_by_one_process_at_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    inside: list[str] = []
    with alone(tmp_path, "data"):

        def work() -> None:
            with alone(tmp_path, "data"):
                inside.append("other")

        other = threading.Thread(target=work)
        other.start()
        time.sleep(0.3)
        assert not inside
    other.join(20)
    assert inside == ["other"]
    assert "another process is at the data" in capsys.readouterr().out


def test_the_last_page_is_written_by_one_process_at_a_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept, page = tmp_path / "kept", tmp_path / "page.md"
    kept.mkdir()
    words = ["study", "--report", f"--root={tmp_path}", f"--results={kept}", f"--page={page}"]
    with alone(tmp_path, "page"):
        other = threading.Thread(target=cli.main, args=(words,))
        other.start()
        said = ""
        for _ in range(600):
            said += capsys.readouterr().out
            if "another process is at the page" in said or page.exists():
                break
            time.sleep(0.05)
        assert "another process is at the page" in said
        assert not page.exists()
    other.join(60)
    assert page.exists()


def test_small_policies_get_a_core_each() -> None:
    assert [trainings_at_once(None, 9, cores, cuda=False) for cores in (1, 2, 64)] == [1, 2, 4]
    assert trainings_at_once(None, 9, 16, cuda=True) == 1
    assert trainings_at_once(8, 9, 2, cuda=False) == 8, "as many as asked for"
    assert trainings_at_once(8, 0, 2, cuda=False) == 1
    alone = trainings_at_once(None, 1, 4, cuda=False)
    assert (alone, threads_of_each(alone, 4)) == (1, None), "one that is alone has all cores"
    assert [threads_of_each(at_once, 8) for at_once in (2, 3, 16)] == [4, 2, 1]


def test_a_helper_that_fails_is_told(tmp_path: Path) -> None:
    with (
        pytest.raises(StoppedError, match=r"status 2; its words are in .*helper_1.log"),
        helped_by(1, ["multitsk"], tmp_path, 1),
    ):
        pass
    assert "multitask" in (tmp_path / "helper_1.log").read_text(encoding="utf-8")


_WAITING = """
import sys, time
from pathlib import Path
from robocasa_lerobot.study import sharing
from robocasa_lerobot.errors import UserError
def start(arguments, environment, log):
    import subprocess
    saving = "import signal, sys, time; signal.signal(15, lambda *_: (time.sleep(0.5), print('saved', flush=True), "
    saving += "sys.exit(0))); print('ready', flush=True); sys.stdin.read()"
    return subprocess.Popen([sys.executable, "-c", saving], stdin=subprocess.PIPE, stdout=log, stderr=log)
sharing.start_command = start
try:
    with sharing.helped_by(2, [], Path(sys.argv[1]), 1):
        time.sleep(60)
except UserError as error:
    print(error)
    sys.exit(2)
"""


def test_helpers_save_before_they_end(tmp_path: Path) -> None:
    """A signal reaches them, and their input stays open until they have ended."""
    logs = [tmp_path / f"helper_{number}.log" for number in (1, 2)]
    with subprocess.Popen([sys.executable, "-c", _WAITING, str(tmp_path)], stdout=subprocess.PIPE, text=True) as parent:
        deadline = time.monotonic() + 60
        while not all(log.is_file() and "ready" in log.read_text() for log in logs):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        os.kill(parent.pid, signal.SIGTERM)
        said, _ = parent.communicate(timeout=60)
    assert parent.returncode == 2
    assert "the same study goes on there" in said
    assert [log.read_text().split() for log in logs] == [["ready", "saved"]] * 2


def test_no_training_at_a_time_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["study", "--at_once=0", "--plan"]) == 2
    assert "--at_once is 0" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.timeout(900)
def test_two_trainings_beside_each_other_end_as_one_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["study", "multitask", "--scale=tiny", "--seeds=2", "--episodes=more=1", "--at_once=2"]
    assert cli.main(words) == 0
    root = tmp_path / root_for(load_study(), "cpu", "tiny", "more=1")
    kept = {path.parent.name for path in root.glob("results/multitask/seed_*/about.json")}
    assert kept == {"seed_0", "seed_1"}
    helper = (root / "helper_1.log").read_text(encoding="utf-8")
    assert "== 2 of 2: multitask/seed_1" in helper
    assert "== 1 of 2: multitask/seed_0" in capsys.readouterr().out
    assert "== 1 of 2" not in helper
