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


def test_processes_that_write_the_same_file_at_once_have_paths_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "file"
    command = (
        "import sys; from pathlib import Path; from robocasa_lerobot.files import written_aside\n"
        "with written_aside(Path(sys.argv[1]), by_many=True) as aside:\n"
        "    aside.write_text('theirs'); print(aside, flush=True); input()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", command, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        theirs = Path(other.stdout.readline().strip())
        with written_aside(path, by_many=True) as aside:
            assert aside != theirs
            aside.write_text("ours")
        assert (path.read_text(), theirs.read_text()) == ("ours", "theirs")
        other.stdin.write("\n")
    assert path.read_text() == "theirs"
    assert list(tmp_path.iterdir()) == [path]
