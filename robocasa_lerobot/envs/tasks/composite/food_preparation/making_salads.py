"""Make salads."""

from robocasa_lerobot.envs.predicates import StepsWhile, UnderWater
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_WASHED = StepsWhile(UnderWater("lettuce", "sink"), 25)

# A head of lettuce is wider than the gripper opens: its colander is carried.
WASH_LETTUCE = Task(
    name="WashLettuce",
    summary="The lettuce has been under running water for 25 steps in total.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("lettuce_container", ("colander",), on_counter("sink", (0.4, 0.5), loc="left_right")),
        ObjectSpec("lettuce", ("lettuce",), Placement(object="lettuce_container")),
    ),
    initial=(Water("sink", on=False),),
    goal=_WASHED,
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        Stage("pick_place", "hold", "sink", object="lettuce_container", until=_WASHED),
    ),
    instruction="Turn on the faucet and hold the lettuce under the water until it is washed.",
    paraphrases=(
        "Wash the lettuce that lies in the colander with running water.",
        "Let the water run over the lettuce in its colander for a while.",
        "The lettuce needs rinsing: open the faucet and bring the colander below it.",
        "Rinse the lettuce at the sink.",
    ),
)

TASKS = (WASH_LETTUCE,)
