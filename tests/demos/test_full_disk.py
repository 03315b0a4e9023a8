"""A full disk is an OSError wherever the file of an episode, or of all of them, breaks off; nothing is left behind."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from full_disk import STEPS, full_after, recording

from robocasa_lerobot.demos.hdf5 import merge_parts, write_part


def merged(path: Path, parts: list[Path]) -> int:
    return merge_parts(path, parts, env_name="X", env_kwargs={}, settings={}, tried=2, failures=[])


def test_a_full_disk_is_an_oserror_wherever_a_file_breaks_off(tmp_path: Path) -> None:
    part, out = tmp_path / "000000.hdf5", tmp_path / "X.hdf5"
    write_part(part, recording())
    assert merged(out, [part, part]) == 2 * STEPS
    sizes = part.stat().st_size, out.stat().st_size
    part.rename(tmp_path / "kept")
    out.unlink()
    for share in (0.0, 0.01, 0.2, 0.5, 0.9, 0.999):
        with full_after(int(share * sizes[0])), pytest.raises(OSError, match=rf"too large.*{part.name}"):
            write_part(part, recording())
        with full_after(int(share * sizes[1])), pytest.raises(OSError, match=rf"too large.*{out.name}"):
            merged(out, [tmp_path / "kept"] * 2)
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    write_part(part, recording())
    merged(out, [part, part])
    with h5py.File(out) as file:
        for demo in file["data"].values():
            assert np.array_equal(demo["states"], recording().states)
            assert np.array_equal(demo["obs/picture"], recording().observations["picture"])


def test_a_part_that_cannot_be_read_is_an_oserror(tmp_path: Path) -> None:
    part = tmp_path / "000000.hdf5"
    write_part(part, recording())
    whole = part.read_bytes()
    part.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(OSError, match="truncated"):
        merged(tmp_path / "X.hdf5", [part])
    assert [path.name for path in tmp_path.iterdir()] == [part.name]
