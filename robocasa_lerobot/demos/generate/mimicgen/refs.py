"""What derived subtasks are relative to, in words for every scene: `stage0.part0`, whichever burner it is."""

from __future__ import annotations

import re

from robocasa_lerobot.demos.generate.sources.frames import parts_of
from robocasa_lerobot.demos.generate.sources.segments import Segment
from robocasa_lerobot.demos.generate.sources.source import Source
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

_REF = re.compile(r"stage(\d+)\.(part|object|place)(\d*)")


def refs_of(source: Source) -> dict[str, str]:
    """Names in a source's poses of its stages' parts, objects and places, by the words for them."""
    found: dict[str, str] = {}
    for number, words in enumerate(source.data.about["stages"]):
        named = {f"part{index}": name for index, name in enumerate(words["parts"])}
        named |= {"object": words["thing"], "place": words["place"]}
        found |= {f"stage{number}.{what}": name for what, name in named.items() if name in source.data.poses}
    return found


def ref_of(source: Source, segment: Segment) -> str:
    """What a segment of a source is about; its name there where its stage has no words for it."""
    words = source.data.about["stages"][segment.stage]
    if segment.ref in words["parts"]:
        return f"stage{segment.stage}.part{words['parts'].index(segment.ref)}"
    return f"stage{segment.stage}.object" if segment.ref == words["thing"] else segment.ref


def name_here(env: KitchenEnv, ref: str) -> str:
    """What this scene calls something; other words than those of this file stay as they are.

    Raises:
        SkillError: the stage has fewer parts here, as a cabinet with one door.
    """
    found = _REF.fullmatch(ref)
    if found is None:
        return ref
    stage = env.declaration.stages[int(found[1])]
    if found[2] != "part":
        return env.scene.fill(stage.object if found[2] == "object" else stage.target)
    parts = parts_of(env, stage)
    if int(found[3]) >= len(parts):
        raise SkillError(f"{stage.target} has {len(parts)} of the parts that the sources have {int(found[3]) + 1} of")
    return parts[int(found[3])].name
