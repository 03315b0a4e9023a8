"""The foundational skills: each a generator of actions that watches the scene and stops when it is done.

`SKILLS[skill, verb]` carries out a stage of a task. A skill that cannot go on raises `SkillError`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.blender_cover import cover
from robocasa_lerobot.demos.skills.blender_lid import uncover
from robocasa_lerobot.demos.skills.buttons import press_button
from robocasa_lerobot.demos.skills.close_dishwasher import lift_low
from robocasa_lerobot.demos.skills.close_doors import close_doors, lift_shut
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.doors import push_lid
from robocasa_lerobot.demos.skills.drawers import close_drawer, open_drawer
from robocasa_lerobot.demos.skills.handles import open_doors
from robocasa_lerobot.demos.skills.hot_water import run_hot_water
from robocasa_lerobot.demos.skills.knobs import (
    raise_knob,
    turn_burner_low,
    turn_burner_medium,
    turn_highest,
    turn_knob,
    turn_lowest,
    turn_off_burner,
    turn_on_burner,
)
from robocasa_lerobot.demos.skills.levers import (
    press_lever,
    sweep_sideways,
    turn_off_water,
    turn_on_water,
    turn_sideways,
)
from robocasa_lerobot.demos.skills.mixer_head import lower_head, raise_head
from robocasa_lerobot.demos.skills.pick_place.hold import hold_object
from robocasa_lerobot.demos.skills.pick_place.tools.pour import pour
from robocasa_lerobot.demos.skills.pick_place.tools.press import press
from robocasa_lerobot.demos.skills.pick_place.tools.press_with import press_with
from robocasa_lerobot.demos.skills.pick_place.tools.rinse import rinse
from robocasa_lerobot.demos.skills.pick_place.tools.stir import stir
from robocasa_lerobot.demos.skills.pick_place.tools.swing import shake, tilt, turn
from robocasa_lerobot.demos.skills.pick_place.tools.wipe import wipe
from robocasa_lerobot.demos.skills.pick_place.verbs import drive, pick_object, place_object
from robocasa_lerobot.demos.skills.racks import pull, push, slide
from robocasa_lerobot.demos.skills.waiting import wait
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

Skill = Callable[[KitchenEnv, Stage], Iterator[Array]]

SKILLS: dict[tuple[str, str], Skill] = {
    ("doors", "close"): close_doors,
    ("doors", "open"): open_doors,
    ("doors", "raise_head"): raise_head,
    ("doors", "lower_head"): lower_head,
    ("doors", "close_large"): close_doors,
    ("doors", "lift_shut"): lift_shut,
    ("doors", "lift_low"): lift_low,
    ("doors", "push_lid"): push_lid,
    ("drawers", "open"): open_drawer,
    ("drawers", "close"): close_drawer,
    ("racks", "slide"): slide,
    ("racks", "pull"): pull,
    ("racks", "push"): push,
    ("navigation", "drive"): drive,
    ("buttons", "press"): press_button,
    ("knobs", "on"): turn_on_burner,
    ("knobs", "off"): turn_off_burner,
    ("knobs", "low"): turn_burner_low,
    ("knobs", "medium"): turn_burner_medium,
    ("knobs", "lowest"): turn_lowest,
    ("knobs", "highest"): turn_highest,
    ("knobs", "raise"): raise_knob,
    ("knobs", "turn"): turn_knob,
    ("knobs", "wait"): wait,
    ("levers", "press"): press_lever,
    ("levers", "on"): turn_on_water,
    ("levers", "off"): turn_off_water,
    ("levers", "turn"): turn_sideways,
    ("levers", "hot"): run_hot_water,
    ("levers", "sweep"): sweep_sideways,
    ("pick_place", "pick"): pick_object,
    ("pick_place", "place"): place_object,
    ("pick_place", "place_upside_down"): place_object,
    ("pick_place", "hold"): hold_object,
    ("pick_place", "rinse"): rinse,
    ("pick_place", "pour"): pour,
    ("pick_place", "press"): press,
    ("pick_place", "press_with"): press_with,
    ("pick_place", "stir"): stir,
    ("pick_place", "wipe"): wipe,
    ("pick_place", "shake"): shake,
    ("pick_place", "tilt"): tilt,
    ("pick_place", "turn"): turn,
    ("pick_place", "uncover"): uncover,
    ("pick_place", "cover"): cover,
}

__all__ = ["SKILLS", "Skill", "SkillError"]
