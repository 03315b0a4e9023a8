"""The language of an episode: recorded, from a template filled in from the episode's description, or given."""

from __future__ import annotations

import json
import re
import string
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robocasa_lerobot.convert.reading.demo import Demo, RejectedEpisodeError
from robocasa_lerobot.convert.reading.demo_file import UNKNOWN, DemoFile
from robocasa_lerobot.convert.reading.layout import InstructionSource
from robocasa_lerobot.errors import UnknownNameError, UserError

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
OPTION = "--instruction"


@dataclass(frozen=True)
class Instruction:
    """The language of an episode and where it came from."""

    text: str
    source: str


def instruction_of(demo: Demo, file: DemoFile, given: str | None, replace: bool = False) -> Instruction:
    """The recorded instruction, else the user's, else the words of the environment's name and nothing invented.

    `given` may be a template with fields such as `{obj}`; with `replace` it comes before the recorded instruction.

    Raises:
        UnknownNameError: the template has a field that the episode's description has not.
        UserError: nothing says what the robot was told.
    """
    robot = file.layout.robot
    described = robot.instruction if robot is not None else InstructionSource()
    template, origin = (given, OPTION) if given is not None else (described.text, "mapping file")
    if not (replace and template is not None):
        recorded = _recorded(demo, file, described)
        if recorded is not None:
            return recorded
    if template is not None:
        names = template_fields(template)
        if not names:
            return Instruction(template.format(), origin)
        return Instruction(_filled(template, names, fields(demo, file.env_name)), f"{origin} template")
    if file.env_name == UNKNOWN:
        raise UserError(
            f"{file.path}: {demo.name} records no instruction and the file no environment: give --instruction TEXT."
        )
    return Instruction(words_of(file.env_name), "environment name")


def words_of(name: str) -> str:
    """`open drawer` of `OpenDrawer`."""
    return " ".join(word.lower() for word in _WORD.findall(name)) or name


def template_fields(template: str) -> tuple[str, ...]:
    """Names of the fields of a template.

    Raises:
        UserError: its braces do not match, or a field is more than a name.
    """
    try:
        parsed = list(string.Formatter().parse(template))
    except ValueError as error:
        raise UserError(f"the instruction {template!r}: {error}. Write {{{{ and }}}} for braces themselves.") from None
    names = []
    for _, name, form, conversion in parsed:
        if name is None:
            continue
        if not name.isidentifier() or form or conversion:
            raise UserError(f"the instruction {template!r}: a field is a name in braces, such as {{obj}}.")
        names.append(name)
    return tuple(names)


def fields(demo: Demo, env_name: str) -> dict[str, str]:
    """What a template can name: `task`, objects (their category), fixtures, and the plain values of `ep_meta`."""
    meta = demo.ep_meta
    found = {"task": words_of(env_name)}
    for key, value in meta.items():
        if isinstance(value, str | int | float) and key.isidentifier():
            found[key] = str(value)
    fixtures = meta.get("fixture_refs")
    for key, value in fixtures.items() if isinstance(fixtures, Mapping) else ():
        if isinstance(value, str):
            found[str(key)] = _spaced(value)
    objects = meta.get("object_cfgs")
    for entry in objects if isinstance(objects, list) else ():
        info = entry.get("info") if isinstance(entry, Mapping) else None
        category = info.get("cat") if isinstance(info, Mapping) else None
        if isinstance(category, str) and isinstance(entry.get("name"), str):
            found[entry["name"]] = _spaced(category)
    return found


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _filled(template: str, names: tuple[str, ...], values: Mapping[str, str]) -> str:
    for name in names:
        if name not in values:
            known = ", ".join(sorted(values))
            raise UnknownNameError("field", name, values, f"(the instruction's template; its episode has {known})")
    return template.format(**values)


def _recorded(demo: Demo, file: DemoFile, described: InstructionSource) -> Instruction | None:
    if described.dataset is not None:
        text = demo.text_of(described.dataset)
        if text is None:
            raise RejectedEpisodeError(f"it has no text {described.dataset!r}, which the mapping has as instruction.")
        return Instruction(text, described.dataset)
    if described.attribute is not None:
        found = demo.attribute(described.attribute)
        found = file.attribute(described.attribute) if found is None else found
        text = _field(found, described.field)
        label = described.attribute + (f".{described.field}" if described.field else "")
        if text is None:
            raise RejectedEpisodeError(f"it has no attribute {label!r}, which the mapping has as instruction.")
        return Instruction(text, label)
    recorded = demo.ep_meta.get("lang")
    if isinstance(recorded, str) and recorded.strip():
        return Instruction(recorded, "ep_meta.lang")
    return None


def _field(value: Any, dotted: str | None) -> str | None:
    if dotted is not None:
        try:
            value = json.loads(value) if isinstance(value, str) else None
        except json.JSONDecodeError:
            return None
        for name in dotted.split("."):
            value = value.get(name) if isinstance(value, dict) else None
    if isinstance(value, list):  # LIBERO has the words in a list
        value = " ".join(map(str, value))
    return value if isinstance(value, str) and value.strip() else None
