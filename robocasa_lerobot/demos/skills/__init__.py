"""The foundational skills: each a generator of actions that watches the scene and stops when it is done.

`SKILLS[skill, verb]` carries out a stage of a task. A skill that cannot go on raises `SkillError`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.drawers import close_drawer, open_drawer
from robocasa_lerobot.demos.skills.navigation import drive
from robocasa_lerobot.demos.skills.pick_place import place_into_basin
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.task import Stage

Skill = Callable[[KitchenEnv, Stage], Iterator[Array]]

SKILLS: dict[tuple[str, str], Skill] = {
    ("drawers", "open"): open_drawer,
    ("drawers", "close"): close_drawer,
    ("navigation", "drive"): drive,
    ("pick_place", "place"): place_into_basin,
}

__all__ = ["SKILLS", "Skill", "SkillError"]
