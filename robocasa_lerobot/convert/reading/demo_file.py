"""Demonstration files in the robomimic family of HDF5 layouts (RoboCasa, robosuite, this project), read lazily.

Layout: a group `data` with attributes about the environment, and one group `demo_<i>` for each episode with
`actions` (T, A), `states` (T, 1 + nq + nv) = [time, qpos, qvel] before each action, optional `obs/<name>` (T, ...),
and the attributes `model_file` (MJCF) and `ep_meta` (JSON). Pictures `obs/<camera>_image` are upright uint8 RGB.
Files that keep them elsewhere are read through a `Layout`.
"""

from __future__ import annotations

import contextlib
import fnmatch
import json
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.demo import (
    IMAGE_SUFFIX,
    MAX_COLUMN_VALUES,
    Demo,
    RejectedEpisodeError,
    SourceError,
    plain,
    text_of_attribute,
)
from robocasa_lerobot.convert.reading.hdf5 import (
    MAX_ASSET_BYTES,
    first_line,
    member,
    names,
    reading,
    recorded_attributes,
    shape_and_type,
)
from robocasa_lerobot.convert.reading.inputs import check_demo_file
from robocasa_lerobot.convert.reading.layout import DEFAULT_EPISODES, ROBOMIMIC, Layout

__all__ = ["IMAGE_SUFFIX", "MAX_COLUMN_VALUES", "Demo", "DemoFile", "RejectedEpisodeError", "SourceError"]

WHOLE_FILE = "episode"  # name of the only episode of a file that is one episode
UNKNOWN = "unknown"  # name of an environment that the file does not name
MASKS_GROUP = "mask"  # mask/<filter key>: names of the demos that belong to it
MAX_RATE_HZ = 10_000
# assets/<path>: files that the MJCF names, stored once for each HDF5 file; in older files of ours `data/assets/<path>`.
ASSETS_GROUP = "assets"
_DEMO = re.compile(r"demo_[0-9]{1,18}")
_NUMBERS = re.compile(r"([0-9]{1,18})")
_MAX_ASSET_NAME = 200
_SHOWN_NAMES = 8


class DemoFile:
    """An open demonstration file; use it in a `with` block.

    Raises:
        SourceError: no such file, not HDF5 or truncated, without a `data` group, or without demos.
    """

    def __init__(self, path: Path, layout: Layout = ROBOMIMIC) -> None:
        self.path, self.layout = path, layout
        check_demo_file(path)
        try:
            self._file = h5py.File(path, "r")
        except OSError as error:
            if "unable to lock file" in str(error):
                raise SourceError(f"{path} is locked: another process writes it. Wait until that has ended.") from None
            raise SourceError(
                f"{path} cannot be read as HDF5 ({first_line(error)}). It is truncated or not an HDF5 file: "
                "copy or record it again, or leave it out."
            ) from None
        try:
            with reading("its structure"):
                self._data, self.demo_names = self._find_episodes()
                self.attributes: dict[str, Any] = recorded_attributes(self._data)
        except RejectedEpisodeError as error:
            self._file.close()
            raise SourceError(f"{path} is damaged ({error}): copy or record it again.") from None
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _find_episodes(self) -> tuple[h5py.Group, list[str]]:
        """The group that holds the episodes, and their names in natural order."""
        pattern = self.layout.episodes
        if pattern == "/":
            return self._file, [WHOLE_FILE]
        where, _, last = pattern.strip("/").rpartition("/")
        data = member(self._file, where) if where else self._file
        if not isinstance(data, h5py.Group):
            found = ", ".join(names(self._file, "the file")) or "nothing"
            raise SourceError(
                f"{self.path} has no group {where!r} (found: {found}): it is not a demonstration file of a known kind. "
                "`robocasa-lerobot inspect` shows what it holds, and drafts a mapping for it."
            )
        if pattern == DEFAULT_EPISODES:
            found_names = [name for name in names(data, where) if _DEMO.fullmatch(name)]
        else:
            matching = fnmatch.filter(names(data, where), last)
            found_names = [name for name in matching if isinstance(member(data, name), h5py.Group)]
        if not found_names:
            wanted = "data/demo_<i>" if pattern == DEFAULT_EPISODES else pattern
            there = ", ".join(sorted(names(data, where))[:_SHOWN_NAMES]) or "nothing"
            raise SourceError(
                f"{self.path} has no demos (groups {wanted}; found: {there}): leave it out, or record it again."
            )
        return data, sorted(found_names, key=_natural)

    def strays(self) -> dict[str, str]:
        """Groups among the episodes that are not named as episodes are, and for each why it is none."""
        found: dict[str, str] = {}
        if self.layout.episodes != DEFAULT_EPISODES:
            return found
        for name in names(self._data, "data"):
            if _DEMO.fullmatch(name) or name == ASSETS_GROUP:
                continue
            reason = f"its group is named {name!r}, and episodes are named demo_<number>: rename it if it is one."
            try:
                if isinstance(member(self._data, name), h5py.Group):
                    found[name] = reason
            except RejectedEpisodeError as error:
                found[name] = f"{reason} {error}"
        return found

    def members(self, path: str) -> tuple[str, ...]:
        """Names in a group of the file; none where there is no such group."""
        group = self._file if path == "/" else member(self._file, path)
        return tuple(names(group, path)) if isinstance(group, h5py.Group) else ()

    @property
    def masks(self) -> tuple[str, ...]:
        """Names of the filter keys (`mask/<key>`)."""
        group = member(self._file, MASKS_GROUP)
        return tuple(names(group, MASKS_GROUP)) if isinstance(group, h5py.Group) else ()

    def mask(self, key: str) -> tuple[str, ...]:
        """Names of the demos of a filter key.

        Raises:
            SourceError: it is no list of names.
        """
        where = f"{MASKS_GROUP}/{key}"
        try:
            dataset = member(self._file, where)
            if not isinstance(dataset, h5py.Dataset):
                raise RejectedEpisodeError("it is no dataset")
            shape_and_type(dataset, where, MAX_COLUMN_VALUES)
            with reading(where):
                found = [text_of_attribute(value) for value in np.asarray(dataset[()]).ravel().tolist()]
        except RejectedEpisodeError as error:
            raise SourceError(f"{self.path}: mask/{key} cannot be read ({error}).") from None
        if any(name is None for name in found):
            raise SourceError(f"{self.path}: mask/{key} is no list of demo names.")
        return tuple(str(name) for name in found)

    def attribute(self, name: str) -> Any:
        """An attribute of the group that holds the episodes, else of the file, bytes as text, or None."""
        if name in self.attributes:
            return self.attributes[name]
        with reading(f"the attribute {name!r}"):
            return plain(self._file.attrs.get(name))

    def place(self, name: str) -> str:
        """HDF5 path of an episode's group; empty where the file is one episode."""
        if self.layout.episodes == "/":
            return ""
        where = self.layout.episodes.strip("/").rpartition("/")[0]
        return "/" + (f"{where}/{name}" if where else name)

    def demo(self, name: str) -> Demo:
        """An episode by its group name.

        Raises:
            RejectedEpisodeError: it is no group or is damaged.
        """
        whole = name == WHOLE_FILE and self.layout.episodes == "/"
        group = member(self._file, "/") if whole else member(self._data, name)
        if not isinstance(group, h5py.Group):
            raise RejectedEpisodeError("it is not an HDF5 group.")
        return Demo(self.path, name, group, self.layout)

    def asset(self, path: str) -> bytes | None:
        """Bytes of a file that is stored in the HDF5 file itself (`assets/<path>` or `data/assets/<path>`), or None."""
        inside = f"{ASSETS_GROUP}/{path.lstrip('/')}" if path.strip("/") else ""
        found = (member(place, inside) for place in (self._file, self._data)) if inside else iter(())
        dataset = next((node for node in found if isinstance(node, h5py.Dataset)), None)
        if dataset is None:
            return None
        _, dtype = shape_and_type(dataset, path, MAX_ASSET_BYTES)
        if dtype != np.uint8:
            return None
        with reading(path):
            return np.asarray(dataset[()]).tobytes()

    def assets(self) -> Iterator[tuple[str, bytes]]:
        """Path and bytes of the files that are stored in the HDF5 file itself, but what no scene could use."""
        found: list[str] = []
        for place in (self._file, self._data):
            group = member(place, ASSETS_GROUP)
            if isinstance(group, h5py.Group):
                with reading(ASSETS_GROUP):
                    group.visit(found.append)
        for name in dict.fromkeys(found):
            if {"..", "."} & set(name.split("/")) or len(name) > _MAX_ASSET_NAME:
                continue
            with contextlib.suppress(RejectedEpisodeError):
                content = self.asset(name)
                if content is not None:
                    yield name, content

    @cached_property
    def environment(self) -> dict[str, Any]:
        """What the file says about how its environment was made (`env_args` or the older `env_info`)."""
        env_args = _json_object(self.attributes.get("env_args"))
        kwargs = env_args.get("env_kwargs")
        return {**_json_object(self.attributes.get("env_info")), **(kwargs if isinstance(kwargs, dict) else {})}

    @cached_property
    def env_name(self) -> str:
        """Name of the environment (the task), or "unknown"."""
        names = (
            self.attributes.get("env"),
            _json_object(self.attributes.get("env_args")).get("env_name"),
            self.environment.get("env_name"),
        )
        return next((name for name in names if isinstance(name, str) and name), UNKNOWN)

    @cached_property
    def control_hz(self) -> int:
        """Control rate in Hz, from the environment's arguments, else from the recorded times, else the contract's.

        Raises:
            SourceError: it is not a positive whole number (a LeRobotDataset has a whole number of frames per second).
        """
        if self.layout.robot is not None:
            return self.layout.robot.fps
        rate = self._told_hz
        if rate is None:
            rate = contract.CONTROL_HZ
        if not isinstance(rate, int | float) or not 0 < rate <= MAX_RATE_HZ or round(rate) != rate:
            raise SourceError(f"{self.path} has the control rate {rate!r} Hz; a positive whole number is needed.")
        return int(rate)

    @property
    def rate_is_assumed(self) -> bool:
        """Whether nothing in the file, and no description of it, tells its control rate."""
        return self.layout.robot is None and self._told_hz is None

    @cached_property
    def _told_hz(self) -> Any:
        rate = self.environment.get("control_freq")
        return self._recorded_hz() if rate is None else rate

    def _recorded_hz(self) -> float | None:
        for name in self.demo_names:
            try:
                states = self.demo(name).states
            except RejectedEpisodeError:
                continue
            if states is not None and len(states) > 1:
                step = float(np.median(np.diff(states[:, 0])))
                return round(1.0 / step, 3) if step > 0 else None
        return None


def _natural(name: str) -> tuple[list[tuple[int, str]], str]:
    """Sorts by the numbers in names: demo_2 before demo_10."""
    return [(int(piece), "") if piece.isdecimal() else (-1, piece) for piece in _NUMBERS.split(name) if piece], name


def _json_object(value: Any) -> dict[str, Any]:
    if isinstance(value, str):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return {}
    return value if isinstance(value, dict) else {}
