"""Demonstrations as HDF5 in RoboCasa's layout (robomimic's, with `model_file`, `states` and `ep_meta`)."""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import h5py
import mujoco
import numpy as np

from robocasa_lerobot import __version__
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.errors import UserError, differing
from robocasa_lerobot.hdf5_files import new_hdf5

ENV_TYPE_ROBOSUITE = 1  # robomimic's number for environments of this family
# Group of files that MJCFs name; MuJoCo needs them to load a `model_file` again. It lies beside `data`, not in it:
# robomimic takes every member of `data` for a demonstration.
ASSETS_GROUP = "assets"


@dataclass(frozen=True)
class Failure:
    """An attempt that did not succeed.

    Attributes:
        seed: of the attempt.
        reason: why.
        false_terms: the goal's terms that did not hold at the end.
        scene: seed of the kitchen, where that is another one: a replay happens in its source's.
        segments: of a generated one, each segment that it began: what that is about, and its source's name.
    """

    seed: int
    reason: str
    false_terms: tuple[str, ...] = ()
    scene: int | None = None
    segments: tuple[tuple[str, str], ...] = ()

    @property
    def scene_seed(self) -> int:
        """Of the kitchen."""
        return self.seed if self.scene is None else self.scene

    @classmethod
    def of(cls, values: dict[str, Any]) -> Failure:
        """Read what `asdict` gave, as JSON keeps it."""
        terms = tuple(values.get("false_terms", ()))
        segments = tuple((str(what), str(source)) for what, source in values.get("segments", ()))
        return cls(int(values["seed"]), str(values["reason"]), terms, values.get("scene"), segments)


def segments_of(meta: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """What each segment of a generated episode is about, and its source's name, from its `ep_meta`.

    Parts and objects are called as in the episode's own scene: `ref` is what the source called them.
    """
    rows = meta.get("generation", {}).get("segments", ())
    return tuple(
        (f"{row['kind']} {row.get('part', row.get('object', row['ref']))}".strip(), str(row["source"])) for row in rows
    )


def write_part(path: Path, recording: Recording) -> None:
    """Write one episode to a file of its own; it appears under its name only when complete.

    Raises:
        OSError: it cannot be written, on a full disk for example.
    """
    with new_hdf5(path) as file:
        demo = file.create_group("demo")
        demo.attrs["model_file"] = recording.model_file
        demo.attrs["ep_meta"] = json.dumps(recording.ep_meta)
        demo.attrs["num_samples"] = len(recording.actions)
        demo.attrs["seed"] = recording.seed
        demo.create_dataset("states", data=recording.states, compression="gzip")
        demo.create_dataset("actions", data=recording.actions, compression="gzip")
        demo.create_dataset("rewards", data=recording.rewards)
        demo.create_dataset("stage", data=recording.stages)
        terms = demo.create_dataset("success_terms", data=recording.success_terms, compression="gzip")
        terms.attrs["names"] = json.dumps(recording.term_names)
        dones = np.zeros(len(recording.actions), dtype=np.int64)
        dones[-1] = 1
        demo.create_dataset("dones", data=dones)
        for key, values in recording.per_step.items():
            demo.create_dataset(key, data=values, compression="gzip")
        for key, values in recording.observations.items():
            # A chunk for each picture: they are read one after the other, and h5py's own choice of chunks (16 steps
            # of an eighth of the picture) takes three times as long to unpack.
            chunks = (1, *values.shape[1:]) if values.ndim == 4 else None
            demo.create_dataset(f"obs/{key}", data=values, compression="gzip", chunks=chunks)
        for name, content in recording.assets.items():
            file.create_dataset(f"{ASSETS_GROUP}/{name}", data=np.frombuffer(content, dtype=np.uint8))


def versions() -> dict[str, str]:
    """Of what makes kitchens and moves them, by their attributes' names: under others the same seed may differ."""
    return {"robocasa_lerobot_version": __version__, "mujoco_version": mujoco.__version__}


# What only demonstrations of other kinds have, of plainly recorded ones, whose settings are all among theirs: of those
# generated, led astray, of corrected policies, driven by hand (with a policy).
RECORDED: Mapping[str, Any] = MappingProxyType(
    dict.fromkeys(("method", "disturbances", "fingerprint", "after_steps", "recorded_by", "with_policy"))
)


def recorded_otherwise(found: Mapping[str, Any], settings: Mapping[str, Any], software: Mapping[str, str]) -> str:
    """What differs where recordings are to be gone on with, and what to give or install; empty where nothing does.

    Args:
        found: settings and versions that stand beside what was recorded.
        settings: of now.
        software: `versions` of now.
    """
    settings = {**RECORDED, **settings}
    others = differing(found, {**settings, **software})
    remedy = "Give" if differing(found, settings) else "Install"
    return f"other settings ({others}). {remedy} those to go on with" if others else ""


@dataclass(frozen=True)
class Summary:
    """What a file of demonstrations says of itself; `settings` is None for files recorded by others."""

    settings: dict[str, Any] | None
    episodes: int
    steps: int
    tried: int
    failures: list[Failure]


def read_summary(path: Path) -> Summary:
    """Read the attributes of a file that `merge_parts` wrote; files of others have few of them, or none.

    Raises:
        UserError: it holds no demonstrations.
    """
    try:
        opened = h5py.File(path, "r")
    except OSError as error:
        raise UserError(f"{path} is no HDF5 file ({error}). Remove it, or choose another place.") from error
    with opened as file:
        if not isinstance(file.get("data"), h5py.Group):
            raise UserError(
                f"{path} holds no demonstrations: it has no group `data`. Remove it, or choose another place."
            )
        data = file["data"]
        attributes = data.attrs
        demos = [name for name in data if name.startswith("demo_")]
        total = attributes.get("total")
        return Summary(
            settings=json.loads(attributes["recording_settings"]) if "recording_settings" in attributes else None,
            episodes=len(demos),
            steps=int(total) if total is not None else sum(len(data[f"{name}/actions"]) for name in demos),
            tried=int(attributes.get("episodes_tried", 0)),
            failures=[Failure.of(f) for f in json.loads(attributes.get("failures", "[]"))],
        )


def merge_parts(
    path: Path,
    parts: Iterable[Path],
    *,
    env_name: str,
    env_kwargs: dict[str, Any],
    settings: dict[str, Any],
    tried: int,
    failures: list[Failure],
) -> int:
    """Join episode files to one file `path`, demos numbered from 0; returns the number of steps in all.

    The file appears under its name only when complete.

    Raises:
        OSError: it cannot be written, or a part cannot be read.
    """
    now = datetime.datetime.now(datetime.UTC)
    total = 0
    with new_hdf5(path) as file:
        data = file.create_group("data")
        for index, part in enumerate(parts):
            with h5py.File(part, "r") as source:
                source.copy(source["demo"], data, name=f"demo_{index}")
                for name in _asset_names(source):
                    if f"{ASSETS_GROUP}/{name}" not in file:
                        source.copy(source[f"{ASSETS_GROUP}/{name}"], file, name=f"{ASSETS_GROUP}/{name}")
                total += int(source["demo"].attrs["num_samples"])
        data.attrs.update(
            {
                "date": now.strftime("%m-%d-%Y"),
                "time": now.strftime("%H:%M:%S"),
                **versions(),
                "env": env_name,
                "env_info": json.dumps(env_kwargs),
                "env_args": json.dumps(
                    {
                        "env_name": env_name,
                        "env_version": __version__,
                        "type": ENV_TYPE_ROBOSUITE,
                        "mujoco_version": mujoco.__version__,
                        "env_kwargs": env_kwargs,
                    }
                ),
                "recording_settings": json.dumps(settings),
                "total": total,
                "episodes_tried": tried,
                "episodes_failed": len(failures),
                "failures": json.dumps([asdict(f) for f in failures]),
            }
        )
    return total


def _asset_names(file: h5py.File) -> list[str]:
    names: list[str] = []
    if ASSETS_GROUP in file:
        file[ASSETS_GROUP].visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names
