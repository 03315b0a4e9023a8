"""One tolerant reader and four writers of arrays in msgpack, as the policy servers of the field send them.

Three look-alikes are in use and do not read each other: openpi's, that of the package msgpack-numpy, and vla-eval's;
GR00T's service sends the bytes of `numpy.save`. `decode` reads them all, with text or bytes as keys; `encode` writes
the one that is asked for. Nothing is ever unpickled: arrays of objects are refused in both directions.
Source of the layouts: openpi-client 0.1.2, msgpack-numpy 0.4.8, vla-eval 0.8.0, Isaac-GR00T N1.5 and N1.6.
"""

from __future__ import annotations

import io
import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal

import msgpack
import numpy as np

Dialect = Literal["openpi", "msgpack_numpy", "vla_eval", "gr00t"]

MAX_MESSAGE_BYTES: Final = 64 * 2**20  # eight 1024x1024 pictures and a chunk; more is a mistake or an attack
# Maps and lists of a message, and texts of its arrays; one byte of it can stand for an empty list, which takes sixty.
MAX_CONTAINERS: Final = 100_000
KINDS: Final = "biuf"  # kinds of dtype that cross the wire: bool, integers, floats; never objects, records, text


class WireError(ValueError):
    """A message that is not what the protocol says: the text names what was found and what was expected."""


def encode(message: Any, dialect: Dialect) -> bytes:
    """Bytes of a message of maps, lists, numbers, text, and numpy arrays and scalars.

    Raises:
        WireError: something in it cannot cross the wire.
    """

    def default(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return _array_to_map(value, dialect)
        if isinstance(value, np.generic):
            return _scalar_to_map(value, dialect)
        raise WireError(f"a {type(value).__name__} cannot be sent; arrays, numbers, text, lists and maps can")

    try:
        packed: bytes = msgpack.packb(message, default=default, use_bin_type=True)
    except (OverflowError, ValueError) as error:
        raise WireError(f"the message cannot be packed: {error}") from error
    return packed


def decode(data: bytes, max_bytes: int = MAX_MESSAGE_BYTES) -> Any:
    """The message in `data`; arrays of every dialect become read-only numpy arrays.

    Raises:
        WireError: not msgpack, larger than `max_bytes`, of too many maps, lists and texts, or an array whose bytes,
            type and shape do not fit.
    """
    if len(data) > max_bytes:
        raise WireError(f"a message of {len(data)} bytes; at most {max_bytes} are read")
    left = MAX_CONTAINERS

    def count(made: int = 1) -> None:
        nonlocal left
        left -= made
        if left < 0:
            raise WireError(f"a message of more than {MAX_CONTAINERS} maps and lists, and texts of arrays")

    def read_map(raw: dict[Any, Any]) -> Any:
        count()
        return _from_map(raw, count)

    def read_list(raw: list[Any]) -> list[Any]:
        count()
        return raw

    try:
        return msgpack.unpackb(
            data,
            object_hook=read_map,
            list_hook=read_list,
            raw=False,
            strict_map_key=False,
            max_ext_len=0,
        )
    except WireError:
        raise
    except Exception as error:  # msgpack raises a dozen kinds for broken input, and keys that cannot be hashed others
        raise WireError(f"not a readable msgpack message: {type(error).__name__}: {error}") from error


def text_of(key: Any) -> Any:
    """A map's key as text where it is bytes, which some dialects write; others as they are."""
    return key.decode("utf-8", "replace") if isinstance(key, bytes) else key


def _array_to_map(array: np.ndarray, dialect: Dialect) -> dict[Any, Any]:
    if array.dtype.kind not in KINDS:
        raise WireError(f"an array of dtype {array.dtype} cannot be sent; booleans, integers and floats can")
    if dialect == "gr00t":
        buffer = io.BytesIO()
        np.save(buffer, array, allow_pickle=False)
        return {"__ndarray_class__": True, "as_npy": buffer.getvalue()}
    dtype, data = array.dtype.str, array.tobytes()
    if dialect == "vla_eval":
        return {"__ndarray__": True, "data": data, "dtype": dtype, "shape": list(array.shape)}
    if dialect == "msgpack_numpy":
        return {b"nd": True, b"type": dtype, b"kind": b"", b"shape": list(array.shape), b"data": data}
    return {b"__ndarray__": True, b"data": data, b"dtype": dtype, b"shape": list(array.shape)}


def _scalar_to_map(value: np.generic, dialect: Dialect) -> Any:
    if value.dtype.kind not in KINDS:
        raise WireError(f"a scalar of dtype {value.dtype} cannot be sent; booleans, integers and floats can")
    if dialect == "openpi":
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    return value.item()  # plain numbers are read by everybody


def _from_map(raw: dict[Any, Any], count: Callable[[int], None]) -> Any:
    """A decoded map, or the array that it stands for; `count` is told of lists and texts that an array becomes."""
    text = {text_of(key): value for key, value in raw.items()}
    if "__ndarray__" in text:
        return _to_array(text, "dtype")
    if "nd" in text and "type" in text:
        if text.get("kind") in (b"O", "O"):
            raise WireError("an array of Python objects (a pickle) is refused")
        return _to_array(text, "type") if text["nd"] else _dtype(text["type"]).type(_scalar(text))
    if "__npgeneric__" in text:
        return _dtype(text.get("dtype")).type(text.get("data"))
    if "__ndarray_class__" in text:
        return _from_npy(text.get("as_npy"), count)
    return raw


def _scalar(text: Mapping[str, Any]) -> Any:
    data = text.get("data")
    if isinstance(data, bytes):
        return np.frombuffer(data, _dtype(text["type"]), count=1)[0]
    return data


def _dtype(name: Any) -> np.dtype[Any]:
    if isinstance(name, bytes):
        name = name.decode("ascii", "replace")
    if not isinstance(name, str):
        raise WireError(f"the dtype of an array is {name!r}; a name such as '<f4' was expected")
    try:
        dtype = np.dtype(name)
    except (TypeError, ValueError, SyntaxError) as error:
        raise WireError(f"the dtype of an array is {name!r}: {error}") from error
    if dtype.kind not in KINDS:
        raise WireError(f"an array of dtype {name!r} is refused; booleans, integers and floats are read")
    return dtype


def _to_array(text: Mapping[str, Any], dtype_key: str) -> np.ndarray:
    dtype, data, shape = _dtype(text.get(dtype_key)), text.get("data"), text.get("shape")
    if not isinstance(data, bytes) or not isinstance(shape, list | tuple):
        raise WireError(f"an array needs bytes and a shape; found {type(data).__name__} and {type(shape).__name__}")
    if not all(isinstance(size, int) and not isinstance(size, bool) and size >= 0 for size in shape):
        raise WireError(f"the shape of an array is {list(shape)!r}; sizes of 0 or more were expected")
    _check_size(shape, dtype, len(data))
    return np.frombuffer(data, dtype).reshape(tuple(shape))


def _check_size(shape: Sequence[int], dtype: np.dtype[Any], found: int) -> None:
    """Whether so many bytes are the array, and whether it is small where it needs none.

    Raises:
        WireError: other bytes, or rows without end of nothing, which whoever makes lists of them would count.
    """
    expected = math.prod(shape, start=dtype.itemsize)  # Python's whole numbers: no overflow for absurd sizes
    if expected != found:
        raise WireError(f"an array of shape {list(shape)} and dtype {dtype.str} has {found} bytes, not {expected}")
    if not found and math.prod(size for size in shape if size) > MAX_CONTAINERS:
        raise WireError(f"an array of shape {list(shape)} has nothing in more than {MAX_CONTAINERS} rows")


def _from_npy(data: Any, count: Callable[[int], None]) -> Any:
    """An array; lists of text for one of text."""
    if not isinstance(data, bytes):
        raise WireError(f"an array's npy bytes are missing; found {type(data).__name__}")
    file = io.BytesIO(data)
    try:
        shape, dtype = _npy_header(file)
    except Exception as error:  # numpy parses the header with ast: broken ones raise anything
        raise WireError(f"an array's npy bytes cannot be read: {error}") from error
    # Looked at before anything is read: of a type without width, numpy reads any number of items out of no bytes.
    if dtype.kind not in (*KINDS, "U") or not dtype.itemsize or any(size < 0 for size in shape):
        found = f"an array of shape {list(shape)} and dtype {dtype}"
        raise WireError(f"{found} is refused; booleans, integers, floats and text are read")
    _check_size(shape, dtype, len(data) - file.tell())
    if dtype.kind == "U":  # instructions, as GR00T's clients send them: each row becomes a list, each item a text
        count(sum(itertools.accumulate(shape, operator.mul, initial=1)))
    try:
        array: np.ndarray = np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:
        raise WireError(f"an array's npy bytes cannot be read: {error}") from error
    if dtype.kind == "U":
        return array.tolist()
    array.flags.writeable = False
    return array


def _npy_header(file: io.BytesIO) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of the items that follow in a file of `numpy.save`.

    Raises:
        ValueError: it is none, or of version 3, which only records have.
    """
    version = np.lib.format.read_magic(file)
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in readers:
        raise ValueError(f"version {version} of its header; {', '.join(map(str, readers))} are read")
    shape, _, dtype = readers[version](file)
    return shape, dtype
