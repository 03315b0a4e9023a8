"""Damaged HDF5 files: each is refused, or converts to what is readable in it; nothing crashes, hangs or is made up."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from convert_support import leftovers
from fuzz_support import DAMAGES, base_file, in_child, mutate

from robocasa_lerobot import contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

VARIANTS = 12
SECONDS = 60.0


def _settings(variant: int) -> ConversionSettings:
    return ConversionSettings(cameras=contract.CAMERAS[: 1 + variant % 2])


def _outcome(source: Path, out: Path, settings: ConversionSettings) -> str:
    """How a conversion ended; runs in a child. Anything that should not be raises."""
    try:
        result = convert([source], out, settings, workers=1)
    except UserError:
        assert leftovers(out) == [], "something is at the output of a conversion that failed"
        return "refused"
    report = verify(out, pictures_per_episode=None)
    failed = {check.name for check in report.checks if not check.passed}
    # Pictures that damage has turned into noise do not survive lossy video: that verify says so is right.
    assert failed <= {"pictures"}, report.as_json()
    _compare(source, out)
    return "noise refused by verify" if failed else "rest converted" if result.rejected else "converted"


def _compare(source: Path, out: Path) -> None:
    """The dataset's numbers and instructions are those that h5py reads, and no demo is unaccounted for."""
    lines = read_jsonl(out / META_FOLDER / "episodes.jsonl")
    rejected = [line["source_demo"] for line in read_jsonl(out / META_FOLDER / "rejected.jsonl")]
    expected: dict[str, list[np.ndarray]] = {contract.ACTION_KEY: [], contract.STATE_KEY: []}
    with h5py.File(source, "r") as file:
        names = [name for name in file["data"] if name.startswith("demo_") and name[5:].isdecimal()]
        assert sorted([line["source_demo"] for line in lines] + rejected) == sorted(names)
        for line in lines:
            demo = file["data"][line["source_demo"]]
            actions = demo["actions"][()].astype(np.float64)
            assert len(actions) == line["length"]
            expected[contract.ACTION_KEY].append(contract.hdf5_to_stored(actions))
            parts = [demo["obs"][key][()].astype(np.float64) for key in contract.STATE_PART_HDF5_KEYS.values()]
            expected[contract.STATE_KEY].append(np.concatenate(parts, axis=1))
    for key, arrays in expected.items():
        assert column(out, key).tobytes() == np.concatenate(arrays).tobytes()


def _fuzz(folder: Path, seeds: range) -> Counter[str]:
    """Outcomes of conversions of damaged files.

    Raises:
        AssertionError: one of them crashed, hung, or gave what is not in its file; the message has how to repeat it.
    """
    outcomes: Counter[str] = Counter()
    problems: list[str] = []
    for seed in seeds:
        variant = seed % VARIANTS
        source, out = folder / f"damaged_{seed}.hdf5", folder / f"{seed}"
        damages = mutate(base_file(source, variant), np.random.default_rng(seed))
        ending = in_child(lambda source=source, out=out, v=variant: _outcome(source, out, _settings(v)), SECONDS)
        outcomes[ending.value or "problem"] += 1
        if ending.failure is not None:
            problems.append(f"seed {seed}, {damages}: {ending.failure}")
    assert not problems, f"{len(problems)} of {len(seeds)} files, {dict(outcomes)}:\n" + "\n".join(problems)
    return outcomes


def _warm(folder: Path) -> None:
    """Import everything once, before the children are made of this process."""
    source = base_file(folder / "good.hdf5", 0)
    assert _outcome(source, folder / "good", _settings(0)) == "converted"


@pytest.mark.costly
@pytest.mark.timeout(600)
def test_a_dozen_damaged_files(tmp_path: Path) -> None:
    _warm(tmp_path)
    outcomes = _fuzz(tmp_path, range(12))
    assert outcomes["refused"] > 0
    assert outcomes["rest converted"] > 0


@pytest.mark.slow
@pytest.mark.timeout(6000)
def test_five_hundred_damaged_files(tmp_path: Path) -> None:
    _warm(tmp_path)
    print(dict(_fuzz(tmp_path, range(1000, 1500))))


@pytest.mark.slow
def test_every_variant_of_the_undamaged_file_converts(tmp_path: Path) -> None:
    """Otherwise the damaged ones would prove nothing."""
    for variant in range(VARIANTS):
        source = base_file(tmp_path / f"{variant}.hdf5", variant)
        assert _outcome(source, tmp_path / f"{variant}", _settings(variant)) == "converted"


@pytest.mark.parametrize("name", DAMAGES)
def test_every_damage_changes_the_file(name: str, tmp_path: Path) -> None:
    source = base_file(tmp_path / "a.hdf5", 2)
    before = source.read_bytes()
    for seed in range(5):  # some changes may by chance be none
        DAMAGES[name](source, np.random.default_rng(seed))
        if source.read_bytes() != before:
            return
    pytest.fail("nothing changed")


def _die(how: str) -> Any:
    import os
    import signal
    import time

    if how == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if how == "hang":
        time.sleep(30)
    if how == "memory":
        return len(bytes(8 << 30))
    raise RuntimeError("ordinary")


@pytest.mark.parametrize(
    ("how", "message"),
    [("crash", "SIGSEGV"), ("hang", "not finished"), ("memory", "MemoryError"), ("raise", "ordinary")],
)
def test_the_harness_notices(how: str, message: str) -> None:
    ending = in_child(lambda: _die(how), seconds=2.0)
    assert message in (ending.failure or "")
