"""A file or folder that is not there is named at once, before what takes seconds is imported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from robocasa_lerobot import cli

PROGRAM = """
import sys
from robocasa_lerobot.cli import main
status = main(sys.argv[1:])
print(status, *(name for name in ("lerobot", "torch", "datasets") if name in sys.modules))
"""
COMMANDS = {
    "convert": "convert nowhere --out out",
    "convert with workers": "convert nowhere --out out --workers 2",
    "verify": "verify nowhere",
    "render": "render nowhere --out out",
    "export": "export nowhere --out out.hdf5",
    "inspect": "inspect nowhere",
    "train": "train --config_path nowhere",
    "data": "data nowhere",
    "eval": "eval --policy.path=nowhere --env.tasks=OpenDrawer",
    "report": "report nowhere",
    "replay": "replay nowhere",
    "prepare": "prepare nowhere",
    "generate": "generate --source nowhere --tasks OpenDrawer --out out",
}


@pytest.mark.parametrize("command", COMMANDS.values(), ids=COMMANDS)
def test_what_is_not_there_is_named_at_once(command: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *command.split()], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["2"], done.stderr
    assert "nowhere" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_file_where_a_folder_is_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").write_text("notes")
    assert cli.main(["gallery", "--tasks=OpenDrawer", f"--out={tmp_path / 'out'}"]) == 2
    assert f"{tmp_path / 'out'} is a file, where a folder is needed." in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "notes"
