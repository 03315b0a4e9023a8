"""Imports that take seconds: how often Python looks for garbage meanwhile, and workers that have them done."""

from __future__ import annotations

import gc
import importlib.util
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest
from lerobot.utils.import_utils import is_package_available

from robocasa_lerobot import cli
from robocasa_lerobot.cli import doctor
from robocasa_lerobot.jobs.importing import left_out
from robocasa_lerobot.policies.needs import OTHERS_PACKAGES

PROGRAM = """
import sys
from pathlib import Path
from multiprocess import forkserver
from robocasa_lerobot.jobs.importing import start_importing
from robocasa_lerobot.jobs.pool import PoolExecutor

def note(data, rank, world_size):
    Path(sys.argv[1], str(rank)).write_text(str("tabnanny" in sys.modules))

if __name__ == "__main__":
    start_importing(["tabnanny"])
    started = forkserver._forkserver._forkserver_pid
    PoolExecutor(pipeline=[note], tasks=2, workers=2, logging_dir=sys.argv[1], preload=["tabnanny"]).run()
    assert "tabnanny" not in sys.modules
    assert started is not None and forkserver._forkserver._forkserver_pid == started
"""


def test_a_command_looks_for_garbage_less_often_and_leaves_that_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []

    def run(args: Namespace) -> int:
        found.append(gc.get_threshold())
        raise FileNotFoundError(2, "no such file", "nowhere")

    monkeypatch.setattr(doctor, "run", run)
    before = gc.get_threshold()
    assert cli.main(["doctor"]) == 2
    assert found[0][0] > before[0]
    assert found[0][1:] == before[1:]
    assert gc.get_threshold() == before


def test_workers_come_from_the_process_that_was_started_ahead(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    folder = tmp_path / "logs"
    folder.mkdir()
    subprocess.run([sys.executable, str(program), str(folder)], check=True, timeout=120)
    assert [(folder / str(rank)).read_text() for rank in range(2)] == ["True", "True"]


def test_what_is_left_out_counts_as_not_installed_for_as_long_as_the_block_lasts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("this", "tabnanny", "antigravity"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    import tabnanny

    with left_out(["tabnanny", "antigravity"]):
        assert importlib.util.find_spec("antigravity") is None
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module("antigravity")
        assert importlib.import_module("tabnanny") is tabnanny  # there already
    assert "antigravity" not in sys.modules
    assert importlib.util.find_spec("antigravity") is not None
    assert sys.modules["tabnanny"] is tabnanny


def test_what_was_left_out_comes_back_after_an_error() -> None:
    with pytest.raises(ZeroDivisionError), left_out(["antigravity"]):
        raise ZeroDivisionError
    assert "antigravity" not in sys.modules


@pytest.mark.parametrize("package", OTHERS_PACKAGES)
def test_lerobot_finds_none_of_what_is_left_out(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, package, raising=False)  # another test has imported it
    installed = is_package_available(package)
    with left_out([package]):
        assert not is_package_available(package)
    assert is_package_available(package) is installed
