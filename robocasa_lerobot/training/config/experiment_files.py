"""Experiment files as plain data: bases, references to other files, defaults of phases, unknown keys."""

from __future__ import annotations

import copy
import fnmatch
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot.data.mixture_config import ROBOCASA365
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.settings import Data, load_yaml, set_dotted

FILE_KEYS = ("policy", "mixture")  # their value may be the name of a YAML file, or hold one under `file`
BASE, WITHOUT, REGISTRY = "base", "without_phases", "registry"
_OTHERS = {
    "type": "a policy's settings, which an experiment names under `policy`",
    "members": "a mixture, which a phase names under `mixture`",
    "select": "a mixture, which a phase names under `mixture`",
    "parts": "a study: `robocasa-lerobot study --config_path FILE`",
    "datasets": "a registry of datasets, which an experiment names under `registry`",
    "trials": "an evaluation: `robocasa-lerobot eval --config_path FILE`",
}
# Settings that identify a policy or mixture, and with each the settings of the base that it replaces; None is all.
IDENTITY: dict[str, dict[str, tuple[str, ...] | None]] = {
    "policy": {"file": None, "type": None, "path": None},
    "mixture": {"file": None, **dict.fromkeys(("members", "select"), ("file", "members", "select", "shares"))},
}


def merge(base: Mapping[str, Any], changes: Mapping[str, Any]) -> Data:
    """`base` with `changes` laid over it: mappings key by key, phases by name or pattern, everything else replaced.

    A policy or mixture that names what it is (a file, a type) replaces the base's with all its settings, and new
    members of a mixture replace the base's.
    """
    out = dict(copy.deepcopy(dict(base)))
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(out.get(key), Mapping)
        if key == "phases" and _named(out.get(key)) and _named(value):
            out[key] = _merge_phases(out[key], value)
        elif both:
            out[key] = merge(_kept(key, out[key], value), value)
        else:
            out[key] = copy.deepcopy(value)
    return out


def _kept(key: str, base: Mapping[str, Any], changes: Mapping[str, Any]) -> Data:
    """What of the policy or mixture `base` is left where `changes` say what it is."""
    out = dict(base)
    for name in IDENTITY.get(key, {}).keys() & changes.keys():
        ended = IDENTITY[key][name]
        out = {} if ended is None else {k: v for k, v in out.items() if k not in ended}
    return out


def resolve(path: Path, overrides: Sequence[tuple[str, Any]] = ()) -> Data:
    """The experiment file `path` as plain data: bases and files included, overrides and `defaults` applied.

    Raises:
        UserError: a missing file, files that are each other's base, or an override that leads nowhere.
    """
    data = _load(path, ())
    inside = {key for key, _ in overrides if _is_inside_a_file(data, key)}
    later = {key for key in inside if key.startswith("phases.")}  # what they change may come from `defaults`
    _set_all(data, [(key, value) for key, value in overrides if key not in inside])
    data = _at_file_keys(data, _included)
    _set_all(data, [(key, value) for key, value in overrides if key in inside - later])
    defaults = data.pop("defaults", None) or {}
    registry = data.pop(REGISTRY, None)
    if isinstance(data.get("phases"), list):
        data["phases"] = [merge(defaults, p) if isinstance(p, Mapping) else p for p in data["phases"]]
        _set_all(data, [(key, value) for key, value in overrides if key in later])
        for phase in data["phases"] if registry is not None else ():
            _set_registry(phase, registry)
    return data if registry is None else {**data, REGISTRY: registry}


def _set_all(data: Data, overrides: Sequence[tuple[str, Any]]) -> None:
    for key, value in overrides:
        set_dotted(data, key, value)


def _is_inside_a_file(data: Any, dotted: str) -> bool:
    """Whether a setting such as `phases.pretrain.mixture.members.0.weight` is in a list or mapping of a file.

    Or of what a phase has from `defaults`: at least two steps below a policy or mixture that is not spelt out here.
    """
    here, steps = data, dotted.split(".")
    for number, step in enumerate(steps[:-1]):
        below = number > 0 and steps[number - 1] in FILE_KEYS
        if below and (here is None or (isinstance(here, Mapping) and "file" in here and step not in here)):
            return True
        if isinstance(here, Mapping):
            here = here.get(step)
        elif isinstance(here, list):
            named = [item for item in here if isinstance(item, Mapping) and item.get("name") == step]
            here = named[0] if named else here[int(step)] if step.isdecimal() and int(step) < len(here) else None
        else:
            return False
    return False


def _set_registry(phase: Any, registry: str) -> None:
    """Let the phase's selections that name no registry look in `registry`."""
    mixture = phase.get("mixture") if isinstance(phase, Mapping) else None
    for selection in (mixture.get("select") or []) if isinstance(mixture, Mapping) else []:
        if isinstance(selection, dict):
            selection.setdefault("registry", registry)


def _refuse_others(path: Path, data: Data) -> None:
    """Say what a file is that is no experiment, where its settings tell.

    Raises:
        UserError: it is a policy's, a mixture's, an evaluation's, a study's or a registry's.
    """
    for key, what in _OTHERS.items():
        if key in data:
            raise UserError(f"{path} is no experiment, which has `phases`: with `{key}` it is {what}.")


def _load(path: Path, above: tuple[Path, ...]) -> Data:
    """A file laid over its bases, with the files that it names as paths that hold anywhere."""
    if path.resolve() in above:
        raise UserError(f"{path} is its own base, through {', '.join(str(p.name) for p in above)}.")
    data = load_yaml(path)
    if "phases" not in data and BASE not in data:
        _refuse_others(path, data)
    bases, without = data.pop(BASE, None) or [], data.pop(WITHOUT, None) or []
    own = _at_file_keys(data, functools.partial(_anchored, folder=path.parent))
    if isinstance(own.get(REGISTRY), str) and own[REGISTRY] != ROBOCASA365:
        own[REGISTRY] = _anchored(own[REGISTRY], path.parent)["file"]
    out: Data = {}
    for name in [bases] if isinstance(bases, str) else bases:
        out = merge(out, _load(path.parent / name, (*above, path.resolve())))
    for name in without:
        known = [p["name"] for p in out.get("phases", [])]
        if name not in known:
            raise UnknownNameError("phase", str(name), known, f"(in `{WITHOUT}` of {path.name})")
        out["phases"] = [p for p in out["phases"] if p["name"] != name]
    return merge(out, own)


def _named(phases: Any) -> bool:
    return isinstance(phases, list) and all(isinstance(p, Mapping) and "name" in p for p in phases)


def _merge_phases(base: list[Data], changes: list[Data]) -> list[Data]:
    out = {phase["name"]: phase for phase in base}
    for phase in changes:
        if "*" in phase["name"]:  # what changes in all phases so far that match
            own = {key: value for key, value in phase.items() if key != "name"}
            matching = [name for name in out if fnmatch.fnmatchcase(name, phase["name"])]
            if not matching:
                raise UnknownNameError("phase", phase["name"], out, "(a pattern that none of the phases so far fits)")
            out |= {name: merge(out[name], own) for name in matching}
        else:
            out[phase["name"]] = merge(out.get(phase["name"], {}), phase)
    return list(out.values())


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


def _at_file_keys(data: Data, change: Callable[[Any], Any]) -> Data:
    """`data` with what stands under FILE_KEYS changed: at the top, in `defaults` and in each phase."""
    out = dict(data)
    for key in FILE_KEYS:
        if key in out:
            out[key] = change(out[key])
    if isinstance(out.get("defaults"), Mapping):
        out["defaults"] = _at_file_keys(dict(out["defaults"]), change)
    if isinstance(out.get("phases"), list):
        out["phases"] = [_at_file_keys(dict(p), change) if isinstance(p, Mapping) else p for p in out["phases"]]
    return out


def _anchored(value: Any, folder: Path) -> Any:
    """A file name as `{file: path}`: it counts from the file that has it, else from the working directory."""
    name = _file_of(value)
    if name is None:
        return value
    near = folder / name
    path = str(near if near.is_file() or not Path(name).is_file() else name)
    return {"file": path} if isinstance(value, str) else {**value, "file": path}


def _included(value: Any) -> Any:
    name = _file_of(value)
    if name is None:
        return value
    changes = {} if isinstance(value, str) else {k: v for k, v in value.items() if k != "file"}
    return merge(load_yaml(Path(name)), changes)


def _file_of(value: Any) -> str | None:
    name = value if isinstance(value, str) else value.get("file") if isinstance(value, Mapping) else None
    return None if name is None else str(name)
