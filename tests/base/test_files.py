"""Files that appear whole or not at all, and locks that die with their holder."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from robocasa_lerobot.files import write_text, written_aside
from robocasa_lerobot.jobs.child_process import environment_of_python
from robocasa_lerobot.jobs.locks import LockHeldError, locked

HOLDER = """
import sys, time
from pathlib import Path
from robocasa_lerobot.jobs.locks import locked
with locked(Path(sys.argv[1]), wait=False):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with written_aside(path) as aside:
        aside.write_text("new")
        assert not path.exists()
        assert list(tmp_path.glob("*.json")) == []
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_what_fails_leaves_the_file_before(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_text(path, "before")

    def fail() -> None:
        with written_aside(path) as aside:
            aside.write_text("half")
            raise OSError("no space")

    with pytest.raises(OSError, match="no space"):
        fail()
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


def test_one_process_holds_a_lock_until_it_dies(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, env=environment_of_python()
    ) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(LockHeldError, match="lock"), locked(path, wait=False):
            pytest.fail("held twice")
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    with locked(path, wait=False):
        assert path.exists()


def test_who_waits_gets_the_lock_next(tmp_path: Path) -> None:
    order: list[str] = []

    def second() -> None:
        with locked(tmp_path / "lock", wait=True):
            order.append("second")

    thread = threading.Thread(target=second)
    with locked(tmp_path / "lock", wait=True):
        thread.start()
        time.sleep(0.2)
        order.append("first")
    thread.join(30)
    assert order == ["first", "second"]
