"""Settings on the command line: names stay as they are typed, numbers and lists are what they look like."""

from __future__ import annotations

from typing import Any

import pytest

from robocasa_lerobot.settings import ConfigError, parse_overrides

NAMES = ["003000", "010", "2026_11_02", "yes", "no", "on", "off", "1:30", "0x1g", "steps_1_000", "-", "~x"]


@pytest.mark.parametrize("text", [*NAMES, "pi0 #2", "a # b"])
def test_names_stay_as_they_are_typed(text: str) -> None:
    assert parse_overrides([f"--policy.label={text}"]) == [("policy.label", text)]
    assert parse_overrides(["--policy.label", text]) == [("policy.label", text)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3000", 3000), ("-3", -3), ("0", 0), ("+2", 2), ("1e-4", 1e-4), ("1.5", 1.5), (".5", 0.5), ("true", True),
        ("False", False), ("null", None), ("[1, 2]", [1, 2]), ("{a: 1}", {"a": 1}), ('"007"', "007"),
        ("'1 #2'", "1 #2"), ("[a, b] # said twice", ["a", "b"]), ("a,b", "a,b"), ("", None),
    ],
)  # fmt: skip
def test_other_values_are_what_they_look_like(text: str, value: Any) -> None:
    ((_, found),) = parse_overrides([f"--x={text}"])
    assert found == value
    assert type(found) is type(value)


def test_what_is_no_setting_is_named() -> None:
    for wrong in (["x"], ["--x"], ["--x=[1"], ["--"]):
        with pytest.raises(ConfigError):
            parse_overrides(wrong)
    assert parse_overrides(["--x"], flags=True) == [("x", True)]
