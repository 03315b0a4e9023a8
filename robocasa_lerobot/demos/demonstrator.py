"""Demonstrators: carry out the stages that a task declares, through the action interface of a policy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.motion_style import PLAIN, MotionStyle, give_motion_style
from robocasa_lerobot.demos.skills import SKILLS, Skill, SkillError
from robocasa_lerobot.demos.stages import StageLog, carry_out
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import stages_of
from robocasa_lerobot.errors import UserError

__all__ = ["SkillError", "can_demonstrate", "demonstrate"]


def can_demonstrate(task: Task) -> bool:
    """Whether every stage of a task has a skill."""
    return all((stage.skill, stage.verb) in SKILLS for stage in stages_of(task))


def check_demonstrable(names: Iterable[str]) -> None:
    """Check that tasks exist, and that the demonstrator can solve them.

    Raises:
        UnknownNameError: no task of that name.
        UserError: a task has a stage that no skill carries out yet.
    """
    lacking = [name for name in names if not can_demonstrate(get_task(name))]
    if lacking:
        able = [name for name in task_names() if can_demonstrate(get_task(name))]
        raise UserError(
            f"no demonstrator yet for {', '.join(lacking)}. It can solve {', '.join(able)}; for the others, record "
            "demonstrations by hand, or evaluate a policy that was trained on RoboCasa365's."
        )


def demonstrate(
    env: KitchenEnv,
    style: MotionStyle = PLAIN,
    log: StageLog | None = None,
    skills: Mapping[tuple[str, str], Skill] | None = None,
    *,
    midway: bool = False,
) -> Iterator[Array]:
    """Actions (12,), stored order, for the episode that `env` is in, one per control step.

    Each action is computed from the state that the env is in when it is asked for, so the caller must step the env
    with it before asking for the next. It ends after the last stage, with the arm held still from then on. `style`
    says how it is carried out; `log` tells which stage each action belongs to, and what came of them; `skills` are
    those that do it, the demonstrator's own if None. `midway` says that somebody else has begun the episode.

    Raises:
        UnknownNameError: a stage needs a skill that does not exist.
        SkillError: a stage is not done after all its attempts.
    """
    gripper = -1.0
    give_motion_style(env, style)
    for step in carry_out(env, StageLog() if log is None else log, skills, midway=midway):
        gripper = float(step[-1])
        yield style.carry_out(step)
    while True:
        yield action(gripper=gripper)
