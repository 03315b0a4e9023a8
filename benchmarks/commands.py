"""Runs commands of a checkout of ours with its own packages, one thread for each numerical library."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

RESULT = "RESULT "  # before the last line of what a program says, as JSON
CLI = ("-c", "import sys; from robocasa_lerobot.cli import main; sys.exit(main())")


def run(checkout: Path, command: Sequence[str]) -> str:
    """What a Python of a checkout prints; ends this program where it fails."""
    environment = {**os.environ, "PYTHONPATH": f"{checkout}{os.pathsep}{checkout / 'benchmarks'}"}
    environment |= {"OMP_NUM_THREADS": "1", "HF_HUB_OFFLINE": "1"}
    done = subprocess.run(
        [sys.executable, *command], cwd=checkout, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{command[0]} failed in {checkout}:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
    return done.stdout


def result(said: str) -> Any:
    """What a program has printed last, after `RESULT`."""
    return json.loads(said.rsplit(RESULT, 1)[1])
