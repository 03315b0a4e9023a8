"""Settings from YAML files and dotted overrides on the command line, decoded by draccus into dataclasses."""

from __future__ import annotations

import dataclasses
import re
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from robocasa_lerobot.errors import UnknownNameError, UserError, suggest

Data = dict[str, Any]


class ConfigError(UserError):
    """Settings with an unknown key, a value of the wrong type, or an unreadable file."""


_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast where libyaml is there


class _Loader(_SafeLoader):
    """YAML with numbers as people write them: PyYAML alone reads `1e-4` as text."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d[\d_]*\.?[\d_]*|\.\d[\d_]*)[eE][-+]?\d+$"),
    list("-+0123456789."),
)


class _Typed(_Loader):
    """What is typed on the command line: names such as 003000, 2026_11_02, yes and no stay as they are typed.

    YAML 1.1 takes the first two for numbers (the first an octal one), and the others for true and false.
    """


_INT, _BOOL = "tag:yaml.org,2002:int", "tag:yaml.org,2002:bool"
_Typed.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in forms if tag not in (_INT, _BOOL)]
    for first, forms in _Loader.yaml_implicit_resolvers.items()
}
_Typed.add_implicit_resolver(_INT, re.compile(r"^[-+]?(0|[1-9][0-9]*)$"), list("-+0123456789"))
_Typed.add_implicit_resolver(_BOOL, re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), list("tTfF"))
_REMARK = re.compile(r"\s#")  # what YAML leaves out from there on, where it is not inside a list, mapping or quotes


def load_yaml(path: Path) -> Data:
    """The mapping at the top of a YAML file; an empty file is an empty mapping.

    Raises:
        ConfigError: no such file (the closest names are listed), not YAML, or not a mapping.
    """
    if not path.is_file():
        names = [p.name for p in path.parent.glob("[!.]*.yaml")] if path.parent.is_dir() else []
        raise ConfigError(f"no file {path}. {suggest(path.name, names) if names else 'Its folder has no YAML files.'}")
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: not valid YAML: {error}") from error
    if content is not None and not isinstance(content, Mapping):
        raise ConfigError(f"{path}: found {type(content).__name__}, expected a mapping of settings.")
    return dict(content or {})


def parse_overrides(arguments: Sequence[str], *, flags: bool = False) -> list[tuple[str, Any]]:
    """`--a.b=10` or `--a.b 10` as ("a.b", 10); values are YAML, but see `_Typed`. With `flags`, `--a.b` alone is true.

    Raises:
        ConfigError: an argument that is none of these.
    """
    out: list[tuple[str, Any]] = []
    rest = list(arguments)
    while rest:
        argument = rest.pop(0)
        if not argument.startswith("--") or argument == "--":
            raise ConfigError(f"unexpected argument {argument!r}: settings are written --name=VALUE.")
        key, equals, text = argument[2:].partition("=")
        if not equals:
            alone = not rest or rest[0].startswith("--")
            if alone and not flags:
                raise ConfigError(f"the setting --{key} has no value; write --{key}=VALUE.")
            text = "true" if alone else rest.pop(0)
        try:
            plain = text == "-" or (_REMARK.search(text) is not None and text.lstrip()[:1] not in ("[", "{", "'", '"'))
            out.append((key, text if plain else yaml.load(text, Loader=_Typed)))
        except yaml.YAMLError as error:
            raise ConfigError(f"--{key}: cannot read the value {text!r}: {error}") from error
    return out


def set_dotted(data: Data, dotted: str, value: Any) -> None:
    """Set `phases.pretrain.steps` or `phases.0.steps` in place; mappings above it are made if missing.

    Raises:
        ConfigError: the path leads through a value that has nothing inside.
        UnknownNameError: a list on that path has no entry of that name.
    """
    here: Any = data
    *path, last = dotted.split(".")
    for step in path:
        if isinstance(here, list):
            here = here[_list_index(here, step, dotted)]
        else:
            if here.get(step) is None:
                here[step] = {}
            here = here[step]
        if not isinstance(here, dict | list):
            raise ConfigError(f"--{dotted}: `{step}` is {here!r}, which has nothing inside to set.")
    if isinstance(here, list):
        here[_list_index(here, last, dotted)] = value
    else:
        here[last] = value


def check_keys(kind: type, data: Any, where: str, path: str = "") -> None:
    """Check that mappings have only keys that the dataclass `kind` (and those inside it) knows.

    And that what must be a mapping or a list is one, and a number no truth value, which draccus says in words of its
    own, or takes. `where` is the file, `path` the place in it.

    Raises:
        UnknownNameError: the first unknown key, with the closest match.
        ConfigError: another kind of value.
    """
    if not dataclasses.is_dataclass(kind) or not isinstance(data, Mapping):
        return
    hints = typing.get_type_hints(kind)
    for key, value in data.items():
        if key not in hints:
            raise UnknownNameError("key", str(key), hints, f"(in `{path}` of {where})" if path else f"(in {where})")
        below = f"{path}.{key}" if path else str(key)
        _check_kind(hints[key], value, below, where)
        inside = next(iter(_dataclasses_in(hints[key])), None)
        if inside is None:
            continue
        if isinstance(value, list):
            for number, item in enumerate(value):
                name = item.get("name", number) if isinstance(item, Mapping) else number
                _check_kind(inside, item, f"{below}.{name}", where)
                check_keys(inside, item, where, f"{below}.{name}")
        elif typing.get_origin(hints[key]) is dict and isinstance(value, Mapping):
            for name, item in value.items():
                check_keys(inside, item, where, f"{below}.{name}")
        else:
            check_keys(inside, value, where, below)


def _check_kind(hint: Any, value: Any, path: str, where: str) -> None:
    """Check that a value is a mapping, a list or a number where its `hint` takes nothing else."""
    options = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return
    kinds = {_kind_of(option) for option in options if option is not type(None)}
    found = Mapping if isinstance(value, Mapping) else list if isinstance(value, list | tuple) else type(value)
    if None in kinds or found in kinds or (kinds & {int, float} and found is not bool):
        return  # or draccus says what it expects
    if list in kinds:
        expected = "a list" if value is None or found is Mapping else f"a list, such as [{value}]"
    elif Mapping in kinds:
        names = next((", ".join(typing.get_type_hints(one)) for one in _dataclasses_in(hint)), "")
        expected = f"a mapping of settings{': ' + names if names else ''}"
    else:
        expected = "a number"
    raise ConfigError(f"{where}: `{path}` is {value!r}, expected {expected}.")


def _kind_of(hint: Any) -> type | None:
    """Of a type: `Mapping`, `list`, `int` or `float`; None for others."""
    origin = typing.get_origin(hint)
    if origin is dict or (isinstance(hint, type) and dataclasses.is_dataclass(hint)):
        return Mapping
    return list if origin in (list, tuple) else hint if hint in (int, float) else None


def _dataclasses_in(hint: Any) -> list[type]:
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return [hint]
    return [found for argument in typing.get_args(hint) for found in _dataclasses_in(argument)]


def decode[T](cls: type[T], data: Mapping[str, Any], where: str = "") -> T:
    """An instance of the dataclass `cls` from a nested mapping whose keys have been checked.

    Raises:
        UserError: the one that the dataclass itself raised, or a ConfigError for a value that does not fit.
    """
    import draccus

    try:
        return draccus.decode(cls, data)
    except Exception as error:  # draccus raises its own types, around whatever a constructor raises
        inner = user_error_in(error)
        if inner is not None:
            raise inner from None
        raise ConfigError(f"{where or 'settings'}: {error}") from error


def user_error_in(error: BaseException) -> UserError | None:
    """The user's mistake that a library wrapped into an error of its own, if there is one."""
    inner: BaseException | None = error
    while inner is not None and not isinstance(inner, UserError):
        inner = inner.__cause__ or inner.__context__
    return inner


def _list_index(items: list[Any], step: str, dotted: str) -> int:
    if step.isdigit():
        if int(step) >= len(items):
            raise ConfigError(f"--{dotted}: there is no number {step}; the list has {len(items)} entries, from 0.")
        return int(step)
    names = [str(item.get("name")) if isinstance(item, Mapping) else "" for item in items]
    if step not in names:
        raise UnknownNameError("list entry", step, filter(None, names), f"(in --{dotted})")
    return names.index(step)
