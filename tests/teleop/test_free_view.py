"""MuJoCo's own viewer beside the operator's page."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
from teleop_support import WAIT_S

from robocasa_lerobot.teleop.client import TeleopClient


@pytest.mark.slow
@pytest.mark.render
def test_the_kitchen_is_in_the_free_view_too(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "teleop", "--task=CloseDrawer", "--seed=100002"]
    command += [f"--out={tmp_path}", "--port=0", "--free-view", "--image-size=32"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = ""
        while "Ctrl+C" not in said and (line := process.stdout.readline()):
            said += line
        page = re.search(r"open (\S+)", said)
        assert page is not None, said
        with TeleopClient(page[1]) as client:
            address = client.until_told("hello", WAIT_S)["free_view"]
            assert address in said
            client.until_phase("ready")
            while len(_fetch(address + "model")) < 1_000_000:  # an empty scene until the first state has come through
                client.receive(WAIT_S)
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 1  # nothing was saved


def _fetch(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return bytes(answer.read())
