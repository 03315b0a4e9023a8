"""Messages of clients, checked and typed, and the pictures that go to them: `protocol.md` has all of them in words."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

PROTOCOL = 1
MODES = ("arm", "base", "both")
MOTION_FRAMES = ("base", "camera", "gripper")
LONGEST_MESSAGE = 16 * 1024  # bytes, of a client
LONGEST_NAME, LONGEST_REASON = 32, 200  # characters


class ProtocolError(ValueError):
    """A message that no client of this protocol sends; the reason is told to it, and it is sent away."""


@dataclass(frozen=True)
class Message:
    """A checked message: its type, and the values of its fields; those that were left out are missing."""

    type: str
    values: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, key: str) -> Any:
        return self.values[key]

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a field, or another one where it was left out."""
        return self.values.get(key, default)


Check = Callable[[Any], Any]


def parse(text: str) -> Message:
    """Read one message.

    Raises:
        ProtocolError: it is none; the text says why.
    """
    try:
        found = json.loads(text, parse_constant=_not_finite)
    except RecursionError:
        raise ProtocolError("a message is one flat JSON object") from None
    except ValueError as error:
        raise ProtocolError(f"a message is one JSON object ({error})") from error
    if not isinstance(found, dict):
        raise ProtocolError(f"a message is one JSON object, found {type(found).__name__}")
    kind = found.pop("type", None)
    if not isinstance(kind, str) or kind not in _FIELDS:
        raise ProtocolError(f"unknown type {str(kind)[:40]!r}; known: {', '.join(_FIELDS)}")
    required, optional = _FIELDS[kind]
    missing = [name for name in required if name not in found]
    if missing:
        raise ProtocolError(f"{kind}: {', '.join(missing)} missing")
    values = {}
    for name, value in found.items():
        check = required.get(name) or optional.get(name)
        if check is None:
            raise ProtocolError(f"{kind}: unknown field {name[:40]!r}")
        try:
            values[name] = check(value)
        except ProtocolError as error:
            raise ProtocolError(f"{kind}: {name}: {error}") from None
    return Message(kind, values)


def pack_frame(header: dict[str, Any], pictures: Sequence[bytes]) -> bytes:
    """A binary message: length of the header, header, JPEGs."""
    text = json.dumps(header, separators=(",", ":")).encode()
    return b"".join((len(text).to_bytes(4, "big"), text, *pictures))


def unpack_frame(message: bytes) -> tuple[dict[str, Any], list[bytes]]:
    """What `pack_frame` packed.

    Raises:
        ProtocolError: it is no such message.
    """
    end = 4 + int.from_bytes(message[:4], "big")
    try:
        header: dict[str, Any] = json.loads(message[4:end])
        sizes = [int(picture["bytes"]) for picture in header["pictures"]]
    except (ValueError, KeyError, TypeError) as error:
        raise ProtocolError(f"no picture message ({error})") from error
    if len(message) != end + sum(sizes):
        raise ProtocolError(f"{len(message) - end} bytes of pictures, {sum(sizes)} announced")
    pictures = []
    for size in sizes:
        pictures.append(message[end : end + size])
        end += size
    return header, pictures


def _not_finite(name: str) -> float:
    raise ProtocolError(f"{name} is no number of JSON")


def _number(low: float, high: float) -> Check:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise ProtocolError(f"found {str(value)[:40]}, expected a number from {low:g} to {high:g}")
        number = float(value)
        if not math.isfinite(number):
            raise ProtocolError("expected a finite number")
        return number

    return check


def _whole(low: int, high: int) -> Check:
    def check(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ProtocolError(f"found {str(value)[:40]}, expected a whole number from {low} to {high}")
        return value

    return check


def _axes(count: int) -> Check:
    axis = _number(-1.0, 1.0)

    def check(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list) or len(value) != count:
            raise ProtocolError(f"found {str(value)[:40]}, expected a list of {count} numbers")
        return tuple(axis(part) for part in value)

    return check


def _one_of(*names: str) -> Check:
    def check(value: Any) -> str:
        if value not in names:
            raise ProtocolError(f"found {str(value)[:40]!r}, expected one of {', '.join(names)}")
        return str(value)

    return check


def _text(longest: int) -> Check:
    def check(value: Any) -> str:
        if not isinstance(value, str) or len(value) > longest:
            raise ProtocolError(f"expected a line of up to {longest} characters")
        # Spaces of any width become plain ones, and what joins or steers characters goes: people paste and dictate.
        return " ".join("".join(one if one.isprintable() else " " for one in value).split())

    return check


def _yes(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ProtocolError(f"found {str(value)[:40]}, expected true or false")
    return value


def _names(value: Any) -> tuple[str, ...]:
    name = _text(64)
    if not isinstance(value, list) or len(value) > 16:
        raise ProtocolError("expected a list of up to 16 names")
    return tuple(name(part) for part in value)


_FRAME = _whole(0, 2**53)
_LENGTH = _number(-1e3, 1e3)
_ANGLE = _number(-100.0, 100.0)
_MOTION = {"motion_frame": _one_of(*MOTION_FRAMES), "motion_camera": _text(64)}
# Of each type, the fields that it must have and those that it may.
_FIELDS: dict[str, tuple[dict[str, Check], dict[str, Check]]] = {
    "ack": ({"frame": _FRAME}, {}),
    "input": (
        {"frame": _FRAME},
        {
            "device": _text(LONGEST_NAME),
            "arm": _axes(6),
            "base": _axes(3),
            "torso": _number(-1.0, 1.0),
            "gripper": _one_of("open", "closed"),
            **_MOTION,
        },
    ),
    "action": ({"frame": _FRAME, "action": _axes(12)}, {}),
    "clock": ({"clock": _one_of("free", "steps")}, {}),
    "set": ({}, {"mode": _one_of(*MODES), "speed": _number(0.01, 1.0), "cameras": _names, **_MOTION}),
    "view": (
        {},
        {"follow": _yes, "azimuth": _ANGLE, "elevation": _number(-1.57, 1.57), "distance": _number(0.2, 10.0)},
    ),
    "pause": ({}, {}),
    "resume": ({}, {}),
    "focus": ({"on": _yes}, {}),
    "rewind": ({}, {"on": _yes, "speed": _number(1.0, 10.0), "steps": _whole(1, 100_000)}),
    "mark": ({}, {}),
    "back_to_mark": ({}, {}),
    "drive_to": ({"x": _LENGTH, "y": _LENGTH}, {"yaw": _ANGLE}),
    "reach": ({"camera": _text(64), "u": _number(0.0, 1.0), "v": _number(0.0, 1.0)}, {"frame": _FRAME}),
    "stop": ({}, {}),
    "start": ({}, {}),
    "take_over": ({}, {}),
    "give_back": ({}, {}),
    "end": ({}, {}),
    "review": ({}, {"play": _yes, "speed": _number(1.0, 10.0), "seek": _whole(0, 10_000_000)}),
    "continue": ({}, {}),
    "save": ({}, {"trim": _yes}),
    "redo": ({}, {}),
    "discard": ({"reason": _text(LONGEST_REASON)}, {}),
    "finish": ({}, {}),
    "take": ({}, {}),
}
MESSAGE_TYPES = tuple(_FIELDS)
