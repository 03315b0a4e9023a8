"""Tasks whose goals have memory, declared for tests alone."""

from __future__ import annotations

from robocasa_lerobot.envs.predicates import Goal, StepsWhile, UnderWater
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, OnCounter, Placement, RobotStart
from robocasa_lerobot.envs.tasks.task import Stage, Task

UNDER_SPOUT = Placement("sink", size=(0.02, 0.02), pos=(0.0, 0.0), ensure_inside=False)
WASHED = StepsWhile(UnderWater("obj", "sink"), 25)


def by_the_sink(goal: Goal, *stages: Stage, runs: bool = False) -> Task:
    """A head of lettuce in the sink under the spout, a sponge on the counter; the water runs at first, or not."""
    return Task(
        name="WashLettuce",
        summary="What the goal says.",
        fixtures=(FixtureSpec("sink", "sink"),),
        robot_start=RobotStart("sink"),
        objects=(
            ObjectSpec("obj", ("lettuce",), UNDER_SPOUT),
            ObjectSpec("sponge", ("sponge",), OnCounter("sink", loc="left_right", size=(0.30, 0.30))),
        ),
        initial=(Water("sink", runs),),
        goal=goal,
        stages=stages or (Stage("levers", "on", "sink", part="handle"),),
        instruction="Wash the {obj}.",
    )
