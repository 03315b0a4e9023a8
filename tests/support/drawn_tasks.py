"""Tasks whose objects, sides, stages and goals are drawn, declared for tests; some are simpler than the benchmark's."""

from __future__ import annotations

from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    GripperFar,
    Not,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    When,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, StagesWhen, Task

SINK = get_task("PickPlaceCounterToSink")
FRUIT = replace(SINK.objects[0], name="fruit", groups=("fruit",), count=(1, 3), repeats=True)


def in_sink(name: str) -> AllOf:
    return AllOf(ObjectInBasin(name, "sink"), GripperFar(name))


FRUITS = Task(
    name="WashFruitColander",
    summary="All fruits lie in the sink.",
    fixtures=SINK.fixtures,
    robot_start=SINK.robot_start,
    objects=(FRUIT,),
    goal=ForEach("fruit", in_sink),
    stages=(EachStage("fruit", lambda name: (Stage("pick_place", "place", "sink", object=name),)),),
    instruction="Put {fruit} into the sink.",
    paraphrases=("{fruit_count} of them", "{fruit+fruit}"),
)
CUBES = Choice("n", {"2": {"how_many": "both"}, "3": {"how_many": "all three"}})
BLENDER = get_task("PickPlaceCounterToBlender")
ICE = Task(
    name="AddIceCubes",
    summary="All ice cubes are in the blender.",
    fixtures=BLENDER.fixtures,
    robot_start=RobotStart("blender"),
    initial=BLENDER.initial,
    choices=(CUBES,),
    objects=(
        ObjectSpec(
            "bowl", ("bowl",), Placement("counter", region=SampleRegion("blender", "left_right"), size=(0.5, 0.35))
        ),
        ObjectSpec("ice_cube", ("ice_cube",), Placement(object="bowl"), count="{n}", scale=0.8, repeats=True),
    ),
    goal=ForEach("ice_cube", lambda name: AllOf(ObjectInside(name, "blender"), GripperFar(name))),
    stages=(EachStage("ice_cube", lambda name: (Stage("pick_place", "place", "blender", object=name),)),),
    instruction="Move {how_many} ice cubes from the bowl into the blender.",
)  # fmt: skip
IN_CABINET = Placement("cab", size=(0.2, 0.3), pos=("{side}", -0.3), margin=0.0)
PANTRY = Task(
    name="RestockPantry",
    summary="It stays as it is.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), FixtureSpec("counter", "counter", near="cab")),
    robot_start=RobotStart("cab"),
    choices=(Choice("side", {"left": {"other": "right"}, "right": {"other": "left"}}),),
    objects=(
        ObjectSpec("here", ("canned_food",), IN_CABINET),
        ObjectSpec("there", ("can",), replace(IN_CABINET, pos=("-{side}", 0.3))),
    ),
    goal=Not(ObjectInBasin("here", "cab")),
    stages=(Stage("doors", "open", "cab"),),
    instruction="It is on the {side}, the other on the {other}.",
)
FOOD = {"garlic": "knife", "broccoli": "knife", "carrot": "peeler", "cucumber": "peeler"}
TOOLS = Task(
    name="CuttingToolSelection",
    summary="The right tool lies on the board.",
    fixtures=SINK.fixtures,
    robot_start=SINK.robot_start,
    choices=(Choice("food_kind", {food: {"_tool": tool} for food, tool in FOOD.items()}),),
    objects=(
        ObjectSpec("food", ("{food_kind}",), SINK.objects[0].start, graspable=True),
        ObjectSpec("knife", ("knife",), SINK.objects[0].start),
        ObjectSpec("peeler", ("peeler",), SINK.objects[0].start),
    ),
    goal=When("_tool", {tool: ObjectOn(tool, "food") for tool in ("knife", "peeler")}),
    stages=(StagesWhen("_tool", {
        "knife": (Stage("pick_place", "place", "food", object="knife"),),
        "peeler": (Stage("pick_place", "place", "food", object="peeler"), Stage("navigation", "drive", "sink")),
    }),),
    instruction="Lay the tool for the {food} on it.",
)  # fmt: skip
DRAWN = {task.name: task for task in (FRUITS, ICE, PANTRY, TOOLS)}
