"""The command: what it prints, that Ctrl+C and a kill leave whole episodes, that the same command goes on."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from teleop_support import SEED, SPLIT, TASK, WAIT_S, demonstration, drive

from robocasa_lerobot import cli, gl
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop import run as teleop_run
from robocasa_lerobot.teleop.client import TeleopClient
from robocasa_lerobot.teleop.run import Place
from robocasa_lerobot.teleop.settings import TeleopSettings

pytestmark = pytest.mark.render


@dataclass
class Command:
    """A running command."""

    process: subprocess.Popen[str]
    address: str
    printed: str

    def end(self, how: signal.Signals) -> tuple[int, str]:
        """Its status and what it printed at the end."""
        self.process.send_signal(how)
        out, _ = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, out


@contextmanager
def command(out: Path, *more: str) -> Iterator[Command]:
    arguments = ["--task", TASK, "--split", SPLIT, "--seed", str(SEED), "--image-size", "48", "--port", "0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "robocasa_lerobot.cli", "teleop", *arguments, "--out", str(out), *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    try:
        assert process.stdout is not None
        lines = ""
        while "Ctrl+C" not in lines:
            line = process.stdout.readline()
            assert line, lines
            lines += line
        found = re.search(r"http\S+", lines)
        assert found
        yield Command(process, found[0], lines)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()


def save_one(client: TeleopClient, seed: int) -> None:
    client.until(lambda: any(told["type"] == "scene" and told["seed"] == seed for told in client.said), WAIT_S)
    client.until_phase("ready", seconds=WAIT_S)
    drive(client, demonstration(seed).actions)
    client.until_phase("review")
    client.send("save")
    client.until_told("saved", WAIT_S)


@pytest.mark.costly
def test_ctrl_c_keeps_what_is_saved(tmp_path: Path) -> None:
    with command(tmp_path, "--episodes", "3", "--operator", "Ada", "--hide-goal") as running:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?t=[\w-]{20,}", running.address)
        port = running.address.split(":")[2].split("/")[0]
        assert f"ssh -L {port}:127.0.0.1:{port}" in running.printed
        with TeleopClient(running.address) as client:
            save_one(client, SEED)
            client.until_phase("ready", seconds=WAIT_S)
            client.send("clock", clock="free")
            client.send("start")
            client.until(lambda: client.frame["step"] > 3)
            assert not client.frame["terms"]
            status, printed = running.end(signal.SIGINT)
    assert status == 1
    assert f"1 of 3 episodes in {tmp_path / (TASK + '.hdf5')}" in printed
    assert "Traceback" not in printed
    with h5py.File(tmp_path / f"{TASK}.hdf5") as file:
        assert list(file["data"]) == ["demo_0"]
        assert "Ada" in file["data/demo_0"].attrs["ep_meta"]


@pytest.mark.slow
def test_a_killed_session_goes_on_with_the_same_command(tmp_path: Path) -> None:
    with command(tmp_path, "--episodes", "2") as running, TeleopClient(running.address) as client:
        save_one(client, SEED)
        client.until_phase("ready", seconds=WAIT_S)
        running.end(signal.SIGKILL)
    assert not (tmp_path / f"{TASK}.hdf5").exists()
    with command(tmp_path, "--episodes", "2") as running, TeleopClient(running.address) as client:
        assert (tmp_path / f"{TASK}.hdf5").exists()  # merged at the start
        client.until_phase("ready", seconds=WAIT_S)
        assert client.frame["saved"] == 1
        save_one(client, SEED + 1)
        client.until_told("done", WAIT_S)
        out, _ = running.process.communicate(timeout=WAIT_S)
    assert running.process.returncode == 0
    assert "2 of 2 episodes" in out
    for demo, seed in (("demo_0", SEED), ("demo_1", SEED + 1)):
        found = replay(tmp_path / f"{TASK}.hdf5", demo)
        assert (found.actions, found.states, found.deviation) == (True, True, 0.0)
        with h5py.File(tmp_path / f"{TASK}.hdf5") as file:
            assert np.array_equal(file[f"data/{demo}/actions"], demonstration(seed).actions)
    stats = json.loads((tmp_path / "teleop-stats.json").read_text())[TASK]
    assert (stats["saved"], stats["sessions"]) == (2, 2)
    with command(tmp_path, "--episodes", "2") as running:  # nothing is left to do
        running.process.communicate(timeout=WAIT_S)
        assert running.process.returncode == 0


def test_every_option_reaches_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[Any, ...]] = []

    def note(settings: TeleopSettings, place: Place, _: object, **others: Any) -> None:
        calls.append((settings, place, others))
        raise UserError("as far as this test goes")

    monkeypatch.setattr(teleop_run, "run_session", note)
    given = {
        "split": "pretrain", "episodes": 3, "seed": 7, "image-size": 48, "preset": "quality", "operator": "Ada",
        "layout": 4, "style": 5, "host": "::1", "port": 9, "policy": "zero", "policy-keys": "mine", "device": "cpu",
    }  # fmt: skip
    words = [f"--{name}={value}" for name, value in given.items()]
    line = ["teleop", "--task", TASK, "--out", str(tmp_path)]
    assert cli.main([*line, *words, "--hide-goal", "--free-view"]) == 2
    assert cli.main(line) == 2
    (settings, place, others), (usual, usual_place, usual_others) = calls
    assert settings == TeleopSettings(
        TASK, tmp_path, "pretrain", 3, 7, (4,), (5,), 48, "quality", operator="Ada", hide_goal=True
    )
    assert place == Place("::1", 9)
    assert others == {"policy": "zero", "device": "cpu", "keys": "mine", "free_view": True}
    assert (usual, usual_place) == (TeleopSettings(TASK, tmp_path), Place("127.0.0.1", 8765))
    assert usual_others == {"policy": "", "device": "auto", "keys": "", "free_view": False}


def test_mistakes_are_told_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["--out", str(tmp_path)]
    assert cli.main(["teleop", "--task", "CloseDraw", *out]) == 2
    assert "Did you mean 'CloseDrawer'" in capsys.readouterr().err
    assert cli.main(["teleop", "--task", TASK, "--episodes", "0", *out]) == 2
    assert cli.main(["teleop", "--task", TASK, "--host", "192.0.2.1", "--port", "0", *out]) == 2
    assert "nothing can be served at 192.0.2.1" in capsys.readouterr().err
    (tmp_path / f"{TASK}.hdf5").write_bytes(b"")
    assert cli.main(["teleop", "--task", TASK, *out]) == 2
    assert "did not record it here" in capsys.readouterr().err
    wrong = ["--policy", "nowhere", "--out", str(tmp_path / f"{TASK}.hdf5")]
    assert cli.main(["teleop", "--task", TASK, *wrong]) == 2
    assert "is a file. Choose a folder." in capsys.readouterr().err


def test_a_machine_without_opengl_is_told_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Though the robot's own cameras are drawn without: the map is not."""
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "cpu")
    monkeypatch.delenv(gl.VARIABLE, raising=False)
    monkeypatch.setattr(gl, "probe", lambda backend: gl.GLProbe(backend, None, "nothing"))
    out = tmp_path / "by_hand"
    assert cli.main(["teleop", "--task", TASK, "--policy", "nowhere", "--port", "0", "--out", str(out)]) == 2
    assert "apt-get install" in capsys.readouterr().err
    assert not out.exists()
