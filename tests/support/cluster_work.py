"""Demonstrations, a conversion and an evaluation by their users' commands, and what each left, to be compared."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from convert_support import tree_hashes

from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.evaluation.records.results import read_results

ROOT = Path(__file__).parents[2]
TASKS = ("CloseDrawer", "OpenDrawer")
DEMOS = ("demos", "--tasks", ",".join(TASKS), "--episodes", "1", "--seed", "100040", "--action-noise", "0.1")
EVALUATION = (
    *("eval", f"--env.tasks={','.join(TASKS)}", "--policy=random,zero", "--trials=2", "--videos=1"),
    *("--env.horizon=30", "--env.image_size=64", "--seed=100040", "--workers=1"),
)


def command(python: str | Path, words: Sequence[str], environment: Mapping[str, str] = os.environ) -> str:
    """What the command `robocasa-lerobot` prints."""
    places = os.pathsep.join(filter(None, (str(ROOT), environment.get("PYTHONPATH"))))
    done = subprocess.run(
        [str(python), "-m", "robocasa_lerobot.cli", *words],
        env={**environment, "PYTHONPATH": places},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, f"{words}: {done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def hdf5_content(path: Path) -> dict[str, Any]:
    """Everything in a file but when it was written."""
    found: dict[str, Any] = {}

    def note(name: str, item: h5py.Group | h5py.Dataset) -> None:
        found.update({f"{name}@{key}": value for key, value in item.attrs.items() if key not in ("date", "time")})
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(path) as file:
        file.visititems(note)
    return found


def same_demonstrations(one: Path, other: Path) -> None:
    for task in TASKS:
        here, there = hdf5_content(one / f"{task}.hdf5"), hdf5_content(other / f"{task}.hdf5")
        assert here.keys() == there.keys()
        assert all(np.array_equal(value, there[key]) for key, value in here.items())


def same_dataset(one: Path, other: Path) -> None:
    record = f"{META_FOLDER}/conversion.json"  # says how it was run
    trees = [{name: digest for name, digest in tree_hashes(root).items() if name != record} for root in (one, other)]
    assert trees[0] == trees[1]
    assert len(trees[0]) > 5


def same_trials(one: Path, other: Path) -> None:
    found = [sorted((r.comparable() for r in read_results(out).trials), key=str) for out in (one, other)]
    assert found[0] == found[1]
    assert len(found[0]) == 8
    assert all(record["error"] is None for record in found[0])
