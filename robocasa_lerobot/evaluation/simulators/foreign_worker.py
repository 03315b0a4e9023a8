"""The other end of a foreign env: one env in a user's own interpreter, asked over two pipes.

Run by its path, `PYTHON foreign_worker.py READ WRITE PARENT` (two file descriptors, and the process that it ends with);
it needs NumPy and nothing of this package, and keeps to Python 3.8. Our own side imports the frames from here.
docs/simulators.md describes frames, messages and what an env has to offer.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import importlib
import importlib.util
import json
import os
import platform
import signal
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import IO, TYPE_CHECKING, Any

import numpy as np

PROTOCOL = 1
MAGIC = b"RKL1"
_HEAD = struct.Struct(">4sIQ")  # magic, bytes of JSON, bytes of arrays
MAX_JSON, MAX_ARRAYS = 2**22, 2**28
KINDS = "biuf"
# Whose versions are told where they are installed; an adapter adds its own in PACKAGES.
_PACKAGES = ("numpy", "mujoco", "gymnasium", "gym", "robosuite", "robocasa", "lerobot", "torch", "pymunk", "dm-control")
_PARENT_SECONDS = 2.0
if TYPE_CHECKING:
    Message = tuple[dict[str, Any], dict[str, Any]]  # and its arrays by name


class FrameError(Exception):
    """Bytes on the pipe that are no frame."""


def write_frame(stream: IO[bytes], message: dict[str, Any], arrays: dict[str, Any] | None = None) -> None:
    """Write a message (a JSON object) with arrays by name, and flush."""
    arrays = {name: np.asarray(value, order="C") for name, value in (arrays or {}).items()}
    listed = []
    for name, value in arrays.items():
        if value.dtype.kind not in KINDS:
            raise FrameError(f"array {name!r} is of dtype {value.dtype}, expected booleans or numbers")
        listed.append([name, value.dtype.newbyteorder("<").str, list(value.shape)])
    text = json.dumps(dict(message, arrays=listed)).encode()
    data = [value.astype(value.dtype.newbyteorder("<"), copy=False).tobytes() for value in arrays.values()]
    total = sum(map(len, data))
    if len(text) > MAX_JSON or total > MAX_ARRAYS:
        raise FrameError(f"a message of {len(text)} + {total} bytes is too long")
    stream.write(_HEAD.pack(MAGIC, len(text), total) + text)
    for part in data:
        stream.write(part)
    stream.flush()


def read_frame(stream: IO[bytes]) -> Message:
    """The next message, and copies of its arrays by name.

    Raises:
        EOFError: the stream has ended.
        FrameError: its bytes are no frame.
    """
    head = _exactly(stream, _HEAD.size)
    magic, size, total = _HEAD.unpack(head)
    if magic != MAGIC:
        raise FrameError(f"expected a frame, found the bytes {head!r}")
    if size > MAX_JSON or total > MAX_ARRAYS:
        raise FrameError(f"a frame announces {size} + {total} bytes, more than may be")
    text, data = _exactly(stream, size), _exactly(stream, total)
    try:
        message = json.loads(text.decode())
        arrays: dict[str, Any] = {}
        start = 0
        for name, code, shape in message.pop("arrays"):
            dtype = np.dtype(str(code))
            if dtype.kind not in KINDS or not all(type(n) is int and n >= 0 for n in shape):
                raise FrameError(f"array {name!r} has dtype {code!r} and shape {shape!r}")
            count = 1
            for n in shape:
                count *= n
            if start + count * dtype.itemsize > total:
                raise FrameError(f"array {name!r} is longer than its frame")
            found = np.frombuffer(data, dtype, count, start).reshape(shape)
            arrays[str(name)] = found.astype(dtype.newbyteorder("="))
            start += count * dtype.itemsize
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise FrameError(f"a frame's message cannot be read: {error!r}") from error
    if start != total:
        raise FrameError(f"{total - start} bytes of a frame belong to no array")
    return message, arrays


def _exactly(stream: IO[bytes], count: int) -> bytes:
    parts: list[bytes] = []
    left = count
    while left:
        part = stream.read(min(left, 1 << 20))
        if not part:
            raise EOFError("the other end of the pipe is closed")
        parts.append(part)
        left -= len(part)
    return b"".join(parts)


def flatten(value: Any, name: str = "") -> dict[str, Any]:
    """Arrays of a nested observation by path: {"pixels": {"top": a}} is {"pixels/top": a}."""
    if hasattr(value, "items"):
        out: dict[str, Any] = {}
        for key, inner in value.items():
            if "/" in str(key):
                raise ValueError(f"an observation's key {key!r} has a '/' in it")
            out.update(flatten(inner, f"{name}/{key}" if name else str(key)))
        return out
    return {name: np.asarray(value)}


def attribute(env: Any, name: str) -> Any:
    """An attribute of an env or, as Gymnasium's wrappers hide them, of one that it wraps; None where none has it."""
    with contextlib.suppress(AttributeError):
        return getattr(env, name)
    with contextlib.suppress(AttributeError):
        return env.get_wrapper_attr(name)
    return None


def load(factory: str) -> tuple[Callable[..., Any], ModuleType]:
    """The callable named `module:name` or `FILE.py:name`, and its module."""
    place, colon, name = factory.rpartition(":")
    if not colon:
        raise ValueError(f"expected module:callable or FILE.py:callable, found {factory!r}")
    if place.endswith(".py"):
        spec = importlib.util.spec_from_file_location(Path(place).stem, place)
        if spec is None or spec.loader is None:
            raise ValueError(f"{place} is no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
    else:
        module = importlib.import_module(place)
    return getattr(module, name), module


class Host:
    """Answers the messages of one evaluation worker; each answer is a message and arrays."""

    def __init__(self) -> None:
        self._env: Any = None

    def hello(self, factory: str, options: dict[str, Any], tasks: list[str]) -> Message:
        """What is known of the simulator before an env is made."""
        _, module = load(factory)
        known = _said(module, "TASKS", options)
        starts = _said(module, "STARTS", options) or {}
        return {
            "protocol": PROTOCOL,
            "source": hashlib.sha256(Path(str(module.__file__)).read_bytes()).hexdigest(),
            "versions": dict(_versions(module), python=platform.python_version()),
            "tasks": None if known is None else [str(task) for task in known],
            "starts": {task: int(starts[task]) for task in tasks if task in starts},
        }, {}

    def make(self, factory: str, task: str, arguments: dict[str, Any]) -> Message:
        """Make the env; says what it offers."""
        made, _ = load(factory)
        self._env = env = made(task=task, **arguments)
        space = env.action_space
        low, high = (np.broadcast_to(np.asarray(b, np.float64), space.shape) for b in (space.low, space.high))
        horizon = attribute(env, "horizon") or attribute(env, "_max_episode_steps")
        fps = attribute(env, "fps") or (attribute(env, "metadata") or {}).get("render_fps")
        return {
            "horizon": None if horizon is None else int(horizon),
            "fps": None if fps is None else float(fps),
            "expert": callable(attribute(env, "expert_action")),
        }, {"low": low, "high": high}

    def reset(self, seed: int, pictures: bool) -> Message:
        """Begin an episode."""
        observation, info = self._observing(pictures).reset(seed=seed)
        return self._told(observation, info, pictures)

    def step(self, pictures: bool, action: Any) -> Message:
        """Carry out one action."""
        observation, reward, terminated, truncated, info = self._observing(pictures).step(action)
        if "is_success" not in info:
            raise KeyError("info of step() has no `is_success`")
        message, arrays = self._told(observation, info, pictures)
        message.update(reward=float(reward), terminated=bool(terminated), truncated=bool(truncated))
        return message, arrays

    def expert(self) -> Message:
        """The action of the env's own expert."""
        return {}, {"action": np.asarray(attribute(self._env, "expert_action")(), np.float32)}

    def close(self) -> Message:
        """End the env; the process ends with it."""
        env, self._env = self._env, None
        if env is not None:
            env.close()
        return {}, {}

    def _observing(self, pictures: bool) -> Any:
        # Of use where an env looks at it, as our own does; harmless elsewhere.
        for one in (self._env, getattr(self._env, "unwrapped", self._env)):
            if hasattr(one, "render_observations"):
                one.render_observations = pictures
        return self._env

    def _told(self, observation: Any, info: dict[str, Any], pictures: bool) -> Message:
        arrays = flatten(observation)
        if not pictures:
            arrays = {name: value for name, value in arrays.items() if name.split("/")[0] != "pixels"}
        terms = info.get("success_terms") or {}
        text = info.get("instruction") or attribute(self._env, "task_description")
        message = {
            "is_success": bool(np.asarray(info.get("is_success", False)).any()),
            "terms": {str(name): bool(met) for name, met in terms.items()},
            "instruction": "" if text is None else str(text),
        }
        return message, arrays


def _said(module: ModuleType, name: str, options: dict[str, Any]) -> Any:
    """A constant of an adapter, or what its function of that name says for these options."""
    value = getattr(module, name, None)
    return value(options) if callable(value) else value


def _versions(module: ModuleType) -> dict[str, str]:
    from importlib import metadata

    names = list(_PACKAGES) + list(getattr(module, "PACKAGES", ())) + [module.__name__.split(".")[0]]
    out: dict[str, str] = {}
    for name in names:
        with contextlib.suppress(metadata.PackageNotFoundError):
            out[name] = metadata.version(name)
    return out


def serve(read: IO[bytes], write: IO[bytes]) -> None:
    """Answer messages until the pipe closes."""
    host = Host()
    while True:
        try:
            message, arrays = read_frame(read)
        except EOFError:
            return
        name = message.pop("ask")
        started = time.perf_counter()
        try:
            if name not in ("hello", "make", "reset", "step", "expert", "close"):
                raise ValueError(f"unknown question {name!r}")
            answer, found = getattr(host, name)(**dict(message, **arrays))
            answer["seconds"] = time.perf_counter() - started
            write_frame(write, dict(answer, answers=name), found)
        except (BrokenPipeError, ConnectionResetError):
            return
        except Exception as error:
            said = {"answers": name, "error": traceback.format_exc(), "kind": type(error).__name__}
            write_frame(write, said)
        if name == "close":
            return


def _end_with(parent: int) -> None:
    """Never outlive the process that asks: the system's own signal where there is one, and a look now and then."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, int(signal.SIGKILL))  # PR_SET_PDEATHSIG

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main() -> None:
    """Serve the descriptors that the command line names."""
    read, write, parent = (int(word) for word in sys.argv[1:4])
    _end_with(parent)
    # Modules are found from where the command was given, not beside this file, whose neighbours are not for here.
    here = Path(__file__).resolve().parent
    sys.path[:] = [str(Path.cwd()), *(path for path in sys.path if Path(path).resolve() != here)]
    with os.fdopen(read, "rb") as questions, os.fdopen(write, "wb") as answers:
        serve(questions, answers)


if __name__ == "__main__":
    main()
