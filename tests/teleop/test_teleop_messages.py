"""What clients send is checked, and what is no message is told why; frames are packed as they are unpacked."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robocasa_lerobot.teleop
from robocasa_lerobot.teleop.messages import MESSAGE_TYPES, Message, ProtocolError, pack_frame, parse, unpack_frame

PROTOCOL = Path(robocasa_lerobot.teleop.__file__).parent / "protocol.md"
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)


def told() -> list[dict[str, Any]]:
    """Examples in the page about the protocol that clients send: those after its heading."""
    text = PROTOCOL.read_text(encoding="utf-8").partition("## Client to server")[2]
    found = re.findall(r'\{"type".*?\}(?=\s*[`\n])', text, re.DOTALL)
    return [json.loads(example) for example in found]


def test_every_message_that_the_page_tells_of_is_understood() -> None:
    examples = told()
    assert len(examples) > 15
    for example in examples:
        kind = example["type"]
        assert parse(json.dumps(example)) == Message(kind, parse(json.dumps(example)).values)
    named = set(re.findall(r'"type": "(\w+)"', PROTOCOL.read_text(encoding="utf-8"))) | {"take"}
    assert set(MESSAGE_TYPES) <= named


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "JSON object"),
        ("[]", "JSON object"),
        ('{"type": "drop"}', "unknown type 'drop'"),
        ('{"type": ["ack"]}', "unknown type"),
        ('{"type": "ack"}', "frame missing"),
        ('{"type": "ack", "frame": -1}', "whole number"),
        ('{"type": "ack", "frame": true}', "whole number"),
        ('{"type": "ack", "frame": 1, "extra": 1}', "unknown field 'extra'"),
        ('{"type": "input", "frame": 1, "arm": [0, 0, 0]}', "list of 6 numbers"),
        ('{"type": "input", "frame": 1, "torso": NaN}', "no number of JSON"),
        ('{"type": "input", "frame": 1, "torso": 1e400}', "from -1 to 1"),
        ('{"type": "action", "frame": 1, "action": [0,0,0,0,0,0,0,0,0,0,0,2]}', "from -1 to 1"),
        ('{"type": "set", "mode": "fly"}', "one of arm, base, both"),
        ('{"type": "set", "mode": ["arm"]}', "one of arm, base, both"),
        ('{"type": "discard", "reason": 3}', "a line"),
        ("[" * 20000, "JSON object"),
    ],
)
def test_what_is_no_message_is_refused_with_a_reason(text: str, why: str) -> None:
    with pytest.raises(ProtocolError, match=re.escape(why)):
        parse(text)


@pytest.mark.parametrize(
    ("kind", "field", "words", "low", "high"),
    [
        ("set", "speed", "`speed`: from 0.01 to 1", 0.01, 1),
        ("view", "azimuth", "azimuth from -100 to 100", -100, 100),
        ("view", "elevation", "elevation from -1.57 to 1.57", -1.57, 1.57),
        ("view", "distance", "distance from 0.2 to 10 metres", 0.2, 10),
    ],
)
def test_ranges_are_those_that_the_page_tells(kind: str, field: str, words: str, low: float, high: float) -> None:
    assert words in PROTOCOL.read_text(encoding="utf-8")
    for number in (low, high):
        assert parse(json.dumps({"type": kind, field: number}))[field] == number
    for number in (low - 0.001, high + 0.001):
        with pytest.raises(ProtocolError, match="expected a number from"):
            parse(json.dumps({"type": kind, field: number}))


def test_a_reason_is_one_plain_line() -> None:
    said = "cup\u00a0tipped\nover \U0001f469\u200d\U0001f373"
    assert parse(json.dumps({"type": "discard", "reason": said}))["reason"] == "cup tipped over \U0001f469 \U0001f373"


@given(kind=st.sampled_from(MESSAGE_TYPES), fields=st.dictionaries(st.text(max_size=8), JSON, max_size=4))
def test_anything_else_is_refused_and_nothing_worse(kind: str, fields: dict[str, Any]) -> None:
    try:
        message = parse(json.dumps({**fields, "type": kind}))
    except ProtocolError:
        return
    assert message.type == kind


@given(header=st.dictionaries(st.text(max_size=5), st.integers(), max_size=3), pictures=st.lists(st.binary(max_size=9)))
def test_frames_come_out_as_they_went_in(header: dict[str, Any], pictures: list[bytes]) -> None:
    told = {**header, "pictures": [{"bytes": len(picture)} for picture in pictures]}
    message = pack_frame(told, pictures)
    assert unpack_frame(message) == (told, pictures)
    with pytest.raises(ProtocolError):
        unpack_frame(message + b"x")
