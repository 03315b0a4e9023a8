"""Typed configuration from a YAML file and dotted overrides: `--env.split=target`, `--trials 10`."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from typing import Any

from robocasa_lerobot.config_files import find_config
from robocasa_lerobot.errors import suggest
from robocasa_lerobot.settings import ConfigError, decode, load_yaml, parse_overrides, set_dotted

# Groups of settings that may be given by one value: `--policy=zero` is `--policy.path=zero`.
_SHORT = {"policy": "path"}


def load_config[T](cls: type[T], arguments: Sequence[str]) -> T:
    """An instance of the dataclass `cls` from command-line arguments.

    `--config_path FILE` names a YAML file, or one in `configs/evaluations/`; every other argument is
    `--dotted.key=value` or `--dotted.key value` and wins over the file. Values are YAML; a list may be written `A,B`.

    Raises:
        ConfigError: what was found, what was expected, and the closest name of an unknown key.
    """
    tree: dict[str, Any] = {}
    overrides = parse_overrides(arguments, flags=True)
    for key, value in overrides:
        if key == "config_path":
            tree = load_yaml(find_config(str(value), "evaluations"))
    for key, value in overrides:
        if key != "config_path":
            set_dotted(tree, f"{key}.{_SHORT[key]}" if key in _SHORT else key, value)
    return decode(cls, _check(cls, tree, ""), "the configuration")


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
        elif typing.get_origin(hint) is list and isinstance(value, Mapping):  # YAML's, of a colon at an end or a space
            raise ConfigError(
                f"{prefix}{key}: found {dict(value)!r}, expected A or A,B; a text with a colon at its end or before a "
                f"space is written in quotes that the shell leaves, --{prefix}{key}='\"A: B\"'."
            )
        elif typing.get_origin(hint) is list and not isinstance(value, list):
            value = [] if value is None else [part.strip() for part in str(value).split(",") if part.strip()]
        out[key] = value
    return out
