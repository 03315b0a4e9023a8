"""Commands that convert import LeRobot without what only its policies need, in processes that are theirs alone."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from convert_support import write_demos

from robocasa_lerobot import cli
from robocasa_lerobot.convert import worker_imports

PROGRAM = """
import json, sys
from robocasa_lerobot.cli import main
status = main()
print(json.dumps([status, sorted(sys.modules)]))
"""
PACKAGES = {"transformers", "diffusers", "peft"}


def loaded_by(*command: str | Path) -> set[str]:
    command_line = [sys.executable, "-c", PROGRAM, *map(str, command)]
    done = subprocess.run(command_line, capture_output=True, text=True, check=True)
    status, modules = json.loads(done.stdout.splitlines()[-1])
    assert status == 0, done.stderr
    return set(modules)


def test_commands_do_without_the_packages_of_policies(tmp_path: Path) -> None:
    demos, out = write_demos(tmp_path / "demos.hdf5", images=32), tmp_path / "data"
    for command in (("convert", demos, "--out", out), ("verify", out)):
        modules = loaded_by(*command)
        assert "lerobot.datasets" in modules
        assert not PACKAGES & modules


def test_workers_are_forked_from_a_process_without_them() -> None:
    imports = [names for names in vars(worker_imports).values() if isinstance(names, tuple)]
    assert {names[0] for names in imports} == {worker_imports.LEAN_LEROBOT}  # before any that imports LeRobot
    modules = [name for names in imports for name in names]
    program = f"import sys\nfor name in {modules!r}: __import__(name)\nprint(*{PACKAGES!r} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_in_this_process_lerobot_stays_whole(tmp_path: Path) -> None:
    demos = write_demos(tmp_path / "demos.hdf5", images=32)
    assert cli.main(["convert", str(demos), "--out", str(tmp_path / "data")]) == 0
    assert worker_imports.LEAN_LEROBOT not in sys.modules
