"""Carrying out the stages of a task: one after the other, again where one has failed or come undone."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from robocasa_lerobot.demos.motion import OPEN, Array, action, base_pose
from robocasa_lerobot.demos.planning.base_room import wrap
from robocasa_lerobot.demos.planning.errors import LostError
from robocasa_lerobot.demos.skills import SKILLS, Skill, SkillError
from robocasa_lerobot.demos.skills.common import stage_done, wait_for, wait_for_stage
from robocasa_lerobot.demos.skills.fold import fold_arm
from robocasa_lerobot.demos.skills.navigation import drive_to
from robocasa_lerobot.demos.skills.pick_place.carrying.torso import move_torso
from robocasa_lerobot.demos.skills.pick_place.heaps import uppermost
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates.logic import Goal, terms_by_name
from robocasa_lerobot.envs.predicates.objects import ObjectOn
from robocasa_lerobot.envs.tasks.conditions import must_never, stage_condition, without_gripper
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import UnknownNameError

ATTEMPTS = 3  # of a stage; skills try several grasps in each
PATIENCE_STEPS = 40  # after a skill, for what falls, swings and settles; as long again after each step that counted
LAST_PATIENCE_STEPS = 100  # the same after the last one
HELD_STEPS = 15  # consecutive ones in which a goal holds end an episode (docs/robocasa.md, section 4)
# Of the base from where it should stand to use a fixture, at the first attempt and at others.
FAR_OFF_M, FAR_OFF_RAD = (0.35, 0.15), 0.6
_AS_IT_IS = ("navigation", "pick_place")  # skills that begin with the arm as the stage before has left it
_TOLD = ("skill", "verb", "target", "object", "part", "to")  # of a stage, to whoever reads the file


@dataclass
class StageOutcome:
    """What came of a stage: how often it was tried, whether it was done when it was left, and why not.

    `skipped` is a stage that was done before anybody touched it.
    """

    attempts: int = 0
    done: bool = False
    skipped: bool = False
    reason: str = ""


@dataclass
class StageLog:
    """How far an episode has come, for whoever records it.

    Attributes:
        current: index of the stage that the next action belongs to.
        outcomes: of each stage.
    """

    current: int = 0
    outcomes: list[StageOutcome] = field(default_factory=list)

    def close(self, env: KitchenEnv) -> None:
        """Note of the stage that was on when the episode ended whether it was done."""
        if self.outcomes and _still_holds(env, self.current):
            self.outcomes[self.current].done, self.outcomes[self.current].reason = True, ""

    def table(self, stages: tuple[Stage, ...]) -> list[dict[str, Any]]:
        """Stages and outcomes in plain values, for `ep_meta`."""
        return [
            {**{name: getattr(stage, name) for name in _TOLD}, **asdict(outcome)}
            for stage, outcome in zip(stages, self.outcomes, strict=True)
        ]


def carry_out(
    env: KitchenEnv,
    log: StageLog,
    skills: Mapping[tuple[str, str], Skill] | None = None,
    *,
    midway: bool = False,
) -> Iterator[Array]:
    """Actions (12,), stored order, that do all stages; it ends when the goal has held for a while.

    A stage that is done already is left out. One that fails is tried again; if the one before it has come undone
    meanwhile (an object has slipped off), that one comes first. Where the task's goal does not hold in the end, it goes
    on with the first stage that has to do with the terms that fail; what was knocked out of a vessel, which no stage is
    about, is put back. So it goes where what was done comes undone while the arm is still. Of what lies heaped in a
    vessel, the upper is taken first.

    Args:
        env: in the episode.
        log: tells which stage is on.
        skills: what carries out a stage, by its skill and verb; None takes the demonstrator's.
        midway: somebody else has begun: the arm may be in any posture, and is folded where a first attempt fails.

    Raises:
        UnknownNameError: a stage needs a skill that does not exist.
        SkillError: a stage is not done after all its attempts, something has happened that never must, or nobody knows
            why the goal does not hold.
    """
    gripper = OPEN

    def still() -> Array:
        return action(gripper=gripper)

    for step in _carry_out(env, log, SKILLS if skills is None else skills, still, midway=midway):
        gripper = float(step[-1])
        yield step


def _carry_out(
    env: KitchenEnv,
    log: StageLog,
    skills: Mapping[tuple[str, str], Skill],
    still: Callable[[], Array],
    *,
    midway: bool,
) -> Iterator[Array]:
    stages, goal = env.declaration.stages, env.declaration.goal
    # A task of one stage begins where it is done, unless that has been changed.
    led_away = len(stages) > 1 or (env.initial_noise is not None and env.initial_noise.moves_base)
    log.outcomes = [StageOutcome() for _ in stages]
    back_in = StageOutcome()
    index = 0
    while True:
        if index == len(stages):
            if _only_the_hand_is_near(env):
                yield from fold_arm(env)
            undone, fallen_out = _lacking(env, back_in)
            if undone is None and fallen_out is None:
                if (yield from _stays(env, goal, still)):
                    return
                _check_never(env, log.outcomes[-1])
                if goal.evaluate(env.scene, env.data, {}):
                    continue
                undone, fallen_out = (0, None) if len(stages) == 1 else _lacking(env, back_in)
            if fallen_out is not None:
                log.current = len(stages) - 1
                yield from _attempt(env, fallen_out, back_in, skills)
                continue
            if undone is None:
                raise SkillError(back_in.reason or _unexplained(env))
            index, log.outcomes[undone].done = undone, False
            _check_attempts(env, index, log.outcomes[index])
        log.current, outcome = index, log.outcomes[index]
        if len(stages) > 1 and stage_done(env, stages[index]):
            outcome.skipped, outcome.done, outcome.reason = outcome.attempts == 0, True, ""
            index += 1
            continue
        if (led_away or (midway and outcome.attempts > 0)) and stages[index].skill not in _AS_IT_IS:
            yield from fold_arm(env)
            yield from move_torso(env, 0.0, OPEN)
            yield from _stand_before(env, stages[index], FAR_OFF_M[min(outcome.attempts, 1)])
        turn = uppermost(env, stages, index)
        if log.outcomes[turn].attempts >= ATTEMPTS:
            turn = index
        log.current, outcome = turn, log.outcomes[turn]
        yield from _attempt(env, stages[turn], outcome, skills)
        _check_never(env, outcome)
        outcome.done = stage_done(env, stages[turn])
        outcome.reason = "" if outcome.done else outcome.reason
        if turn != index:
            continue
        if outcome.done:
            index += 1
        elif index > 0 and not _still_holds(env, index - 1):
            index -= 1  # the stage that it rests on has come undone
            log.outcomes[index].done = False
            _check_attempts(env, index, log.outcomes[index], cause=outcome.reason)
        else:
            _check_attempts(env, index, outcome)


def stage_from(env: KitchenEnv, earlier: int) -> int:
    """The stage that a step of somebody else's belongs to: the first, from an earlier step's on, that is not done."""
    stages, stage = env.declaration.stages, earlier
    while stage < len(stages) - 1 and stage_done(env, stages[stage]):
        stage += 1
    return stage


def _stays(env: KitchenEnv, goal: Goal, still: Callable[[], Array]) -> Generator[Array, None, bool]:
    """Stand still until a goal holds, for what settles and what time does, and then for as long as it must hold.

    Returns whether it has; it is given up when nothing has come nearer to it for some steps.
    """
    yield from wait_for(env, goal, still, LAST_PATIENCE_STEPS)
    for _ in range(HELD_STEPS):
        if not goal.evaluate(env.scene, env.data, {}):
            return False
        yield still()
    return True


def _unexplained(env: KitchenEnv) -> str:
    """What is said where all stages are done, and the goal does not hold."""
    terms: dict[str, bool] = {}
    env.declaration.goal.evaluate(env.scene, env.data, terms)
    missing = ", ".join(f"`{name}`" for name, holds in terms.items() if not holds)
    return f"all stages are done, but the goal does not hold; false are {missing or 'none'} of its terms"


def _stand_before(env: KitchenEnv, stage: Stage, most_m: float) -> Iterator[Array]:
    """Drive to where a robot stands to use the stage's fixture, if it is far off: an earlier stage has led it away.

    Skills that use fixtures go farther by themselves only a little.
    """
    if not stage.target or stage.target not in env.scene.roles:
        return
    stand, (base, yaw) = env.scene.place_before(stage.target), base_pose(env.data)
    turned = abs(wrap(stand.yaw - yaw))
    if np.hypot(stand.x - base[0], stand.y - base[1]) > most_m or turned > FAR_OFF_RAD:
        with contextlib.suppress(SkillError):
            yield from drive_to(env, stand.x, stand.y, stand.yaw)


def _attempt(
    env: KitchenEnv, stage: Stage, outcome: StageOutcome, skills: Mapping[tuple[str, str], Skill]
) -> Iterator[Array]:
    """One go at a stage with its skill, and a while of standing still after it; a failure is noted.

    Raises:
        UnknownNameError: it needs a skill that does not exist.
        LostError: what it needs lies where the robot cannot get it.
    """
    key = (stage.skill, stage.verb)
    if key not in skills:
        raise UnknownNameError("skill", " ".join(key), (" ".join(k) for k in skills))
    outcome.attempts += 1
    outcome.reason = "it is not done"
    gripper = -1.0
    try:
        for step in skills[key](env, stage):
            gripper = float(step[-1])
            yield step
    except LostError as error:
        outcome.reason = str(error)
        raise
    except SkillError as error:
        outcome.reason = str(error)
    yield from wait_for_stage(env, stage, lambda: action(gripper=gripper), PATIENCE_STEPS)


def _check_never(env: KitchenEnv, outcome: StageOutcome) -> None:
    """Give up where the goal cannot be reached any more: remembered failures cannot be undone."""
    for never in must_never(env.declaration.goal):
        if not never.holds(env.scene, env.data):
            outcome.reason = f"the goal is out of reach: `{never.name}` does not hold any more"
            raise SkillError(outcome.reason)


def _check_attempts(env: KitchenEnv, index: int, outcome: StageOutcome, cause: str = "") -> None:
    """Give up on a stage that has had all its attempts; `cause` is why it is to be done again, where it was done."""
    if outcome.attempts >= ATTEMPTS:
        stages = env.declaration.stages
        which = f"stage {index + 1} ({stages[index].skill} {stages[index].verb}): " if len(stages) > 1 else ""
        again = f"it came undone after {outcome.attempts} attempts" + (f", when {cause}" if cause else "")
        raise SkillError(f"{which}{outcome.reason or again}")


def _still_holds(env: KitchenEnv, index: int) -> bool:
    condition = without_gripper(stage_condition(env.declaration, env.declaration.stages[index]))
    return condition.evaluate(env.scene, env.data, {})


def _only_the_hand_is_near(env: KitchenEnv) -> bool:
    """Whether all that the goal still asks for is that the hand goes away: from what lies beside the last object."""
    goal = env.declaration.goal
    several = len(env.declaration.stages) > 1  # a single stage's skill has gone away as far as it can
    done = without_gripper(goal).evaluate(env.scene, env.data, {})
    return several and done and not goal.evaluate(env.scene, env.data, {})


def _lacking(env: KitchenEnv, back_in: StageOutcome) -> tuple[int | None, Stage | None]:
    """The stage that comes again where the goal does not hold, or the one that puts back what has fallen out."""
    undone = _undone(env)
    return undone, _fallen_out(env) if undone is None and back_in.attempts < ATTEMPTS else None


def _fallen_out(env: KitchenEnv) -> Stage | None:
    """A stage that puts back what the goal wants in or on an object where no stage puts it: it was there at first."""
    task = env.declaration
    wanted: dict[str, bool] = {}
    if len(task.stages) == 1 or task.goal.evaluate(env.scene, env.data, wanted):
        return None
    named = terms_by_name(task.goal, unwanted=False)
    failing = (term for name, terms in named.items() if wanted.get(name) is False for term in terms)
    fallen = next((term for term in failing if isinstance(term, ObjectOn)), None)
    return (
        None if fallen is None else Stage("pick_place", "place", fallen.receptacle, object=fallen.object, until=fallen)
    )


def _undone(env: KitchenEnv) -> int | None:
    """The first stage that the goal's failing terms belong to; None where the goal holds, or nobody knows.

    It has such a term itself; or else it puts an object down of which such a term tells, and that is not there: a goal
    may ask in one term for what two stages do, as for a pan on a lit burner.
    """
    task = env.declaration
    wanted: dict[str, bool] = {}
    if len(task.stages) == 1 or task.goal.evaluate(env.scene, env.data, wanted):
        return None
    failing = [term for name, terms in terms_by_name(task.goal).items() if wanted.get(name) is False for term in terms]
    objects = {getattr(term, "object", "") for term in failing}
    moved: int | None = None
    for index, stage in enumerate(task.stages):
        terms: dict[str, bool] = {}
        if stage_condition(task, stage).evaluate(env.scene, env.data, terms):
            continue
        if any(not held and wanted.get(name) is False for name, held in terms.items()):
            return index
        if moved is None and stage.verb in ("place", "place_upside_down") and stage.object in objects:
            moved = index
    return moved
