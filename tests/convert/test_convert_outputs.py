"""Outputs: paths that cannot be written or exist already, a full disk, files that may not grow, dead workers."""

from __future__ import annotations

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from convert_support import leftovers, tree_hashes, write_demos
from fuzz_support import in_child
from lerobot.datasets.dataset_metadata import CODEBASE_VERSION

from robocasa_lerobot import contract
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.pipeline import ConversionResult, convert
from robocasa_lerobot.convert.reading.hdf5 import SourceError
from robocasa_lerobot.convert.reading.inputs import demo_files
from robocasa_lerobot.convert.settings import ConversionSettings, Plan
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing import card
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess
from robocasa_lerobot.errors import UserError

SETTINGS = ConversionSettings()
STEPS = 6
CAMERA = f"obs/{contract.CAMERAS[0]}_image"


def test_an_output_beside_which_nothing_can_be_written(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (3,), images=16)
    (tmp_path / "file").write_text("a file, not a folder")
    with pytest.raises(UserError, match="nothing can be written"):
        convert([source], tmp_path / "file" / "out", SETTINGS)
    read_only = Path("/sys/kernel")  # even for the superuser
    if read_only.is_dir():
        with pytest.raises(UserError, match="nothing can be written"):
            convert([source], read_only / "out", SETTINGS)
    if os.geteuid() != 0:
        locked = tmp_path / "locked"
        locked.mkdir(mode=0o555)
        with pytest.raises(UserError, match="nothing can be written"):
            convert([source], locked / "out", SETTINGS)


@pytest.mark.parametrize("what", ["file", "folder of something else", "dataset"])
def test_an_output_that_exists_is_left_alone(what: str, tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (3,), images=16)
    out = tmp_path / "out"
    if what == "file":
        out.write_text("years of work")
    elif what == "dataset":
        convert([source], out, SETTINGS)
    else:
        (out / "thesis").mkdir(parents=True)
    before = tree_hashes(out) if out.is_dir() else out.read_text()
    with pytest.raises(UserError, match="exists already"):
        convert([source], out, SETTINGS)
    assert (tree_hashes(out) if out.is_dir() else out.read_text()) == before


class _FullDisk:
    """A file system that is full after a number of pictures."""

    def __init__(self, pictures: int) -> None:
        self.left = pictures
        self.feed = EncodingProcess.feed

    def __call__(self, encoder: EncodingProcess, key: str, image: np.ndarray) -> None:
        self.left -= 1
        if self.left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.feed(encoder, key, image)


def test_a_full_disk_keeps_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write_demos(tmp_path / "a.hdf5", (501, 501), images=16)
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        full = _FullDisk(501 * 3 + 100)
        patch.setattr(EncodingProcess, "feed", lambda *args: full(*args))
        with pytest.raises(UserError, match="No space left on device") as caught:
            convert([source], out, SETTINGS, workers=1)
    assert "same command to go on" in str(caught.value)
    assert not out.exists()
    done = []
    convert_shard = pipeline.convert_shard
    monkeypatch.setattr(pipeline, "convert_shard", lambda *args: (done.append(args[1].demos), convert_shard(*args))[1])
    assert convert([source], out, SETTINGS, workers=1).num_frames == 1002
    assert done == [("demo_1",)]
    assert leftovers(out) == ["out"]


def test_what_appears_at_the_output_meanwhile_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, other = (
        write_demos(tmp_path / name, (5,), images=16, seed=i) for i, name in enumerate(("a.hdf5", "b.hdf5"))
    )
    out, join = tmp_path / "out", pipeline._join

    def slowly(plan: Plan, partial: Path, place: Path) -> ConversionResult | None:
        with monkeypatch.context() as patch:
            patch.setattr(pipeline, "_join", join)
            convert([other], out, SETTINGS, workers=1)
        return join(plan, partial, place)

    monkeypatch.setattr(pipeline, "_join", slowly)
    with pytest.raises(UserError, match="exists already"):
        convert([source], out, SETTINGS, workers=1)
    monkeypatch.setattr(pipeline, "_join", join)
    assert verify(out, [other], min_psnr_db=10.0).passed  # the pictures are tiny
    assert convert([source], out, SETTINGS, workers=1, overwrite=True).num_episodes == 1


def _convert_with_short_files(source: Path, out: Path, limit: int) -> str:
    """The message of a conversion in which no file may be longer than `limit` bytes; runs in a child."""
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 2)  # what was captured so far may be longer
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        convert([source], out, SETTINGS, workers=1)
    except UserError as error:
        return str(error)
    return "converted"


@pytest.mark.costly
@pytest.mark.parametrize("limit", [2_000, 8_000, 40_000])
def test_files_that_may_not_grow(limit: int, tmp_path: Path) -> None:
    """The kernel's own error in the middle of a file, of whatever writes it: videos, tables, extras."""
    source = write_demos(tmp_path / "a.hdf5", (120, 130), images=64)
    out = tmp_path / "out"
    ending = in_child(lambda: _convert_with_short_files(source, out, limit))
    assert ending.failure is None, ending.failure
    assert "writing failed" in ending.value
    assert "File too large" in ending.value
    assert not out.exists()
    assert convert([source], out, SETTINGS, workers=1).num_frames == 250
    assert verify(out, pictures_per_episode=2).passed
    assert leftovers(out) == ["out"]


def test_a_worker_that_dies_is_reported(tmp_path: Path) -> None:
    """Of memory, say; a pool by itself would wait for it forever."""
    command = [sys.executable, "-c", _DYING, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert "SIGKILL" in result.stdout, result.stderr[-3000:]
    assert "memory may have run out" in result.stdout


_DYING = """
import sys
from robocasa_lerobot.jobs.pool import PoolExecutor, WorkerDiedError

def die(data, rank=0, world_size=1):
    import os, signal, time
    time.sleep(1)
    if rank == 1:
        os.kill(os.getpid(), signal.SIGKILL)

try:
    PoolExecutor(pipeline=[die], tasks=3, workers=2, logging_dir=sys.argv[1]).run()
except WorkerDiedError as error:
    print(error)
"""


def test_a_source_whose_name_is_no_utf_8(tmp_path: Path) -> None:
    source = tmp_path / os.fsdecode(b"caf\xe9.hdf5")
    write_demos(tmp_path / "a.hdf5", (3,), images=16).rename(source)
    root = convert([source], tmp_path / "out", SETTINGS, workers=1).root
    for name in ("README.md", "meta/robocasa/episodes.jsonl"):
        assert "caf\\udce9.hdf5" in (root / name).read_text(encoding="utf-8")


def test_publishing_tags_the_version_that_lerobot_asks_for() -> None:
    command = f"hf repos tag create OWNER/NAME {CODEBASE_VERSION} --repo-type dataset"
    assert command in (Path(__file__).parents[2] / "docs" / "data.md").read_text(encoding="utf-8")
    assert command in (card.__doc__ or "")


def test_a_folder_stands_for_the_files_in_it(tmp_path: Path) -> None:
    for name in ("b.hdf5", "a.hdf5", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "data" / "meta").mkdir(parents=True)
    (tmp_path / "data" / "meta" / "info.json").touch()
    (tmp_path / "empty").mkdir()
    found = demo_files([tmp_path, tmp_path / "data", tmp_path / "b.hdf5"])
    assert found == [tmp_path / name for name in ("a.hdf5", "b.hdf5", "data", "b.hdf5")]
    with pytest.raises(SourceError, match="is a folder without HDF5 files, and no dataset either"):
        demo_files([tmp_path / "empty"])
    with pytest.raises(SourceError, match=r"a\.hdf does not exist; .*Did you mean 'a\.hdf5'"):
        demo_files([tmp_path / "a.hdf"])
