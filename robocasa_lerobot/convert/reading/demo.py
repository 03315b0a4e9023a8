"""One episode of a demonstration file, read lazily and checked: actions, states, observations, pictures, attributes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.chunks import deflated_row, holds_deflated_rows
from robocasa_lerobot.convert.reading.hdf5 import (
    MAX_COLUMN_VALUES,
    MAX_IMAGE_SIDE,
    MAX_MAGNITUDE,
    RejectedEpisodeError,
    SourceError,
    first_line,
    member,
    names,
    reading,
    recorded_attributes,
    shape_and_type,
    text_attribute,
)
from robocasa_lerobot.convert.reading.layout import ACTION_KEYS, ROBOMIMIC, Layout, Picture
from robocasa_lerobot.convert.reading.mjcf import names_model, read_model

__all__ = ["IMAGE_SUFFIX", "MAX_COLUMN_VALUES", "Demo", "RejectedEpisodeError", "SourceError", "first_line"]

IMAGE_SUFFIX = "_image"
MAX_SHOWN_TEXT = 200


class Demo:
    """One episode of a file. Nothing is read before it is asked for."""

    def __init__(self, file: Path, name: str, group: h5py.Group, layout: Layout = ROBOMIMIC) -> None:
        self.file, self.name, self.layout, self._group = file, name, layout, group
        self._columns: dict[str, NDArray[np.float64]] = {}

    @cached_property
    def actions(self) -> NDArray[np.float64]:
        """Actions (T, A) float64 as stored in the file.

        Raises:
            RejectedEpisodeError: missing, not numeric, empty, or not finite.
        """
        key = self.layout.action_key
        other = next((other for other in ACTION_KEYS if other != key and self.layout.robot is None), None)
        if other is not None and self.has(other) and not self.has(key):
            raise RejectedEpisodeError(f"it has no dataset {key!r}, but {other!r}: --action-key {other} takes these.")
        column = self._column(self._group, key, dimensions=2 if self.layout.robot is None else None)
        actions = _flat(column)
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
        if member(self._group, "states") is None:
            return None
        return self._same_length(self._column(self._group, "states", dimensions=2), "states")

    def column(self, key: str) -> NDArray[np.float64] | None:
        """Any numeric dataset below the episode, as (T, k) float64, or None where there is none of that path.

        Raises:
            RejectedEpisodeError: its length differs from that of the actions, or it is not finite.
        """
        if key == self.layout.action_key:
            return self.actions
        if key not in self._columns:
            if member(self._group, key) is None:
                return None
            column = self._column(self._group, key, dimensions=None)
            self._columns[key] = self._same_length(_flat(column), key)
        return self._columns[key]

    def observation(self, key: str) -> NDArray[np.float64] | None:
        """Low-dimensional observation `obs/<key>` (T, k) float64, or None where the file has none.

        Raises:
            RejectedEpisodeError: its length differs from that of the actions, or it is not finite.
        """
        return self.column(f"obs/{key}") if self._observations is not None else None

    @cached_property
    def observation_keys(self) -> tuple[str, ...]:
        """Names under `obs`, pictures included."""
        return tuple(names(self._observations, "obs")) if self._observations is not None else ()

    @cached_property
    def image_cameras(self) -> tuple[str, ...]:
        """Cameras whose pictures the file holds."""
        if self.layout.pictures is not None:
            return tuple(camera for camera, picture in self.layout.pictures if self.has(picture.key))
        return tuple(key.removesuffix(IMAGE_SUFFIX) for key in self.observation_keys if key.endswith(IMAGE_SUFFIX))

    def image_shape(self, camera: str) -> tuple[int, int]:
        """Height and width in pixels of a stored camera.

        Raises:
            RejectedEpisodeError: the pictures are not (T, H, W, 3) uint8 with as many as there are actions.
        """
        dataset = self._image_dataset(camera)
        return int(dataset.shape[1]), int(dataset.shape[2])

    def images(self, camera: str, block: int = 64) -> Iterator[NDArray[np.uint8]]:
        """Stored pictures (H, W, 3) of a camera in order, read `block` at a time, or one at a time if stored so."""
        dataset, picture = self._image_dataset(camera), self._picture(camera)
        with reading(picture.key):
            deflated = holds_deflated_rows(dataset)
        if deflated:
            for index in range(len(dataset)):
                with reading(picture.key):
                    row = deflated_row(dataset, index)
                yield _upright(row, picture.flip)
            return
        for start in range(0, len(dataset), block):
            yield from _upright(self._read(dataset, slice(start, start + block), picture.key), picture.flip)

    def image(self, camera: str, index: int) -> NDArray[np.uint8]:
        """One stored picture (H, W, 3)."""
        picture = self._picture(camera)
        return _upright(self._read(self._image_dataset(camera), index, picture.key), picture.flip)

    @cached_property
    def model_xml(self) -> str | None:
        """The MJCF of the episode's scene, or None; that of a file under `model_roots` where the episode names one.

        Raises:
            RejectedEpisodeError: that file is not there, or the attribute is damaged.
        """
        text = text_attribute(self._group, "model_file")
        if text is None or not names_model(text):
            return text
        return read_model(text, [Path(root) for root in self.layout.model_roots])

    @cached_property
    def ep_meta(self) -> dict[str, Any]:
        """RoboCasa's description of the episode (instruction, scene, objects); empty where the file has none.

        Raises:
            RejectedEpisodeError: it is not a JSON object.
        """
        text = text_attribute(self._group, "ep_meta")
        if text is None:
            return {}
        try:
            meta = json.loads(text)
            json.dumps(meta, ensure_ascii=False).encode()  # fails for halves of characters, which no file can hold
        except (ValueError, RecursionError) as error:  # also numbers of thousands of digits, and endless nesting
            raise RejectedEpisodeError(f"its ep_meta is not JSON ({error}).") from None
        if not isinstance(meta, dict):
            raise RejectedEpisodeError(f"its ep_meta is a JSON {type(meta).__name__}, expected an object.")
        return meta

    def attribute(self, name: str) -> Any:
        """An attribute of the episode's group, bytes as text, or None."""
        with reading(f"the attribute {name!r}"):
            return plain(self._group.attrs.get(name))

    def attribute_kinds(self) -> dict[str, str]:
        """Names of the attributes of the episode's group, each with its value, or its length where it is a long text.

        Raises:
            RejectedEpisodeError: they are damaged.
        """
        return {key: _shown(value) for key, value in recorded_attributes(self._group).items()}

    def text_of(self, key: str) -> str | None:
        """The text in a dataset below the episode (the first, if it has several), or None."""
        dataset = member(self._group, key)
        if not isinstance(dataset, h5py.Dataset) or 0 in shape_and_type(dataset, key)[0]:
            return None
        value = self._read(dataset, (0,) * dataset.ndim, key)
        return text_of_attribute(value)

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """Which source demonstrations an episode was generated from; empty for other episodes.

        `source_demos` are their indices, one for each subtask; `segments` are runs [index, number of steps], and
        `segment_kinds`, of our own generation, runs [kind, number of steps].

        Raises:
            RejectedEpisodeError: they are not numbers or cannot be read.
        """
        found: dict[str, Any] = {}
        for key, name in (
            ("src_demo_inds", "source_demos"),
            ("src_demo_labels", "segments"),
            ("segment_kind", "segment_kinds"),
        ):
            if not isinstance(member(self._group, key), h5py.Dataset):
                continue
            values = self._column(self._group, key, dimensions=None).ravel().astype(np.int64)
            if key == "src_demo_inds":
                found[name] = values.tolist()
            else:
                starts = np.flatnonzero(np.diff(values, prepend=values[:1] - 1))
                runs = np.diff([*starts, len(values)])
                found[name] = [[int(values[a]), int(n)] for a, n in zip(starts, runs, strict=True)]
        return found

    def shapes(self) -> dict[str, tuple[tuple[int, ...], str]]:
        """Shape and dtype of every dataset below the episode, by path."""
        found: dict[str, tuple[tuple[int, ...], str]] = {}

        def note(path: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[path] = (tuple(item.shape or ()), str(item.dtype))

        with reading("the list of its datasets"):
            self._group.visititems(note)
        return found

    def has(self, key: str) -> bool:
        """Whether there is anything of that path below the episode."""
        return member(self._group, key) is not None

    def _picture(self, camera: str) -> Picture:
        if self.layout.pictures is None:
            return Picture(f"obs/{camera}{IMAGE_SUFFIX}")
        return dict(self.layout.pictures)[camera]

    @cached_property
    def _observations(self) -> h5py.Group | None:
        group = member(self._group, "obs")
        return group if isinstance(group, h5py.Group) else None

    def _image_dataset(self, camera: str) -> h5py.Dataset:
        key = self._picture(camera).key
        dataset = member(self._group, key)
        if not isinstance(dataset, h5py.Dataset):
            raise RejectedEpisodeError(f"it has no {key}.")
        shape, dtype = shape_and_type(dataset, key)
        if len(shape) != 4 or shape[3] != 3 or dtype != np.uint8 or not 0 < max(shape[1:3]) <= MAX_IMAGE_SIDE:
            raise RejectedEpisodeError(f"{key} is {shape} {dtype}, expected (T, H, W, 3) uint8.")
        if shape[0] != self.length:
            raise RejectedEpisodeError(f"unequal lengths: {self.length} actions but {shape[0]} {key}.")
        return dataset

    def _same_length(self, column: NDArray[np.float64], what: str) -> NDArray[np.float64]:
        if len(column) != self.length:
            raise RejectedEpisodeError(f"unequal lengths: {self.length} actions but {len(column)} {what}.")
        return column

    def _column(self, group: h5py.Group, key: str, dimensions: int | None) -> NDArray[np.float64]:
        dataset = member(group, key)
        if not isinstance(dataset, h5py.Dataset):
            raise RejectedEpisodeError(f"it has no dataset {key!r}.")
        shape, dtype = shape_and_type(dataset, key, MAX_COLUMN_VALUES)
        if dtype.kind not in "fiub" or not shape or dimensions not in (None, len(shape)):
            raise RejectedEpisodeError(f"{key} is {shape} {dtype}, expected (T, k) numbers.")
        values = self._read(dataset, (), key).astype(np.float64)
        bad = np.argwhere(~(np.abs(values) <= MAX_MAGNITUDE))
        if len(bad):
            raise RejectedEpisodeError(
                f"{key} has {len(bad)} values that are NaN or infinite or beyond {MAX_MAGNITUDE:g}, the first at "
                f"step {bad[0][0]}."
            )
        return values

    def _read(self, dataset: h5py.Dataset, where: Any, what: str) -> NDArray[Any]:
        with reading(what):
            return dataset[where]


def _shown(value: Any) -> str:
    text = str(value)
    return text if len(text) <= MAX_SHOWN_TEXT else f"{len(text)} characters"


def _flat(column: NDArray[np.float64]) -> NDArray[np.float64]:
    return column.reshape(len(column), int(np.prod(column.shape[1:])))


def _upright(pictures: NDArray[np.uint8], flip: str) -> NDArray[np.uint8]:
    """Pictures (..., H, W, 3) flipped as said, contiguous."""
    if flip in ("vertical", "both"):
        pictures = pictures[..., ::-1, :, :]
    if flip in ("horizontal", "both"):
        pictures = pictures[..., ::-1, :]
    return np.ascontiguousarray(pictures)


def text_of_attribute(value: Any) -> str | None:
    """A text attribute, bytes as UTF-8, or None where it is empty or no text."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    return value if isinstance(value, str) and value else None


def plain(value: Any) -> Any:
    """An attribute as plain Python values, bytes as text."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list):
        return [plain(one) for one in value]
    return text_of_attribute(value) or value
