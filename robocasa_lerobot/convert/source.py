"""Demonstration files in the robomimic family of HDF5 layouts (RoboCasa, robosuite, this project), read lazily.

Layout: a group `data` with attributes about the environment, and one group `demo_<i>` for each episode with
`actions` (T, A), `states` (T, 1 + nq + nv) = [time, qpos, qvel] before each action, optional `obs/<name>` (T, ...),
and the attributes `model_file` (MJCF) and `ep_meta` (JSON). Pictures `obs/<camera>_image` are upright uint8 RGB.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError, suggest

IMAGE_SUFFIX = "_image"
ASSETS_GROUP = "assets"  # data/assets/<path>: files that the MJCF names, stored once for each HDF5 file
# A dataset may declare any size in a few bytes; more values than this in one column is no demonstration.
MAX_COLUMN_VALUES = 200_000_000
_DEMO = re.compile(r"demo_(\d+)$")


class SourceError(UserError):
    """A demonstration file that cannot be read or holds nothing to convert."""


class RejectedEpisodeError(UserError):
    """One episode that cannot be converted; the others of its file can."""


class Demo:
    """One episode of a file. Nothing is read before it is asked for."""

    def __init__(self, file: Path, name: str, group: h5py.Group) -> None:
        self.file, self.name, self._group = file, name, group

    @cached_property
    def actions(self) -> NDArray[np.float64]:
        """Actions (T, A) float64 as stored in the file.

        Raises:
            RejectedEpisodeError: missing, not numeric, empty, or not finite.
        """
        actions = self._column(self._group, "actions", dimensions=2)
        if len(actions) == 0:
            raise RejectedEpisodeError("it has no steps.")
        return actions

    @property
    def length(self) -> int:
        """Number of steps, that of the actions."""
        return len(self.actions)

    @cached_property
    def states(self) -> NDArray[np.float64] | None:
        """Simulator states (T, 1 + nq + nv) float64, or None where the file has none.

        Raises:
            RejectedEpisodeError: their number differs from that of the actions, or they are not finite.
        """
        if "states" not in self._group:
            return None
        return self._same_length(self._column(self._group, "states", dimensions=2), "states")

    def observation(self, key: str) -> NDArray[np.float64] | None:
        """Low-dimensional observation `obs/<key>` (T, k) float64, or None where the file has none.

        Raises:
            RejectedEpisodeError: its length differs from that of the actions, or it is not finite.
        """
        observations = self._observations
        if observations is None or key not in observations:
            return None
        column = self._column(observations, key, dimensions=None)
        return self._same_length(column.reshape(len(column), -1), f"obs/{key}")

    @property
    def observation_keys(self) -> tuple[str, ...]:
        """Names under `obs`, pictures included."""
        return tuple(self._observations or ())

    @property
    def image_cameras(self) -> tuple[str, ...]:
        """Cameras whose pictures the file holds."""
        return tuple(key.removesuffix(IMAGE_SUFFIX) for key in self.observation_keys if key.endswith(IMAGE_SUFFIX))

    def image_shape(self, camera: str) -> tuple[int, int]:
        """Height and width in pixels of a stored camera.

        Raises:
            RejectedEpisodeError: the pictures are not (T, H, W, 3) uint8 with as many as there are actions.
        """
        dataset = self._image_dataset(camera)
        return int(dataset.shape[1]), int(dataset.shape[2])

    def images(self, camera: str, block: int = 64) -> Iterator[NDArray[np.uint8]]:
        """Stored pictures (H, W, 3) of a camera in order, read `block` at a time."""
        dataset = self._image_dataset(camera)
        for start in range(0, len(dataset), block):
            yield from self._read(dataset, slice(start, start + block), f"obs/{camera}{IMAGE_SUFFIX}")

    def image(self, camera: str, index: int) -> NDArray[np.uint8]:
        """One stored picture (H, W, 3)."""
        return self._read(self._image_dataset(camera), index, f"obs/{camera}{IMAGE_SUFFIX}")

    @cached_property
    def model_xml(self) -> str | None:
        """The MJCF of the episode's scene, or None."""
        return _text(self._group.attrs.get("model_file"))

    @cached_property
    def ep_meta(self) -> dict[str, Any]:
        """RoboCasa's description of the episode (instruction, scene, objects); empty where the file has none.

        Raises:
            RejectedEpisodeError: it is not a JSON object.
        """
        text = _text(self._group.attrs.get("ep_meta"))
        if text is None:
            return {}
        try:
            meta = json.loads(text)
        except json.JSONDecodeError as error:
            raise RejectedEpisodeError(f"its ep_meta is not JSON ({error}).") from None
        if not isinstance(meta, dict):
            raise RejectedEpisodeError(f"its ep_meta is a JSON {type(meta).__name__}, expected an object.")
        return meta

    @property
    def _observations(self) -> h5py.Group | None:
        group = self._group.get("obs")
        return group if isinstance(group, h5py.Group) else None

    def _image_dataset(self, camera: str) -> h5py.Dataset:
        key = camera + IMAGE_SUFFIX
        dataset = (self._observations or {}).get(key)
        if not isinstance(dataset, h5py.Dataset):
            raise RejectedEpisodeError(f"it has no obs/{key}.")
        if dataset.ndim != 4 or dataset.shape[3] != 3 or dataset.dtype != np.uint8:
            raise RejectedEpisodeError(f"obs/{key} is {dataset.shape} {dataset.dtype}, expected (T, H, W, 3) uint8.")
        if len(dataset) != self.length:
            raise RejectedEpisodeError(f"unequal lengths: {self.length} actions but {len(dataset)} obs/{key}.")
        return dataset

    def _same_length(self, column: NDArray[np.float64], what: str) -> NDArray[np.float64]:
        if len(column) != self.length:
            raise RejectedEpisodeError(f"unequal lengths: {self.length} actions but {len(column)} {what}.")
        return column

    def _column(self, group: h5py.Group, key: str, dimensions: int | None) -> NDArray[np.float64]:
        dataset = group.get(key)
        if not isinstance(dataset, h5py.Dataset):
            raise RejectedEpisodeError(f"it has no dataset {key!r}.")
        if dataset.dtype.kind not in "fiub" or dataset.ndim == 0 or dimensions not in (None, dataset.ndim):
            raise RejectedEpisodeError(f"{key} is {dataset.shape} {dataset.dtype}, expected (T, k) numbers.")
        if dataset.size > MAX_COLUMN_VALUES:
            raise RejectedEpisodeError(f"{key} declares the absurd shape {dataset.shape}.")
        values = self._read(dataset, (), key).astype(np.float64)
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            raise RejectedEpisodeError(
                f"{key} has {len(bad)} values that are NaN or infinite, the first at step {bad[0][0]}."
            )
        return values

    def _read(self, dataset: h5py.Dataset, where: Any, what: str) -> NDArray[Any]:
        try:
            return dataset[where]
        except (OSError, RuntimeError, ValueError, MemoryError) as error:
            raise RejectedEpisodeError(f"{what} cannot be read ({_first_line(error)}).") from None


class DemoFile:
    """An open demonstration file; use it in a `with` block.

    Raises:
        SourceError: no such file, not HDF5 or truncated, without a `data` group, or without demos.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            siblings = [p.name for p in path.parent.glob("*")] if path.parent.is_dir() else []
            kind = "is a folder" if path.is_dir() else "does not exist"
            raise SourceError(f"{path} {kind}; an HDF5 file is needed. {suggest(path.name, siblings)}")
        try:
            self._file = h5py.File(path, "r")
        except OSError as error:
            if "unable to lock file" in str(error):
                raise SourceError(f"{path} is locked: another process writes it. Wait until that has ended.") from None
            raise SourceError(
                f"{path} cannot be read as HDF5 ({_first_line(error)}). It is truncated or not an HDF5 file: "
                "copy or record it again, or leave it out."
            ) from None
        try:
            data = self._file.get("data")
            if not isinstance(data, h5py.Group):
                found = ", ".join(self._file) or "nothing"
                raise SourceError(f"{path} has no group 'data' (found: {found}): it is not a demonstration file.")
            self._data = data
            self.attributes: dict[str, Any] = {key: _plain(value) for key, value in data.attrs.items()}
            self.demo_names = sorted((name for name in data if _DEMO.match(name)), key=_demo_number)
            if not self.demo_names:
                raise SourceError(f"{path} has no demos (groups data/demo_<i>): leave it out, or record it again.")
        except SourceError:
            self._file.close()
            raise
        except (OSError, RuntimeError, KeyError) as error:
            self._file.close()
            raise SourceError(f"{path} is damaged ({_first_line(error)}): copy or record it again.") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def demo(self, name: str) -> Demo:
        """An episode by its group name.

        Raises:
            RejectedEpisodeError: it is no group or is damaged.
        """
        try:
            group = self._data[name]
        except (KeyError, OSError, RuntimeError) as error:
            raise RejectedEpisodeError(f"its group cannot be read ({_first_line(error)}).") from None
        if not isinstance(group, h5py.Group):
            raise RejectedEpisodeError("it is not an HDF5 group.")
        return Demo(self.path, name, group)

    def asset(self, path: str) -> bytes | None:
        """Bytes of a file that is stored in the HDF5 file itself (`data/assets/<path>`), or None."""
        group = self._data.get(ASSETS_GROUP)
        dataset = group.get(path) if isinstance(group, h5py.Group) and path else None
        return dataset[()].tobytes() if isinstance(dataset, h5py.Dataset) and dataset.dtype == np.uint8 else None

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
        return next((name for name in names if isinstance(name, str) and name), "unknown")

    @cached_property
    def control_hz(self) -> int:
        """Control rate in Hz, from the environment's arguments, else from the recorded times, else the contract's.

        Raises:
            SourceError: it is not a positive whole number (a LeRobotDataset has a whole number of frames per second).
        """
        rate = self.environment.get("control_freq")
        if rate is None:
            rate = self._recorded_hz() or contract.CONTROL_HZ
        if not isinstance(rate, int | float) or rate <= 0 or round(rate) != rate:
            raise SourceError(f"{self.path} has the control rate {rate!r} Hz; a positive whole number is needed.")
        return int(rate)

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


def _demo_number(name: str) -> tuple[int, str]:
    match = _DEMO.match(name)
    return (int(match.group(1)) if match else -1, name)


def _text(value: Any) -> str | None:
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    return value if isinstance(value, str) and value else None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return _text(value) or value


def _json_object(value: Any) -> dict[str, Any]:
    if isinstance(value, str):
        try:
            value = json.loads(value)
        except json.JSONDecodeError:
            return {}
    return value if isinstance(value, dict) else {}


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
