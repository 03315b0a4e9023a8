"""How stages are cut into segments, and what of that a file may say otherwise for a skill's verb.

What is not said is derived from the stage: which body is the reference follows from its skill, target and part, where
segments begin and end from contacts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from robocasa_lerobot.demos.generate.sources.frames import HANDLE, REST
from robocasa_lerobot.demos.skills import SKILLS
from robocasa_lerobot.errors import UnknownNameError, UserError


@dataclass(frozen=True)
class CutRules:
    """Of a verb.

    Attributes:
        near_m: a segment begins where the hand is as near as this to where it touches or grasps.
        place_near_m: the same to where it lets go.
        use_near_m: a use begins and ends where what is held is farther by this than it comes to where it is used.
        far_steps: so many control steps before that at most.
        gap_steps: a touch that is lost for no longer goes on.
        moved_share: of its range that a part must move by, or touching it is no segment.
        frame: what of a part the reference lies on, "handle" or "rest"; empty takes what is touched.
    """

    near_m: float = 0.14
    place_near_m: float = 0.20
    use_near_m: float = 0.12
    far_steps: int = 45
    gap_steps: int = 12
    moved_share: float = 0.04
    frame: str = ""


COMMON = CutRules()
FRAMES = ("", HANDLE, REST)
_ABOVE_0 = ("near_m", "place_near_m", "use_near_m")
DERIVED: Mapping[str, CutRules] = MappingProxyType({})


def rules_for(rules: Mapping[str, CutRules], words: Mapping[str, Any]) -> CutRules:
    """Those of a stage, given by its words."""
    return rules.get(f"{words['skill']} {words['verb']}", COMMON)


def read_rules(path: Path) -> dict[str, CutRules]:
    """Rules by skill and verb from a YAML file, such as `drawers open: {near_m: 0.1, frame: handle}`.

    Raises:
        UnknownNameError: no such verb, rule, or part to lie on.
        UserError: the file cannot be read, or a value is of another kind.
    """
    try:
        asked = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise UserError(f"{path} cannot be read as YAML ({error}).") from error
    if not isinstance(asked, dict):
        raise UserError(f"{path} should name skills and verbs with their rules, as `drawers open: {{near_m: 0.1}}`.")
    return rules_from(asked, str(path))


def rules_from(asked: Mapping[str, Any], where: str = "rules") -> dict[str, CutRules]:
    """The same from plain values.

    Raises:
        UnknownNameError: no such verb, or no such rule.
        UserError: a value is of another kind.
    """
    found: dict[str, CutRules] = {}
    known = {entry.name: type(entry.default) for entry in fields(CutRules)}
    verbs = [f"{skill} {verb}" for skill, verb in SKILLS]
    for verb, values in asked.items():
        if verb not in verbs:
            raise UnknownNameError("skill and verb", str(verb), verbs)
        if values is None:
            continue
        if not isinstance(values, dict):
            raise UserError(f"{where}, {verb}: found {values!r}, expected rules with their values, as near_m: 0.1.")
        for name, value in values.items():
            if name not in known:
                raise UnknownNameError("rule", str(name), known)
            if not isinstance(value, (int, float) if known[name] is float else known[name]):
                raise UserError(f"{where}, {verb}: {name} is {value!r}, but should be a {known[name].__name__}.")
            if name in _ABOVE_0 and not 0.0 < values[name] < math.inf:
                raise UserError(f"{where}, {verb}: {name} is {value!r}, expected a number of metres above 0.")
        if (frame := values.get("frame", "")) not in FRAMES:
            raise UnknownNameError(f"{where}, {verb}: frame", frame, FRAMES)
        found[str(verb)] = replace(COMMON, **values)
    return found
