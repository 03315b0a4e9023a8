"""Dataclasses from parsed JSON, strictly: no key may be missing (but for `OPTIONAL` ones) or unknown, and `1` is not
`true`.
"""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from robocasa_lerobot.errors import suggest

OPTIONAL: Final[Mapping[str, Any]] = MappingProxyType({"optional": True})  # metadata of a field that may be missing


class SchemaError(ValueError):
    """Values that do not fit their dataclass; the message has no place in a file, which the caller adds."""


def build[T](cls: type[T], values: dict[str, Any], prefix: str = "") -> T:
    """An instance of dataclass `cls` from a JSON object, with nested dataclasses made as well.

    Raises:
        SchemaError: a missing, unknown or wrongly typed key; `prefix` is where in the line it was found.
    """
    hints = _hints(cls)  # type: ignore[arg-type]
    for name in values:
        if name not in hints:
            raise SchemaError(f"unknown key {prefix + name!r}. {suggest(name, hints)}")
    optional = _optional(cls)  # type: ignore[arg-type]
    missing = [prefix + name for name in hints if name not in values and name not in optional]
    if missing:
        raise SchemaError(f"missing key(s) {', '.join(missing)}")
    return cls(**{name: _fit(values[name], hint, prefix + name) for name, hint in hints.items() if name in values})


@functools.cache
def _optional(cls: type) -> frozenset[str]:
    return frozenset(field.name for field in dataclasses.fields(cls) if field.metadata.get("optional"))


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    hints = typing.get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def _fit(value: Any, hint: Any, name: str) -> Any:
    if hint is Any:
        return value
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None:
            return None
        (hint,) = (part for part in typing.get_args(hint) if part is not type(None))
        return _fit(value, hint, name)
    if dataclasses.is_dataclass(hint):
        _expect(value, dict, name)
        return build(typing.cast(type, hint), value, name + ".")
    if origin is dict:
        _expect(value, dict, name)
        inner = typing.get_args(hint)[1]
        return value if inner is Any else {key: _fit(item, inner, f"{name}.{key}") for key, item in value.items()}
    if origin is list:
        _expect(value, list, name)
        return [_fit(item, typing.get_args(hint)[0], f"{name}[{index}]") for index, item in enumerate(value)]
    if hint is float and type(value) is int:  # JSON has one kind of number
        return float(value)
    _expect(value, hint, name)
    return value


def _expect(value: Any, kind: type, name: str) -> None:
    # bool is an int in Python; a success of 1 or a trial of true is a mistake of the writer.
    if type(value) is not kind:
        raise SchemaError(f"{name!r} is {value!r}, expected {kind.__name__}")
