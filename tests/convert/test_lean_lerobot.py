"""Commands that convert import LeRobot without what only its policies need, in processes that are theirs alone."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from convert_support import write_demos

from robocasa_lerobot import cli
from robocasa_lerobot.convert.worker_imports import LEAN_LEROBOT, worker_imports

PROGRAM = """
import json, sys
from robocasa_lerobot.cli import main
status = main()
print(json.dumps([status, sorted(sys.modules)]))
"""
MODULES = ("robocasa_lerobot.convert.shard", "robocasa_lerobot.convert.rerender.work")
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
    imports = [worker_imports(module, lean=True) for module in MODULES]
    assert {names[0] for names in imports} == {LEAN_LEROBOT}  # before any that imports LeRobot
    modules = [name for names in imports for name in names]
    program = f"import sys\nfor name in {modules!r}: __import__(name)\nprint(*{PACKAGES!r} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("module", MODULES)
def test_workers_of_a_process_with_all_of_lerobot_have_it_too(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert worker_imports(module) == (module,)
    monkeypatch.setitem(sys.modules, LEAN_LEROBOT, sys)
    assert worker_imports(module) == (LEAN_LEROBOT, module)


def test_in_this_process_lerobot_stays_whole(tmp_path: Path) -> None:
    demos = write_demos(tmp_path / "demos.hdf5", images=32)
    assert cli.main(["convert", str(demos), "--out", str(tmp_path / "data")]) == 0
    assert LEAN_LEROBOT not in sys.modules
