"""A command whose output nobody reads on, as before `head`, ends without a traceback."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_command_before_head_ends_quietly(unbuffered: str) -> None:
    command = f"{sys.executable} -m robocasa_lerobot.cli tasks --describe; echo status $? >&2"
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(
        ["bash", "-c", f"({command}) | head -1"], capture_output=True, text=True, env=environment, check=True
    )
    assert len(done.stdout.splitlines()) == 1
    assert done.stderr.strip() == "status 141"
