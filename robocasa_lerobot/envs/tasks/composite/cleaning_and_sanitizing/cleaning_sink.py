"""Clean the sink."""

from robocasa_lerobot.envs.predicates import AllOf, Once, StateIs
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_RUNS = StateIs("sink", "water_on")
_RINSED = AllOf(
    Once(AllOf(_RUNS, StateIs("sink", "left")), label="left_rinsed"),
    Once(
        AllOf(_RUNS, StateIs("sink", "left", value=False), StateIs("sink", "right", value=False)),
        label="center_rinsed",
    ),
    Once(AllOf(_RUNS, StateIs("sink", "right")), label="right_rinsed"),
)

RINSE_SINK_BASIN = Task(
    name="RinseSinkBasin",
    summary="Water has run with the spout to the left, in the middle and to the right.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(ObjectSpec("plate", ("plate",), on_counter("sink", (0.3, 0.3), loc="left_right")),),
    initial=(Water("sink", on=False), PartAt("sink", "spout", (0.5, 0.5))),
    goal=_RINSED,
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        Stage(
            "levers",
            "sweep",
            "sink",
            part="spout",
            until=_RINSED,
            text="swing the spout of the sink from one side to the other",
        ),
    ),
    instruction="Turn on the faucet and rinse the whole basin: left, middle and right, by turning the spout.",
    paraphrases=(
        "With the water running, point the spout to the left, the middle and the right of the sink.",
        "Rinse all of the sink with the faucet's spout.",
        "Open the tap and move its spout across the basin until each side was under the stream.",
        "Clean the basin with running water on both sides and in the middle.",
    ),
)

TASKS = (RINSE_SINK_BASIN,)
