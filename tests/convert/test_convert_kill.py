"""Conversions that are killed at any moment: the same command ends in the same dataset, and no one sees half of it."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from convert_support import leftovers, tree_hashes, write_demos

from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.publish import held_folder, partial_folder

EPISODES = 60
RECORD = f"{META_FOLDER}/conversion.json"  # names the output's place
COMPLETE = {"README.md", "data", "extras", "meta", "videos"}
SECONDS = 240


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lengths = [int(n) for n in np.random.default_rng(0).integers(8, 30, EPISODES)]
    return write_demos(tmp_path_factory.mktemp("source") / "sixty.hdf5", lengths, images=16)


@pytest.fixture(scope="module")
def expected(source: Path) -> dict[str, str]:
    """The dataset of a run in peace."""
    out = source.parent / "uninterrupted"
    convert([source], out, ConversionSettings(), workers=1)
    content = _content(out)
    assert len(content) > EPISODES
    return content


def _start(source: Path, out: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "convert", str(source), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--workers", "2"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )


def _check_absent_or_complete(out: Path, expected: dict[str, str]) -> bool:
    """What a loader would see at this moment; true where there is a dataset."""
    if not out.exists():
        return False
    assert {path.name for path in out.iterdir()} == COMPLETE
    assert _content(out) == expected
    return True


def _content(root: Path) -> dict[str, str]:
    """Hashes of every file but the record, whose own content but for places of files is added."""
    hashes = tree_hashes(root)
    del hashes[RECORD]
    record: dict[str, Any] = json.loads((root / RECORD).read_text())
    for entry in record["sources"]:
        del entry["relative_to_dataset"]
    return hashes | {RECORD: json.dumps(record, sort_keys=True)}


def _kill(process: subprocess.Popen[bytes], everything: bool) -> None:
    with contextlib.suppress(ProcessLookupError):
        if everything:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


@dataclass(frozen=True)
class Moment:
    """When to kill: once so many episodes are written (61: while they are joined), and so many seconds later."""

    episodes: int
    seconds: float

    def has_come(self, out: Path) -> bool:
        if self.episodes > EPISODES:
            return any(out.parent.glob(f"{out.name}.partial-*/merged"))
        written = out.parent.glob(f"{out.name}.partial-*/shards/*/extras/episode_*")
        return sum(1 for _ in written) >= self.episodes


def _kill_and_repeat(source: Path, out: Path, expected: dict[str, str], moment: Moment, everything: bool) -> bool:
    """Kill a conversion at a moment, then let the same command end; true if it was running."""
    process = _start(source, out)
    deadline = time.monotonic() + SECONDS
    while not moment.has_come(out) and process.poll() is None:
        assert time.monotonic() < deadline
        _check_absent_or_complete(out, expected)
        time.sleep(0.01)
    time.sleep(moment.seconds)
    was_running = process.poll() is None
    _kill(process, everything)
    killed = process.pid
    if not _check_absent_or_complete(out, expected) or leftovers(out) != [out.name]:
        process = _start(source, out)  # at once: orphans of the killed one may still be there
        while process.poll() is None:
            assert time.monotonic() < deadline + SECONDS
            _check_absent_or_complete(out, expected)
            time.sleep(0.05)
        said, _ = process.communicate(timeout=5)
        assert process.returncode == 0, said.decode()[-3000:]
    assert _check_absent_or_complete(out, expected)
    assert leftovers(out) == [out.name]
    while _session(killed):
        assert time.monotonic() < deadline + SECONDS, "processes of the killed run are still there"
        time.sleep(0.1)
    return was_running


def _session(leader: int) -> list[int]:
    """Processes that one of the commands started and that are still there."""
    found = []
    for process in psutil.pids():
        with contextlib.suppress(ProcessLookupError):
            if os.getsid(process) == leader and psutil.Process(process).status() != psutil.STATUS_ZOMBIE:
                found.append(process)
    return found


def _moments(count: int, seed: int) -> list[Moment]:
    """Moments over the whole run: while it starts (the first seconds), writes, and joins."""
    rng = np.random.default_rng(seed)
    moments = []
    for _ in range(count):
        episodes = int(rng.integers(-5, EPISODES + 10))
        longest = 4.0 if episodes <= 0 else 0.6 if episodes > EPISODES else 0.2
        moments.append(Moment(episodes, float(rng.uniform(0, longest))))
    return moments


@pytest.mark.slow
@pytest.mark.timeout(SECONDS * 4)
@pytest.mark.parametrize("everything", [True, False], ids=["the whole group", "only the parent"])
def test_a_kill(everything: bool, source: Path, expected: dict[str, str], tmp_path: Path) -> None:
    moment = Moment(40, 0.05) if everything else Moment(15, 0.1)
    assert _kill_and_repeat(source, tmp_path / "out", expected, moment, everything)


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.timeout(SECONDS * 4)
def test_a_kill_while_pictures_are_rendered(tmp_path: Path) -> None:
    """Then a process that compiles scenes is there, too."""
    states = write_demos(tmp_path / "states.hdf5", [20] * EPISODES)
    convert([states], tmp_path / "uninterrupted", ConversionSettings(), workers=1)
    expected = _content(tmp_path / "uninterrupted")
    assert _kill_and_repeat(states, tmp_path / "out", expected, Moment(30, 0.1), everything=False)


@pytest.mark.slow
@pytest.mark.timeout(SECONDS * 40)
def test_twenty_kills(source: Path, expected: dict[str, str], tmp_path: Path) -> None:
    running = 0
    for index, moment in enumerate(_moments(20, seed=1)):
        running += _kill_and_repeat(source, tmp_path / f"{index}", expected, moment, everything=index % 2 == 0)
    assert running >= 15, "most of the kills must meet a running conversion"


@pytest.mark.costly
def test_a_kill_while_clearing_away_is_made_good(
    source: Path, expected: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last thing that can be left: the dataset is there, and the working folder is, too."""
    out = tmp_path / "out"

    def killed(folder: Path) -> None:
        shutil.rmtree(folder / "shards" / "00000")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "clear_away", killed)
        with pytest.raises(KeyboardInterrupt):
            convert([source], out, ConversionSettings(), workers=1)
    left = _working_folder(out)
    assert leftovers(out) == ["out", left.name]
    result = convert([source], out, ConversionSettings(), workers=1)
    assert (result.num_episodes, result.rejected) == (EPISODES, [])
    assert _content(out) == expected
    assert leftovers(out) == ["out"]
    with pytest.raises(UserError, match="--overwrite"):  # with nothing left, a dataset at the output is not touched
        convert([source], out, ConversionSettings(), workers=1)
    left.mkdir()
    with pytest.raises(UserError, match="--overwrite"):  # nor by another command
        convert([source], out, ConversionSettings(image_size=32), workers=1)
    assert _content(out) == expected


@pytest.mark.costly
def test_a_kill_while_clearing_away_is_made_good_where_the_output_is_replaced(
    source: Path, expected: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is half removed says that it is complete, and must not be joined."""
    out = tmp_path / "out"

    def killed(folder: Path) -> None:
        (folder / "done").touch()
        shutil.rmtree(folder / "shards" / "00000")
        raise KeyboardInterrupt

    for _ in range(2):
        with monkeypatch.context() as patch:
            patch.setattr(pipeline, "clear_away", killed)
            with pytest.raises(KeyboardInterrupt):
                convert([source], out, ConversionSettings(), workers=1, overwrite=True)
    result = convert([source], out, ConversionSettings(), workers=1, overwrite=True)
    assert (result.num_episodes, result.rejected) == (EPISODES, [])
    assert _content(out) == expected
    assert leftovers(out) == ["out"]


def test_what_cannot_be_cleared_away_is_said(
    source: Path,
    expected: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Network file systems keep what is open; the dataset is there all the same."""
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rmdir", lambda path: (_ for _ in ()).throw(OSError(39, "Directory not empty")))
        assert convert([source], out, ConversionSettings(), workers=1).num_episodes == EPISODES
    assert "could not be removed" in capsys.readouterr().err
    assert _content(out) == expected


@pytest.mark.costly
def test_the_output_may_be_a_link_and_holds_no_source(source: Path, expected: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "disk")
    for _ in range(2):
        convert([source], link, ConversionSettings(), workers=1, overwrite=True)
        assert link.is_symlink()
        assert _content(tmp_path / "disk") == expected
    inside = Path(shutil.copy(source, tmp_path / "disk" / source.name))
    with pytest.raises(UserError, match=r"is inside --out .* would be replaced"):
        convert([inside], link, ConversionSettings(), workers=1, overwrite=True)
    assert inside.is_file()


def test_what_is_made_again_is_not_taken_for_what_was_left(source: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    convert([source], out, ConversionSettings(), workers=1)
    done = _working_folder(out) / "shards" / "00000"  # as a run with --overwrite leaves it
    done.mkdir(parents=True)
    with held_folder(_working_folder(out)), pytest.raises(UserError, match="running already"):
        convert([source], out, ConversionSettings(), workers=1)
    with pytest.raises(UserError, match="--overwrite"):
        convert([source], out, ConversionSettings(), workers=1)
    assert done.is_dir()


def _working_folder(out: Path) -> Path:
    return partial_folder(out, json.loads((out / RECORD).read_text())["fingerprint"])
