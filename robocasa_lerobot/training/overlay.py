"""Configuration files as plain data: YAML, references to other files, dotted overrides, unknown keys."""

from __future__ import annotations

import copy
import dataclasses
import re
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.errors import UnknownNameError, UserError, suggest

Data = dict[str, Any]
FILE_KEYS = ("policy", "mixture")  # their value may be the name of a YAML file, or hold one under `file`


class _Loader(yaml.SafeLoader):
    """YAML with numbers as people write them: PyYAML alone reads `1e-4` as text."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d[\d_]*\.?[\d_]*|\.\d[\d_]*)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


def load_yaml(path: Path) -> Any:
    """The content of a YAML file.

    Raises:
        UserError: no such file (the closest names are listed), or not YAML.
    """
    if not path.is_file():
        names = [p.name for p in path.parent.glob("*.yaml")] if path.parent.is_dir() else []
        raise UserError(f"no file {path}. {suggest(path.name, names) if names else 'Its folder has no YAML files.'}")
    try:
        return yaml.load(path.read_text(), Loader=_Loader)
    except yaml.YAMLError as error:
        raise UserError(f"{path}: not valid YAML: {error}") from error


def parse_overrides(arguments: Sequence[str]) -> list[tuple[str, Any]]:
    """`--phases.pretrain.steps=10` or `--phases.pretrain.steps 10` as ("phases.pretrain.steps", 10).

    Raises:
        UserError: an argument that is neither.
    """
    out: list[tuple[str, Any]] = []
    rest = list(arguments)
    while rest:
        argument = rest.pop(0)
        if not argument.startswith("--") or argument == "--":
            raise UserError(f"cannot read the argument {argument!r}; overrides look like --phases.pretrain.steps=10.")
        key, equals, value = argument[2:].partition("=")
        if not equals:
            if not rest or rest[0].startswith("--"):
                raise UserError(f"the override --{key} has no value; write --{key}=VALUE.")
            value = rest.pop(0)
        try:
            out.append((key, yaml.load(value, Loader=_Loader)))
        except yaml.YAMLError as error:
            raise UserError(f"--{key}: cannot read the value {value!r}: {error}") from error
    return out


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
    content = load_yaml(path)
    if not isinstance(content, Mapping):
        raise UserError(f"{path}: expected a mapping of settings, found {type(content).__name__}.")
    data = _include(dict(content), path.parent)
    for key, value in overrides:
        _set(data, key, value)
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
            out[key] = _included(out[key], folder, key)
    if isinstance(out.get("defaults"), Mapping):
        out["defaults"] = _include(dict(out["defaults"]), folder)
    if isinstance(out.get("phases"), list):
        out["phases"] = [_include(dict(p), folder) if isinstance(p, Mapping) else p for p in out["phases"]]
    return out


def _included(value: Any, folder: Path, key: str) -> Any:
    name = value if isinstance(value, str) else value.get("file") if isinstance(value, Mapping) else None
    if name is None:
        return value
    # A name counts from the file that has it; from the working directory if there is no such file.
    near = folder / name
    content = load_yaml(near if near.is_file() or not Path(name).is_file() else Path(name))
    if not isinstance(content, Mapping):
        raise UserError(f"{name}: expected a mapping to use as `{key}`, found {type(content).__name__}.")
    changes = {} if isinstance(value, str) else {k: v for k, v in value.items() if k != "file"}
    return merge(content, changes)


def _set(data: Data, dotted: str, value: Any) -> None:
    """Set `phases.pretrain.steps` or `phases.0.steps`; mappings on the way are made if missing."""
    here: Any = data
    *way, last = dotted.split(".")
    for step in way:
        if isinstance(here, list):
            here = here[_list_index(here, step, dotted)]
        elif here.get(step) is None:
            here[step] = {}
            here = here[step]
        else:
            here = here[step]
        if not isinstance(here, dict | list):
            raise UserError(f"--{dotted}: `{step}` is {here!r}, which has nothing inside to set.")
    if isinstance(here, list):
        here[_list_index(here, last, dotted)] = value
    else:
        here[last] = value


def _list_index(items: list[Any], step: str, dotted: str) -> int:
    if step.isdigit():
        if int(step) >= len(items):
            raise UserError(f"--{dotted}: there is no number {step}; the list has {len(items)} entries, from 0.")
        return int(step)
    names = [str(item.get("name")) if isinstance(item, Mapping) else "" for item in items]
    if step not in names:
        raise UnknownNameError("list entry", step, filter(None, names), f"(in --{dotted})")
    return names.index(step)
