"""robomimic, from the package itself, reads what we record and learns from it."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import h5py
import pytest
import venvs

from robocasa_lerobot import cli, contract

READER = Path(venvs.__file__).with_name("peers") / "robomimic_read.py"
STEPS = 30

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def python() -> Path:
    """Of the environment with robomimic."""
    try:
        return venvs.prepare_venv("robomimic", on_ours=True)
    except venvs.VenvError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two demonstrations, as the command records them."""
    out = tmp_path_factory.mktemp("demos")
    assert cli.main(["demos", "--tasks", "CloseDrawer", "--episodes", "2", "--workers", "1", "--out", str(out)]) == 0
    return out / "CloseDrawer.hdf5"


def read(python: Path, path: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([python, READER, path, str(STEPS)], capture_output=True, text=True, check=False)


def test_its_loader_reads_our_files_and_its_behaviour_cloning_learns_from_them(python: Path, recorded: Path) -> None:
    done = read(python, recorded)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    with h5py.File(recorded) as file:
        lengths = [len(file[f"data/demo_{i}/actions"]) for i in range(2)]
        assert file["data"].attrs["total"] == sum(lengths)
    assert found["env_name"] == "CloseDrawer"
    assert found["action_size"] == contract.ACTION_SIZE
    assert (found["demos"], found["steps"]) == (2, sum(lengths))
    assert len(found["losses"]) == STEPS
    assert sum(found["losses"][-5:]) < 0.5 * sum(found["losses"][:5])


def test_it_takes_every_member_of_data_for_a_demonstration(python: Path, recorded: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(recorded, tmp_path))
    with h5py.File(copy, "a") as file:
        file.move("assets", "data/assets")  # where earlier versions had them
    done = read(python, copy)
    assert done.returncode != 0
    assert "Error: " in done.stderr.splitlines()[-1]
