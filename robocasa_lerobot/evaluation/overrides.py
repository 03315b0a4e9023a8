"""Typed configuration from a YAML file and dotted overrides: `--env.split=target`, `--trials 10`."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import draccus
import yaml

from robocasa_lerobot.errors import UserError, suggest


class ConfigError(UserError):
    """A configuration with an unknown key, a value of the wrong type, or an unreadable file."""


def load_config[T](cls: type[T], arguments: Sequence[str]) -> T:
    """An instance of the dataclass `cls` from command-line arguments.

    `--config_path FILE` names a YAML file; every other argument is `--dotted.key=value` or `--dotted.key value`
    and wins over the file. Values are YAML; a list may be written `A,B`.

    Raises:
        ConfigError: what was found, what was expected, and the closest name of an unknown key.
    """
    assignments = parse_assignments(arguments)
    tree: dict[str, Any] = {}
    config_path = assignments.pop("config_path", None)
    if config_path is not None:
        tree = read_yaml(Path(str(config_path)))
    for key, value in assignments.items():
        _assign(tree, key, value)
    return decode(cls, tree)


def decode[T](cls: type[T], tree: Mapping[str, Any]) -> T:
    """An instance of the dataclass `cls` from a nested mapping (see `load_config` for the errors)."""
    checked = _check(cls, tree, "")
    try:
        return draccus.decode(cls, checked)
    except Exception as error:  # draccus raises its own types, around whatever a constructor raises
        inner = user_error_in(error)
        if inner is not None:
            raise inner from None
        raise ConfigError(f"cannot read the configuration: {error}") from error


def user_error_in(error: BaseException) -> UserError | None:
    """The user's mistake that draccus wrapped into an error of its own, if there is one."""
    inner: BaseException | None = error
    while inner is not None and not isinstance(inner, UserError):
        inner = inner.__cause__ or inner.__context__
    return inner


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping at the top of a YAML file."""
    if not path.is_file():
        raise ConfigError(f"{path}: no such configuration file.")
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: not valid YAML: {error}") from error
    if tree is None:
        return {}
    if not isinstance(tree, dict):
        raise ConfigError(f"{path}: found {type(tree).__name__}, expected a mapping of settings.")
    return tree


def parse_assignments(arguments: Sequence[str]) -> dict[str, Any]:
    """`--a.b=1`, `--a.b 1` and `--flag` (true) as a mapping of dotted keys to YAML values."""
    out: dict[str, Any] = {}
    rest = list(arguments)
    while rest:
        argument = rest.pop(0)
        if not argument.startswith("--") or argument == "--":
            raise ConfigError(f"unexpected argument {argument!r}: settings are written --name=value.")
        key, equals, text = argument[2:].partition("=")
        if not equals:
            text = rest.pop(0) if rest and not rest[0].startswith("--") else "true"
        try:
            out[key] = yaml.safe_load(text)
        except yaml.YAMLError:
            out[key] = text
    return out


def _assign(tree: dict[str, Any], key: str, value: Any) -> None:
    *parents, leaf = key.split(".")
    node = tree
    for depth, name in enumerate(parents, start=1):
        child = node.setdefault(name, {})
        if not isinstance(child, dict):
            raise ConfigError(f"--{key}: {'.'.join(parents[:depth])} is {child!r}, which has no settings of its own.")
        node = child
    node[leaf] = value


def _check(cls: type, tree: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """`tree` with comma lists split, after every key has been looked up in the dataclass."""
    hints = typing.get_type_hints(cls)
    names = [f.name for f in dataclasses.fields(cls)]
    out: dict[str, Any] = {}
    for key, value in tree.items():
        if key not in names:
            shown = suggest(str(key), names).replace("'", "'" + prefix, 1) if prefix else suggest(str(key), names)
            raise ConfigError(f"unknown setting '{prefix}{key}'. {shown}")
        hint = hints[key]
        if dataclasses.is_dataclass(hint):
            if not isinstance(value, Mapping):
                raise ConfigError(
                    f"{prefix}{key}: found {value!r}, expected settings such as --{prefix}{key}.NAME=VALUE."
                )
            value = _check(typing.cast(type, hint), value, f"{prefix}{key}.")
        elif typing.get_origin(hint) is list and not isinstance(value, list):
            value = [] if value is None else [part.strip() for part in str(value).split(",") if part.strip()]
        out[key] = value
    return out
