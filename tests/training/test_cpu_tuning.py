"""The setting for waiting threads is made before torch reads it, and never over the user's own."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from robocasa_lerobot.training.cpu_tuning import limit_spinning


def test_the_users_own_setting_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")
    limit_spinning()
    assert os.environ["GOMP_SPINCOUNT"] == "7"


def test_the_train_command_sets_it_before_torch_is_loaded() -> None:
    program = """
import argparse, os, sys
from robocasa_lerobot.training import cpu_tuning
from robocasa_lerobot.cli import train as command
def check():
    assert "torch" not in sys.modules
    print("set")
    sys.exit(0)
cpu_tuning.limit_spinning = check
command.run(argparse.Namespace(config_path="none.yaml", end_with_input=False))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "set\n"), done.stderr
