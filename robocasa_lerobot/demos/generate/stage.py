"""The skills of generation: each carries out a stage with segments of sources instead of plans of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.generate.course import AT_REST, BRIDGE, DRIVE, Course
from robocasa_lerobot.demos.generate.objects.lid_places import LID_VERBS
from robocasa_lerobot.demos.generate.objects.object_segments import object_stage
from robocasa_lerobot.demos.generate.part_segments import part_stage
from robocasa_lerobot.demos.generate.sources.frames import JOINTED
from robocasa_lerobot.demos.generate.sources.uses import USES
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.motion_style import MotionStyle
from robocasa_lerobot.demos.skills import SKILLS, Skill
from robocasa_lerobot.demos.stages import StageLog
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage, Task
from robocasa_lerobot.envs.tasks.typical import stages_of

# Without a contact that a source could show, and of which kind their steps are.
PLANNED = {("navigation", "drive"): DRIVE, ("knobs", "wait"): BRIDGE}
OBJECT_VERBS = ("pick", "place", "place_upside_down", *LID_VERBS, *USES)


def can_generate(task: Task) -> bool:
    """Whether every stage of a task is of a kind that is carried out with segments of sources."""
    return all(_is_generated(stage.skill, stage.verb) for stage in stages_of(task))


def _is_generated(skill: str, verb: str) -> bool:
    return skill in JOINTED or (skill, verb) in PLANNED or (skill == "pick_place" and verb in OBJECT_VERBS)


def generated(env: KitchenEnv, style: MotionStyle, log: StageLog, course: Course) -> Iterator[Array]:
    """Actions (12,), stored order, of a generated episode; see `demonstrate`.

    Raises:
        UnknownNameError: a stage's verb cannot be generated.
        SkillError: a stage is not done after all its attempts.
    """
    yield from course.counted(demonstrate(env, style, log, skills_with(course)))


def skills_with(course: Course) -> dict[tuple[str, str], Skill]:
    """What carries out stages with the sources of an episode; drives between fixtures, and waits, are planned."""
    skills: dict[tuple[str, str], Skill] = {}
    for skill, verb in SKILLS:
        if not _is_generated(skill, verb):
            continue
        if (skill, verb) in PLANNED:
            skills[skill, verb] = partial(_planned, course, SKILLS[skill, verb], PLANNED[skill, verb])
        else:
            skills[skill, verb] = _bound(part_stage if skill in JOINTED else object_stage, course)
    return skills


def _bound(carry_out: Callable[[KitchenEnv, Stage, Course], Iterator[Array]], course: Course) -> Skill:
    def skill(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
        try:
            yield from carry_out(env, stage, course)
        finally:
            course.label = AT_REST

    return skill


def _planned(course: Course, skill: Skill, kind: int, env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    try:
        yield from course.labelled(skill(env, stage), kind)
    finally:
        course.label = AT_REST
