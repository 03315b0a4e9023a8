"""Messages damaged in many ways, seeded: their bytes, and their trees before they are packed.

A damaged message is a function of a good one and a generator. Some hold pickles that would make a folder if anybody
unpickled them.
"""

from __future__ import annotations

import io
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import numpy as np

from robocasa_lerobot.wire.codec import Dialect, encode

LIES = (0, 1, 0x7F, 0x80, 0x90, 0xC0, 0xC1, 0xC4, 0xC6, 0xC9, 0xD9, 0xDB, 0xDD, 0xDF, 0xFF)  # msgpack's own bytes


class Bomb:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        """What unpickling calls."""
        return os.mkdir, (str(self.folder),)


def damaged(good: dict[str, Any], dialect: Dialect, rng: np.random.Generator, bomb: Path) -> bytes:
    """One damaged message as bytes."""
    ways: list[Callable[[], bytes]] = [
        lambda: _flipped(encode(good, dialect), rng),
        lambda: _lied(encode(good, dialect), rng),
        lambda: encode(good, dialect)[: int(rng.integers(len(encode(good, dialect))))],
        lambda: encode(good, dialect) + rng.bytes(int(rng.integers(1, 100))),
        lambda: rng.bytes(int(rng.integers(0, 400))),
        lambda: _pack(_changed(good, rng, bomb, 0), dialect),
        lambda: _pack(_changed(good, rng, bomb, 0), dialect),
        lambda: _pack(_changed(_changed(good, rng, bomb, 0), rng, bomb, 0), dialect),
    ]
    return ways[int(rng.integers(len(ways)))]()


def _flipped(data: bytes, rng: np.random.Generator) -> bytes:
    content = bytearray(data)
    for where in rng.integers(0, len(content), int(rng.integers(1, 32))):
        content[where] = int(rng.integers(256))
    return bytes(content)


def _lied(data: bytes, rng: np.random.Generator) -> bytes:
    """A byte near the start, where the structure is, becomes one that means something else."""
    content = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        content[int(rng.integers(min(200, len(content))))] = int(rng.choice(LIES))
    return bytes(content)


def _changed(tree: Any, rng: np.random.Generator, bomb: Path, depth: int) -> Any:
    """The tree with one node in another way."""
    if isinstance(tree, dict) and tree and (depth == 0 or rng.random() < 0.6):
        keys = list(tree)
        key = keys[int(rng.integers(len(keys)))]
        out = dict(tree)
        match int(rng.integers(6)):
            case 0:
                del out[key]
            case 1:
                out[_strange_key(key, rng)] = out.pop(key)
            case 2:
                out[_strange_key(key, rng)] = _strange(tree[key], rng, bomb)
            case _:
                out[key] = _changed(tree[key], rng, bomb, depth + 1)
        return out
    return _strange(tree, rng, bomb)


def _strange_key(key: Any, rng: np.random.Generator) -> Any:
    text = str(key)
    others: list[Any] = [text.upper(), text + "x", text[:-1], text.encode(), b"\xff\xfe", 5, -1, None, True, 1.5, ""]
    others += ["__ndarray__", b"__ndarray__", "nd", "__npgeneric__", "__ndarray_class__", "__image__", "a.b.c.d.e.f"]
    return others[int(rng.integers(len(others)))]


def _strange(value: Any, rng: np.random.Generator, bomb: Path) -> Any:
    values: list[Any] = [
        None,
        True,
        -1,
        2**63,
        -(2**63),
        1e308,
        float("nan"),
        float("inf"),
        "",
        "x" * 5000,
        b"",
        [],
        {},
    ]
    values += [[value, value], {"a": value}, {b"\xff": value}, _nested(40), _nested(900), msgpack.ExtType(5, b"x" * 9)]
    values += [msgpack.Timestamp(1), *_bombs(bomb), *_false_arrays(), *_false_pictures()]
    if isinstance(value, np.ndarray):
        with np.errstate(all="ignore"):
            values += [value[..., :-1], value[:0], value[None], value.ravel(), value.astype(np.float16), value.tolist()]
            values += [value.astype(np.int64), value.astype(bool), np.float32(1), np.zeros(3000), np.full(16, np.nan)]
    return values[int(rng.integers(len(values)))]


def _nested(depth: int) -> Any:
    out: Any = 1
    for level in range(depth):
        out = [out] if level % 2 else {"a": out}
    return out


def _bombs(bomb: Path) -> list[Any]:
    data = pickle.dumps(Bomb(bomb))
    npy = io.BytesIO()
    np.save(npy, np.array([Bomb(bomb)], dtype=object), allow_pickle=True)
    return [
        data,
        {"nd": True, "type": "|O", "kind": b"O", "shape": [1], "data": data},
        {b"nd": True, b"type": "|O", b"kind": b"O", b"shape": [1], b"data": data},
        {b"nd": True, b"type": "|O", b"kind": b"", b"shape": [1], b"data": b"\0" * 8},
        {b"__ndarray__": True, b"dtype": "|O", b"shape": [1], b"data": b"\0" * 8},
        {b"__npgeneric__": True, b"dtype": "|O", b"data": data},
        {"__ndarray_class__": True, "as_npy": npy.getvalue()},
    ]


def _false_arrays() -> list[Any]:
    wrong: list[dict[str, Any]] = [
        {"dtype": "<f4", "shape": [2**40, 2**40], "data": b""},
        {"dtype": "<f4", "shape": [0, 2**62], "data": b""},
        {"dtype": "<f4", "shape": [0] * 100, "data": b""},
        {"dtype": "<f4", "shape": [1] * 60, "data": b"1234"},
        {"dtype": "<f4", "shape": [-1], "data": b"1234"},
        {"dtype": "<f4", "shape": 4, "data": b"1234"},
        {"dtype": "(" * 500, "shape": [1], "data": b"1234"},
        {"dtype": "f4,f4", "shape": [1], "data": b"12345678"},
        {"dtype": "<M8[s]", "shape": [1], "data": b"12345678"},
        {"dtype": "<f4", "shape": [1], "data": "text"},
        {"dtype": "|V8", "shape": [1], "data": b"12345678"},
    ]
    headers = [b"\x93NUMPY", b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535, b"\x93NUMPY\x03\x00\xff\xff\xff\xff{"]
    return [{"__ndarray__": True, **one} for one in wrong] + [
        {"__ndarray_class__": True, "as_npy": header} for header in headers
    ]


def _false_pictures() -> list[Any]:
    data = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xff\xff\0\0\xff\xff\x08\x02\0\0\0"
    return [
        {"__image__": True, "format": "png", "data": data, "shape": [65535, 65535, 3]},
        {"__image__": True, "format": "png", "data": data, "shape": [16, 16, 3]},
        {"__image__": True, "format": "raw", "data": b"x", "shape": [16, 16, 3]},
        {"__image__": True, "format": "EPS", "data": b"%!PS-Adobe-3.0 EPSF-3.0\n", "shape": [16, 16, 3]},
        {"__image__": True},
    ]


def _pack(tree: Any, dialect: Dialect) -> bytes:
    """As `encode`, with what it refuses to send left in."""

    def default(value: Any) -> Any:
        return msgpack.unpackb(encode(value, dialect), strict_map_key=False, raw=False)

    return bytes(msgpack.packb(tree, default=default, use_bin_type=True))
