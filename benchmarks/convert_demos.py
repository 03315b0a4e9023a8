"""The demonstrations that `convert_speed.py` converts: one recording with pictures, and what is derived from it.

All of it lies in one folder and is made once; a file appears under its name only when it is complete.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from venvs import prepare_venv

import robocasa_lerobot
from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError

TASK = "OpenDrawer"
# Where the wheel of `requirements/robosuite_demos.lock` keeps human demonstrations of Lift, and what their scenes name.
LIFT_FILE = "demonstrations/lift/demo.hdf5"
LIFT_CAMERAS = ("agentview", "frontview", "robot0_eye_in_hand")
TINY_FRAMES, TINY_SIZE = 8, 64


@dataclass(frozen=True)
class DemoFiles:
    """The same demonstrations twice: with three cameras in the file, and states alone."""

    images: Path
    states: Path
    lengths: dict[str, int]  # steps by demo, in order

    @property
    def frames(self) -> int:
        """Steps of all demos."""
        return sum(self.lengths.values())


def record(folder: Path, episodes: int, workers: int, image_size: int = contract.IMAGE_SIZE) -> DemoFiles:
    """Record `episodes` demonstrations of a kitchen task with pictures, unless they are there, and strip a copy.

    The states-only copy has neither pictures nor proprioception, as human recordings come: both must be computed.
    """
    from robocasa_lerobot.demos.recording import RecordingSettings, record_task

    version = robocasa_lerobot.__version__  # another version may record other demonstrations
    place = folder / f"{TASK}-{episodes}-{image_size}-{version}"
    settings = RecordingSettings(TASK, episodes, images=True, image_size=image_size)
    images = record_task(settings, place, workers=workers).path
    states = place / f"{TASK}.states.hdf5"
    if not states.exists():
        with h5py.File(images, "r") as source, _written(states) as target:
            strip(source, target)
    return DemoFiles(images, states, demo_lengths(images))


def strip(source: h5py.File, target: h5py.File, steps: int | None = None) -> None:
    """Copy states, actions, scenes and attributes of every demo, the first `steps` steps of each; no observations."""
    data = target.create_group("data")
    data.attrs.update(source["data"].attrs)
    for name, group in source["data"].items():
        if name.startswith("demo_"):
            demo = data.create_group(name)
            demo.attrs.update(group.attrs)
            for key in ("states", "actions"):
                demo[key] = group[key][:steps]
            demo.attrs["num_samples"] = len(demo["actions"])
    for place in ("assets", "data/assets"):  # the second in files of earlier versions
        if place in source and "assets" not in target:
            source.copy(source[place], target, name="assets")
    data.attrs["total"] = sum(len(data[name]["actions"]) for name in data if name.startswith("demo_"))


def lift_assets() -> Path:
    """robosuite's folder of assets with the demonstrations, installed first if it is missing.

    Raises:
        UserError: it cannot be installed, or has no demonstrations.
    """
    python = prepare_venv("robosuite_demos")
    assets = next(python.parents[1].glob("lib/python*/site-packages/robosuite/models/assets"))
    if not (assets / LIFT_FILE).exists():
        raise UserError(f"{assets / LIFT_FILE} is not there: leave the official method out with --without-peer.")
    return assets


def cut_lift(folder: Path, steps: int, assets: Path) -> Path:
    """robosuite's Lift demonstrations below `assets`, the first `steps` steps of each."""
    recorded = assets / LIFT_FILE
    path = folder / f"lift-{steps}.hdf5"
    if not path.exists():
        with h5py.File(recorded, "r") as lift, _written(path) as target:
            strip(lift, target, steps)
    return path


def states_for_peer(path: Path) -> Path:
    """The states of a file as `.npz` beside it, for a program whose environment has no HDF5."""
    target = path.with_suffix(".npz")
    with h5py.File(path, "r") as file:
        np.savez(target, **{name: file["data"][name]["states"][:] for name in demo_lengths(path)})
    return target


def tiny(folder: Path, episodes: int) -> Path:
    """A file of `episodes` demonstrations of 8 frames in three 64x64 cameras: many episodes, little else."""
    path = folder / f"tiny-{episodes}.hdf5"
    if path.exists():
        return path
    rng = np.random.default_rng(0)
    parts = {part.name: part.size for part in contract.STATE_PARTS}
    with _written(path) as file:
        data = file.create_group("data")
        attributes: dict[str, Any] = {"env": TASK, "total": episodes * TINY_FRAMES}
        attributes["env_args"] = json.dumps({"env_name": TASK, "type": 1, "env_kwargs": {"control_freq": 20}})
        data.attrs.update(attributes)
        for index in range(episodes):
            demo = data.create_group(f"demo_{index}")
            demo.attrs.update({"ep_meta": json.dumps({"lang": "open the drawer"}), "num_samples": TINY_FRAMES})
            demo["actions"] = rng.uniform(-1, 1, (TINY_FRAMES, contract.ACTION_SIZE))
            for part, key in contract.STATE_PART_HDF5_KEYS.items():
                demo[f"obs/{key}"] = rng.uniform(-1, 1, (TINY_FRAMES, parts[part]))
            for camera in contract.CAMERAS:
                shade = np.linspace(0, 200, TINY_SIZE)[:, None, None] + rng.uniform(0, 50, (TINY_FRAMES, 1, 1, 3))
                shape = (TINY_FRAMES, TINY_SIZE, TINY_SIZE, 3)
                demo[f"obs/{camera}_image"] = np.broadcast_to(shade, shape).astype(np.uint8)
    return path


def demo_lengths(path: Path) -> dict[str, int]:
    """Steps by demo, in the order of their numbers."""
    with h5py.File(path, "r") as file:
        names = [name for name in file["data"] if name.startswith("demo_")]
        names.sort(key=lambda name: int(name.removeprefix("demo_")))
        return {name: len(file["data"][name]["actions"]) for name in names}


def deal(lengths: dict[str, int], processes: int) -> list[list[str]]:
    """Demos for each process, the longest first to whom has the least: as equal as whole demos allow."""
    hands: list[list[str]] = [[] for _ in range(processes)]
    loads = [0] * processes
    for name in sorted(lengths, key=lambda name: -lengths[name]):
        least = loads.index(min(loads))
        hands[least].append(name)
        loads[least] += lengths[name]
    return hands


@contextlib.contextmanager
def _written(path: Path) -> Iterator[h5py.File]:
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(path.name + ".part")
    with h5py.File(aside, "w") as file:
        yield file
    aside.replace(path)
