"""HDF5 files that are written aside: whole or not at all, also on a full disk."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from full_disk import full_after

from robocasa_lerobot import cli
from robocasa_lerobot.hdf5_files import changed_hdf5, new_hdf5

NUMBERS = np.random.default_rng(0).normal(size=(2000, 10))  # they do not pack well


def fill(file: h5py.File, name: str) -> None:
    file.create_dataset(name, data=NUMBERS, compression="gzip")


def test_a_file_is_changed_when_all_of_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.hdf5"
    with new_hdf5(path) as file:
        fill(file, "first")
        assert not path.exists()
    before = path.read_bytes()
    with changed_hdf5(path) as file:
        fill(file, "second")
        file.flush()
        assert path.read_bytes() == before
    with h5py.File(path) as file:
        assert sorted(file) == ["first", "second"]
        assert all(np.array_equal(file[name], NUMBERS) for name in file)
    assert [one.name for one in tmp_path.iterdir()] == ["a.hdf5"]


@pytest.mark.parametrize("share", [0.3, 1.0, 1.01, 1.5, 1.99])
def test_a_full_disk_leaves_the_file_as_it_was(tmp_path: Path, share: float) -> None:
    path = tmp_path / "a.hdf5"
    with new_hdf5(path) as file:
        fill(file, "first")
    before = path.read_bytes()
    with full_after(int(share * len(before))), pytest.raises(OSError, match="too large"), changed_hdf5(path) as file:
        fill(file, "second")
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == ["a.hdf5"]


def test_what_goes_wrong_while_writing_is_raised_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(KeyError, match="of our own"), new_hdf5(tmp_path / "a.hdf5"):
        raise KeyError("of our own")
    assert not list(tmp_path.iterdir())


def test_a_command_explains_a_full_disk(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def full(_: object) -> int:
        raise OSError(28, "No space left on device", "a.hdf5")

    monkeypatch.setattr("robocasa_lerobot.cli.prepare.run", full)
    assert cli.main(["prepare", "a.hdf5"]) == 2
    assert "'a.hdf5'. Free disk space, and give the command again." in capsys.readouterr().err
