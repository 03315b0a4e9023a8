"""MuJoCo's experimental web viewer, as we use it: a new version that changes it fails here."""

from __future__ import annotations

import functools
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.cli import main
from robocasa_lerobot.envs.web_view import WebView, as_shown

XML = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


@pytest.fixture(scope="module")
def view() -> Iterator[WebView]:
    with WebView("a ball") as running:
        yield running


def fetch(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return bytes(answer.read())


def other_address() -> str | None:
    """An address of this machine that is not the loopback's."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.connect(("192.0.2.1", 9))  # sends nothing; finds the outgoing address
        except OSError:
            return None
        return str(asked.getsockname()[0])


def test_page_and_model_answer(view: WebView) -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, data)
        view.sync(model, data)
    page = fetch(view.address)
    assert b"<html" in page.lower()
    shown = as_shown(model)
    assert not np.any(model.geom_group)
    assert not mujoco.MjvOption().geomgroup[shown.geom_group].any(), "shapes that are only touched"
    expected = np.empty(mujoco.mj_sizeModel(shown), np.uint8)
    mujoco.mj_saveModel(shown, None, expected)
    for _ in range(200):  # its thread takes the model over in its own time
        if len(served := fetch(view.address + "model")) == expected.size:
            break
        view.sync(model, data)
    assert served == expected.tobytes()


def test_what_is_shown_is_a_copy(view: WebView) -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    view.sync(model, data)
    assert view._copy is not None
    view._copy.qpos[:] = 7
    assert not np.any(data.qpos == 7)


def test_other_addresses_are_refused(view: WebView) -> None:
    address = other_address()
    if address is None or address.startswith("127."):
        pytest.skip("this machine has no address but the loopback's")
    with pytest.raises(OSError, match="refused"):
        socket.create_connection((address, view.port), timeout=5)


def test_a_taken_port_is_explained() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        command = [sys.executable, "-m", "robocasa_lerobot.cli", "view", "--task=OpenDrawer", "--web", f"--port={port}"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert str(port) in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_that_is_none_is_explained() -> None:
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "view", "--task=OpenDrawer", "--web", "--port=70000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "70000" in done.stderr
    assert "Traceback" not in done.stderr


def test_without_display_the_command_names_the_way(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["view"]) == (2 if sys.platform.startswith("linux") else 0)
    assert "--web" in capsys.readouterr().err


def test_the_command_serves_a_kitchen() -> None:
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "view", "--task=OpenDrawer", "--seed=100000", "--web"]
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    # A shell's background jobs ignore this signal, and so would what they start; in a terminal nobody does.
    heeds = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, preexec_fn=heeds)
    try:
        assert process.stdout is not None
        found = None
        while found is None and (line := process.stdout.readline()):
            found = re.search(r"http://127\.0\.0\.1:\d+/", line)
        assert found is not None, "the command printed no address"
        assert len(fetch(found[0] + "model")) > 0
        process.send_signal(signal.SIGINT)
        assert process.wait(60) in (0, 130)
    finally:
        process.kill()
