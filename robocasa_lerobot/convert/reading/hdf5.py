"""Reading HDF5 files that may be damaged or hostile: every failure is one of this project's errors, never zeros.

HDF5 itself follows links into other files, takes raw data from any file that a dataset names, and gives fill values
where chunks are missing. None of that is a demonstration: nothing outside the file is opened, and data missing in the
file is an error. Sizes are looked at before anything is read, since a few bytes can declare any size.
"""

from __future__ import annotations

import contextlib
import errno
import math
import re
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError

# Larger sizes than these are no demonstration's: values of one column, bytes of one text, of one chunk, of one file
# that a scene names, and of one attribute that is only kept as a record; height and width of pictures.
MAX_COLUMN_VALUES = 50_000_000
MAX_MAGNITUDE = 1e30  # of numbers: beyond it squares, and so statistics, soon overflow
MAX_VALUES = 1 << 40  # of pictures, which are read a few at a time
MAX_TEXT_BYTES = 32 << 20
MAX_CHUNK_BYTES = 1 << 30
MAX_ASSET_BYTES = 1 << 29
MAX_RECORDED_BYTES = 1 << 20
MAX_IMAGE_SIDE = contract.LARGEST_IMAGE_SIZE
LEFT_OUT = "(attributes left out)"
_MAX_LINKS = 8
# Errors of a disk or a network file system.
_NOT_OF_THE_FILE = (errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.ENOTCONN, errno.EHOSTDOWN)
# Everything that h5py has been seen to raise on damaged files.
_FAILURES = (OSError, RuntimeError, ValueError, TypeError, LookupError, ArithmeticError, MemoryError, SystemError)


class SourceError(UserError):
    """A demonstration file that cannot be read or holds nothing to convert."""


class RejectedEpisodeError(UserError):
    """One episode that cannot be converted; the others of its file can."""


@contextlib.contextmanager
def reading(what: str) -> Iterator[None]:
    """Turn whatever h5py raises in the body into a RejectedEpisodeError that names `what`."""
    try:
        yield
    except UserError:
        raise
    except _FAILURES as error:
        if _file_system_failed(error):
            raise UserError(
                f"{what} cannot be read now ({first_line(error)}): the file system fails, or is away. Finished parts "
                "are kept: give the same command again when it answers, or leave the file out."
            ) from None
        raise RejectedEpisodeError(f"{what} cannot be read ({first_line(error)}).") from None


def _file_system_failed(error: BaseException) -> bool:
    """Whether reading failed below HDF5, which says nothing about what the file holds."""
    said = re.search(r"errno = (\d+)", str(error))
    number = int(said.group(1)) if said else getattr(error, "errno", None)
    return number in _NOT_OF_THE_FILE


def member(group: h5py.Group, path: str) -> h5py.Group | h5py.Dataset | None:
    """The group or dataset at `path`, reached by links inside the file only; None where there is none.

    Raises:
        RejectedEpisodeError: a link leads out of the file, in a circle or nowhere, or the object is damaged.
    """
    with reading(repr(path)):
        return _follow(group, path, 0)


def _follow(group: h5py.Group, path: str, links: int) -> h5py.Group | h5py.Dataset | None:
    node = group.file["/"] if path.startswith("/") else group
    for part in (part for part in path.split("/") if part not in ("", ".")):
        if not isinstance(node, h5py.Group):
            return None
        name = part.encode("utf-8", "surrogateescape")
        if not node.id.links.exists(name):
            return None
        kind = node.id.links.get_info(name).type
        if kind == h5py.h5l.TYPE_HARD:
            node = node[part]
        elif kind == h5py.h5l.TYPE_SOFT:
            if links >= _MAX_LINKS:
                raise RejectedEpisodeError(f"{path!r} is a link that leads in a circle.")
            target = node.id.links.get_val(name).decode("utf-8", "surrogateescape")
            node = _follow(node, target, links + 1)
            if node is None:
                raise RejectedEpisodeError(f"{path!r} is a link to {target!r}, which is not in the file.")
        else:
            raise RejectedEpisodeError(f"{path!r} is a link to another file, which is not followed.")
    return node if isinstance(node, h5py.Group | h5py.Dataset) else None


def names(group: h5py.Group, what: str) -> list[str]:
    """Names of the members of a group."""
    with reading(what):
        # Those that are no UTF-8 come as bytes.
        return [name if isinstance(name, str) else name.decode("utf-8", "surrogateescape") for name in group]


def shape_and_type(
    dataset: h5py.Dataset, what: str, max_values: int | None = None
) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of a dataset whose data are wholly in its file, at most `max_values` numbers.

    Raises:
        RejectedEpisodeError: they are elsewhere (external, virtual), partly missing, too many, in absurd chunks, or
            unreadable.
    """
    with reading(what):
        shape, dtype = dataset.shape, dataset.dtype
        if shape is None:
            raise RejectedEpisodeError(f"{what} is empty.")
        if dataset.is_virtual or dataset.external:
            raise RejectedEpisodeError(f"{what} takes its values from other files, which are not read.")
        if math.prod(shape) > (MAX_VALUES if max_values is None else max_values):
            raise RejectedEpisodeError(f"{what} declares the absurd shape {shape}.")
        chunks = dataset.chunks
        if chunks is not None:
            if len(chunks) != len(shape) or math.prod(chunks) * dtype.itemsize > MAX_CHUNK_BYTES:
                raise RejectedEpisodeError(f"{what} is {shape} {dtype} in chunks of {chunks}.")
            expected = math.prod(-(-length // chunk) for length, chunk in zip(shape, chunks, strict=True))
            found = dataset.id.get_num_chunks()
            if found < expected:
                raise RejectedEpisodeError(f"{what} is {shape}: {expected - found} of {expected} parts are missing.")
        elif math.prod(shape) and not dataset.id.get_storage_size():
            raise RejectedEpisodeError(f"{what} declares {shape}, but its values were never written.")
        return tuple(int(length) for length in shape), dtype


def text_attribute(node: h5py.Group, key: str) -> str | None:
    """A text attribute exactly as stored, or None where there is none, it is empty, or it is no text.

    Raises:
        RejectedEpisodeError: it is damaged, not UTF-8, or longer than `MAX_TEXT_BYTES`.
    """
    with reading(f"the attribute {key!r}"):
        if key not in node.attrs:
            return None
        _check_size(node, key, MAX_TEXT_BYTES)
        value = node.attrs[key]
        if isinstance(value, np.bytes_ | bytes):
            value = bytes(value).decode("utf-8")
        if not isinstance(value, str) or not value:
            return None
        if len(value.encode("utf-8")) > MAX_TEXT_BYTES:  # lone surrogates, which h5py makes of wrong bytes, fail here
            raise RejectedEpisodeError(f"the attribute {key!r} has {len(value)} characters, which is no demonstration.")
        return value


def recorded_attributes(node: h5py.Group) -> dict[str, Any]:
    """All attributes as plain data; why some are left out (damaged, or too large for a record) is under `LEFT_OUT`.

    Raises:
        RejectedEpisodeError: the list of attributes is damaged.
    """
    attributes: dict[str, Any] = {}
    left_out: list[str] = []
    with reading("the list of attributes"):
        keys = list(node.attrs)
    for key in keys:
        try:
            with reading(f"the attribute {key!r}"):
                key.encode("utf-8")
                _check_size(node, key, MAX_RECORDED_BYTES)
                value = _plain(node.attrs[key])
                size = len((value if isinstance(value, str) else repr(value)).encode("utf-8"))
                if size > MAX_RECORDED_BYTES:
                    raise RejectedEpisodeError(f"the attribute {key!r} has {size} bytes.")
                attributes[key] = value
        except RejectedEpisodeError as error:
            left_out.append(str(error))
    return attributes | ({LEFT_OUT: left_out} if left_out else {})


def _check_size(node: h5py.Group, key: str, limit: int) -> None:
    attribute = node.attrs.get_id(key)
    size = math.prod(attribute.shape) * attribute.dtype.itemsize if attribute.shape is not None else 0
    if size > limit:
        raise RejectedEpisodeError(f"the attribute {key!r} has {size} bytes, at most {limit} are read.")


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bytes):
        return value.decode("utf-8")
    return value if isinstance(value, str | int | float | bool | list) else repr(value)


def first_line(error: BaseException) -> str:
    """The first line of an error's message, or its type."""
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
