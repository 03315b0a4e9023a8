"""Experiment files as plain data: references to other files, defaults of phases, unknown keys."""

from __future__ import annotations

import copy
import dataclasses
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.settings import Data, load_yaml, set_dotted

FILE_KEYS = ("policy", "mixture")  # their value may be the name of a YAML file, or hold one under `file`


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> Data:
    """`base` with `changes` laid over it: mappings key by key, everything else replaced."""
    out = dict(copy.deepcopy(dict(base)))
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        out[key] = merge(out[key], value) if both else copy.deepcopy(value)
    return out


def resolve(path: Path, overrides: Sequence[tuple[str, Any]] = ()) -> Data:
    """The experiment file `path` as plain data: files included, overrides applied, `defaults` in every phase.

    Raises:
        UserError: a missing file, or an override that leads nowhere.
    """
    data = _include(load_yaml(path), path.parent)
    for key, value in overrides:
        set_dotted(data, key, value)
    data = _include(data, Path.cwd())
    defaults = data.pop("defaults", None) or {}
    if isinstance(data.get("phases"), list):
        data["phases"] = [merge(defaults, p) if isinstance(p, Mapping) else p for p in data["phases"]]
    return data


def check_keys(kind: type, data: Any, where: str) -> None:
    """Check that mappings have only keys that the dataclass `kind` (and those inside it) knows.

    Raises:
        UnknownNameError: the first unknown key, with the closest match.
    """
    if not dataclasses.is_dataclass(kind) or not isinstance(data, Mapping):
        return
    hints = typing.get_type_hints(kind)
    for key, value in data.items():
        if key not in hints:
            raise UnknownNameError("key", str(key), hints, f"(in {where})")
        inside = next((t for t in _dataclasses_in(hints[key])), None)
        if inside is None:
            continue
        for number, item in enumerate(value if isinstance(value, list) else [value]):
            name = item.get("name", number) if isinstance(item, Mapping) else number
            check_keys(inside, item, f"{where}.{key}.{name}" if isinstance(value, list) else f"{where}.{key}")


def flatten(data: Any, prefix: str = "") -> dict[str, Any]:
    """Nested mappings and lists as dotted names; a list item that has a `name` is named by it."""
    if isinstance(data, Mapping) and data:
        pairs = [(str(key), value) for key, value in data.items()]
    elif isinstance(data, list) and data and isinstance(data[0], Mapping):
        pairs = [(str(item.get("name", number)), item) for number, item in enumerate(data)]
    else:
        return {prefix: data}
    out: dict[str, Any] = {}
    for key, value in pairs:
        out |= flatten(value, f"{prefix}.{key}" if prefix else key)
    return out


def _dataclasses_in(hint: Any) -> list[type]:
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return [hint]
    return [found for argument in typing.get_args(hint) for found in _dataclasses_in(argument)]


def _include(data: Data, folder: Path) -> Data:
    """Replace file names under FILE_KEYS, at the top, in `defaults` and in each phase, by the files' content."""
    out = dict(data)
    for key in FILE_KEYS:
        if key in out:
            out[key] = _included(out[key], folder)
    if isinstance(out.get("defaults"), Mapping):
        out["defaults"] = _include(dict(out["defaults"]), folder)
    if isinstance(out.get("phases"), list):
        out["phases"] = [_include(dict(p), folder) if isinstance(p, Mapping) else p for p in out["phases"]]
    return out


def _included(value: Any, folder: Path) -> Any:
    name = value if isinstance(value, str) else value.get("file") if isinstance(value, Mapping) else None
    if name is None:
        return value
    # A name counts from the file that has it; from the working directory if there is no such file.
    near = folder / name
    content = load_yaml(near if near.is_file() or not Path(name).is_file() else Path(name))
    changes = {} if isinstance(value, str) else {k: v for k, v in value.items() if k != "file"}
    return merge(content, changes)
