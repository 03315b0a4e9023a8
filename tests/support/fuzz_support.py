"""Demonstration files damaged in every way that bytes and HDF5 calls allow, seeded; and children that may die of them.

A damage is a function of a file and a generator. `mutate` applies one to three of them. `in_child` runs a function
in a forked process with limits of memory and time and says how it ended.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import resource
import select
import signal
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from convert_support import INSTRUCTION, SCENE

from robocasa_lerobot import contract

Damage = Callable[[Path, np.random.Generator], None]
LENGTHS = (4, 3, 5)
IMAGE_SIZE = 16
# Values that a size, a count or an offset in a file's headers can be turned into.
_LIES = (0, 1, 2, 7, 8, 255, 256, 2**16, 2**20, 2**31 - 1, 2**32 - 1, 2**40, 2**62, 2**64 - 1)
_DTYPES = ("f4", ">f8", "f2", "i4", ">i2", "u1", "i8", "c16", "S5", "?", [("a", "f8"), ("b", "i4")], "O")


def base_file(path: Path, variant: int) -> Path:
    """A small good file with pictures; variants differ in the library's format, chunks, filters and attributes."""
    rng = np.random.default_rng(variant)
    latest, chunked, checked = variant % 2 == 1, variant // 2 % 2 == 1, variant // 4 % 2 == 1
    options: dict[str, Any] = {"chunks": True, "compression": "gzip"} if chunked else {}
    options |= {"fletcher32": True} if checked else {}
    with h5py.File(path, "w", libver="latest" if latest else "earliest") as file:
        data = file.create_group("data")
        data.attrs["env"] = "OpenDrawer"
        data.attrs["env_args"] = '{"env_name": "OpenDrawer", "type": 1, "env_kwargs": {"control_freq": 20}}'
        data.attrs["total"] = sum(LENGTHS)
        for index, length in enumerate(LENGTHS):
            demo = data.create_group(f"demo_{index}")
            demo.attrs["ep_meta"] = f'{{"layout_id": 1, "style_id": 2, "lang": "{INSTRUCTION}"}}'
            demo.attrs["num_samples"] = length
            if variant % 3 == 0:
                demo.attrs["model_file"] = SCENE
            columns = {"actions": rng.uniform(-1, 1, (length, contract.ACTION_SIZE))}
            columns["states"] = np.column_stack([np.arange(length) / 20, rng.normal(size=(length, 10))])
            for part in contract.STATE_PARTS:
                columns[f"obs/{contract.STATE_PART_HDF5_KEYS[part.name]}"] = rng.normal(size=(length, part.size))
            for offset, camera in enumerate(contract.CAMERAS[: 1 + variant % 2]):
                columns[f"obs/{camera}_image"] = _pictures(length, offset)
            for key, values in columns.items():
                demo.create_dataset(key, data=values, **options)
    return path


def _pictures(length: int, offset: int) -> np.ndarray:
    """Shaded pictures (T, 16, 16, 3) uint8 that grow brighter: so small, they survive video only without edges."""
    across = np.linspace(40, 120, IMAGE_SIZE)
    shades = across[:, None] / 2 + across[None, :] / 2 + 20 * offset
    steps = shades[None] + 20 * np.arange(length)[:, None, None]
    return np.repeat(steps[..., None], 3, axis=-1).astype(np.uint8)


def mutate(path: Path, rng: np.random.Generator) -> list[str]:
    """Damage a file in one to three ways; gives their names. A way that an earlier one has made impossible is none."""
    names = [str(name) for name in rng.choice(list(DAMAGES), int(rng.choice([1, 1, 2, 3])))]
    names.sort(key=lambda name: name in _RAW)  # HDF5 itself writes only to files whose bytes are still sound
    for name in names:
        with contextlib.suppress(KeyError, ValueError, OSError):
            DAMAGES[name](path, rng)
    return names


def _bytes(change: Callable[[bytearray, np.random.Generator], bytearray | None]) -> Damage:
    def damage(path: Path, rng: np.random.Generator) -> None:
        content = bytearray(path.read_bytes())
        path.write_bytes(change(content, rng) or content)

    return damage


def _flip_bytes(content: bytearray, rng: np.random.Generator) -> None:
    for where in rng.integers(0, len(content), int(rng.integers(1, 64))):
        content[where] = int(rng.integers(256))


def _flip_bit(content: bytearray, rng: np.random.Generator) -> None:
    content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))


def _flip_header(content: bytearray, rng: np.random.Generator) -> None:
    """Where the structures of HDF5 are: after their signatures."""
    signatures = (b"TREE", b"HEAP", b"SNOD", b"OHDR", b"OCHK", b"FRHP", b"FHDB", b"BTHD", b"BTLF", b"FADB", b"GCOL")
    places = [i for s in signatures for i in _occurrences(content, s)] or [0]
    for _ in range(int(rng.integers(1, 6))):
        where = int(rng.choice(places)) + int(rng.integers(4, 120))
        if where < len(content):
            content[where] = int(rng.integers(256))


def _occurrences(content: bytearray, pattern: bytes) -> list[int]:
    places, start = [], content.find(pattern)
    while start >= 0:
        places.append(start)
        start = content.find(pattern, start + 1)
    return places


def _lie_about_size(content: bytearray, rng: np.random.Generator) -> None:
    """A number that stands for a length, a width or a size somewhere becomes another one."""
    value = int(rng.choice([*LENGTHS, contract.ACTION_SIZE, IMAGE_SIZE, 8, 96, 3, 64]))
    width = int(rng.choice([2, 4, 8]))
    places = _occurrences(content, value.to_bytes(width, "little"))
    lie = int(rng.choice(np.array([*_LIES, value + 1, value - 1], dtype=np.uint64))) % 256**width
    for where in rng.choice(places, min(len(places), int(rng.integers(1, 4)))) if places else ():
        content[where : where + width] = lie.to_bytes(width, "little")


def _zero_block(content: bytearray, rng: np.random.Generator) -> None:
    start, size = int(rng.integers(len(content))), int(rng.integers(1, 1024))
    content[start : start + size] = bytes(len(content[start : start + size]))


def _copy_block(content: bytearray, rng: np.random.Generator) -> None:
    size = int(rng.integers(1, min(512, len(content) // 2)))
    source, target = (int(i) for i in rng.integers(0, len(content) - size, 2))
    content[target : target + size] = content[source : source + size]


def _truncate(content: bytearray, rng: np.random.Generator) -> bytearray:
    return content[: int(rng.integers(len(content)))]


def _append(content: bytearray, rng: np.random.Generator) -> bytearray:
    return content + rng.bytes(int(rng.integers(1, 4096)))


def _swap_address(content: bytearray, rng: np.random.Generator) -> None:
    """An offset in the file points to another place in it: cycles, overlaps, data read as headers."""
    words = np.frombuffer(bytes(content[: len(content) // 8 * 8]), "<u8")
    places = np.flatnonzero((words > 64) & (words < len(content)))
    if len(places) > 1:
        one, other = (int(i) for i in rng.choice(places, 2))
        content[one * 8 : one * 8 + 8] = content[other * 8 : other * 8 + 8]


def _hdf5(change: Callable[[h5py.File, np.random.Generator], None]) -> Damage:
    def damage(path: Path, rng: np.random.Generator) -> None:
        with h5py.File(path, "r+") as file:
            change(file, rng)

    return damage


def _objects(file: h5py.File, kind: type) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, node: names.append(name) if isinstance(node, kind) else None)
    return names


def _pick(file: h5py.File, rng: np.random.Generator, kind: type = h5py.Dataset) -> str:
    return str(rng.choice(_objects(file, kind)))


def _drop_group(file: h5py.File, rng: np.random.Generator) -> None:
    del file[_pick(file, rng, h5py.Group)]


def _drop_dataset(file: h5py.File, rng: np.random.Generator) -> None:
    del file[_pick(file, rng)]


def _replace(file: h5py.File, name: str, values: Any, **options: Any) -> None:
    del file[name]
    file.create_dataset(name, data=values, **options)


def _change_dtype(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng)
    values, dtype = file[name][()], _DTYPES[int(rng.integers(len(_DTYPES)))]
    if dtype == "O":
        _replace(file, name, values.astype(str).astype(object), dtype=h5py.string_dtype())
    elif isinstance(dtype, list):
        _replace(file, name, np.zeros(values.shape, dtype))
    else:
        with np.errstate(all="ignore"):
            _replace(file, name, values.astype(dtype))


def _change_shape(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng)
    values = file[name][()]
    shapes = [values[:-1], values[:0], np.concatenate([values, values]), values.ravel(), values[None], values[..., :-1]]
    _replace(file, name, [*shapes, np.float64(3.0), values.T][int(rng.integers(len(shapes) + 2))])


def _absurd_shape(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng)
    shape, dtype = list(file[name].shape), file[name].dtype
    shape[int(rng.integers(len(shape)))] = int(rng.choice([10**6, 10**9, 2**40]))
    del file[name]
    file.create_dataset(name, shape=shape, dtype=dtype, chunks=tuple(min(n, 64) for n in shape))


def _not_finite(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng)
    values = file[name][()]
    if values.dtype.kind == "f" and values.size:
        values.flat[int(rng.integers(values.size))] = rng.choice([np.nan, np.inf, -np.inf])
        file[name][()] = values


def _other_attribute(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng, h5py.Group)
    keys = list(file[name].attrs) or ["env_args"]
    others = ["", "{", "[1, 2]", "[" * 5000, "null", '{"lang": 5}', '{"lang": "\\ud800"}', "x\x85y\u2028z", 7, np.nan]
    others += [
        np.arange(5),
        b"\xff\xfe",
        np.zeros(3, "S4"),
        h5py.Empty("f8"),
        '{"env_kwargs": {"control_freq": 1e400}}',
    ]
    others += ['{"env_kwargs": {"control_freq": "20"}}', '{"lang": ' + "9" * 5000 + "}", "<mujoco><a></mujoco>"]
    file[name].attrs[str(rng.choice(keys))] = others[int(rng.integers(len(others)))]


def _drop_attribute(file: h5py.File, rng: np.random.Generator) -> None:
    attributes = file[_pick(file, rng, h5py.Group)].attrs
    del attributes[str(rng.choice(list(attributes)))]


def _link(file: h5py.File, rng: np.random.Generator) -> None:
    name, target = _pick(file, rng), "/" + _pick(file, rng)
    links = [h5py.SoftLink(target), h5py.SoftLink(f"/{name}"), h5py.ExternalLink("other.hdf5", target), file[target]]
    del file[name]
    file[name] = links[int(rng.integers(len(links)))]


def _group_for_dataset(file: h5py.File, rng: np.random.Generator) -> None:
    name = _pick(file, rng)
    del file[name]
    file.create_group(name)


_RAW: dict[str, Damage] = {
    "bytes flipped": _bytes(_flip_bytes),
    "one bit flipped": _bytes(_flip_bit),
    "header bytes flipped": _bytes(_flip_header),
    "size lied about": _bytes(_lie_about_size),
    "block zeroed": _bytes(_zero_block),
    "block copied": _bytes(_copy_block),
    "address swapped": _bytes(_swap_address),
    "truncated": _bytes(_truncate),
    "appended": _bytes(_append),
}
DAMAGES: dict[str, Damage] = {
    **_RAW,
    "group dropped": _hdf5(_drop_group),
    "dataset dropped": _hdf5(_drop_dataset),
    "dtype changed": _hdf5(_change_dtype),
    "shape changed": _hdf5(_change_shape),
    "absurd shape": _hdf5(_absurd_shape),
    "not finite": _hdf5(_not_finite),
    "attribute changed": _hdf5(_other_attribute),
    "attribute dropped": _hdf5(_drop_attribute),
    "link": _hdf5(_link),
    "group for a dataset": _hdf5(_group_for_dataset),
}


@dataclass(frozen=True)
class Ending:
    """How a child ended: `value` of the function, or the `failure` (traceback, signal, time) in words."""

    value: Any = None
    failure: str | None = None
    seconds: float = 0.0


def in_child(function: Callable[[], Any], seconds: float = 60.0, extra_bytes: int = 4 << 30) -> Ending:
    """Call a function in a forked child that may use so much more memory than this process, and so much time."""
    start = time.monotonic()
    out = tempfile.TemporaryFile()  # noqa: SIM115 (closed below, in both processes)
    read_end, write_end = os.pipe()
    child = os.fork()
    if child == 0:  # never returns
        os.close(read_end)
        with contextlib.suppress(BaseException):
            os.setpgid(0, 0)
            limit = _virtual_memory() + extra_bytes
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            try:
                answer: tuple[bool, Any] = (True, function())
            except BaseException:
                answer = (False, traceback.format_exc())
            with os.fdopen(os.dup(out.fileno()), "wb") as stream:
                pickle.dump(answer, stream)
            os._exit(0)
        os._exit(77)
    os.close(write_end)
    ready, _, _ = select.select([read_end], [], [], seconds)  # the write end closes when the child has ended
    if not ready:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
    os.close(read_end)
    _, status = os.waitpid(child, 0)
    took = time.monotonic() - start
    if not ready:
        return Ending(failure=f"not finished after {seconds:g} s", seconds=took)
    if os.WIFSIGNALED(status):
        return Ending(failure=f"killed by signal {signal.Signals(os.WTERMSIG(status)).name}", seconds=took)
    if os.WEXITSTATUS(status) != 0:
        return Ending(failure=f"exit status {os.WEXITSTATUS(status)}", seconds=took)
    with out:
        out.seek(0)
        good, value = pickle.load(out)
    return Ending(value=value, seconds=took) if good else Ending(failure=value, seconds=took)


def _virtual_memory() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()
