"""Prepare snacks."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, ForEach, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_AWAY_M = 0.15
_DIP = ("cucumber", "carrot", "bowl")
_FRUITS = ("fruit1", "fruit2")


def _onto(name: str, target: str) -> Stage:
    return Stage("pick_place", "place", target, object=name)


def _at_front(size: tuple[float, float], top_size: tuple[float, float], **more: object) -> Placement:
    return Placement("counter", region=SampleRegion(top_size=top_size), size=size, pos=(0.0, -1.0), **more)  # type: ignore[arg-type]


def _on_board(name: str, group: str) -> ObjectSpec:
    start = _at_front((0.6, 0.3), (0.6, 0.6), reuse_region_from="container")
    return ObjectSpec(name, (group,), start, graspable=True)


BREAD_AND_CHEESE = Task(
    name="BreadAndCheese",
    summary="Bread and cheese lie on the cutting board, the gripper away from the bread.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.6, 0.6)),),
    robot_start=RobotStart("counter", at_object="container"),
    objects=(
        ObjectSpec("container", ("cutting_board",), _at_front((0.6, 0.5), (0.6, 0.6))),
        _on_board("obj", "bread"),
        _on_board("obj2", "cheese"),
    ),
    goal=AllOf(ObjectOn("obj", "container"), ObjectOn("obj2", "container"), GripperFar("obj")),
    stages=(_onto("obj", "container"), _onto("obj2", "container")),
    instruction="Put the {obj} and the {obj2} on the cutting board.",
    paraphrases=(
        "Bread and cheese both belong on the cutting board.",
        "Lay first the {obj} and then the {obj2} on the board.",
        "Make a snack ready: {obj} and {obj2} go onto the cutting board.",
        "The cutting board lacks the {obj} and the {obj2} beside it.",
    ),
)

CEREAL_AND_BOWL = Task(
    name="CerealAndBowl",
    summary="Cereal and bowl stand on the counter, the cabinet is shut.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab")),
    robot_start=RobotStart("cab"),
    choices=(Choice("cereal_side", {"left": {}, "right": {}}),),
    objects=(
        ObjectSpec(
            "cereal", ("boxed_food",), in_cabinet("cab", (0.3, 0.3), pos=("{cereal_side}", -1.0)), graspable=True
        ),
        ObjectSpec("bowl", ("bowl",), in_cabinet("cab", (0.5, 0.5), pos=("-{cereal_side}", -1.0)), graspable=True),
        ObjectSpec("milk", ("milk",), on_counter("cab", (0.5, 0.3), pos=(0.0, 0.0)), graspable=True),
        ObjectSpec("distr_counter", ("any",), on_counter("cab", (1.0, 0.3), pos=(0.0, 1.0))),
    ),
    goal=AllOf(ObjectTouches("cereal", "counter"), ObjectTouches("bowl", "counter"), DoorsClosed("cab")),
    stages=(
        Stage("doors", "open", "cab"),
        _onto("cereal", "counter"),
        _onto("bowl", "counter"),
        Stage("doors", "close", "cab"),
    ),
    instruction=(
        "Open the cabinet, bring the {cereal} and the bowl to the counter where the milk stands, and close the cabinet."
    ),
    paraphrases=(
        "For breakfast, put the {cereal} and the bowl out by the milk, and leave the cabinet shut.",
        "Milk is there; add the {cereal} and the bowl from the cabinet above it, then shut the doors.",
        "Take {cereal} and bowl out of the closed cabinet down to the counter; shut it again.",
        "The counter should get the cabinet's {cereal} and its bowl. Close the doors after that.",
    ),
)

MAKE_FRUIT_BOWL = Task(
    name="MakeFruitBowl",
    summary="Both fruits are in the bowl, the cabinet is shut.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab", size=(0.6, 0.4))),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec(
            "bowl",
            ("bowl",),
            Placement(
                "counter",
                region=SampleRegion(ref="cab", loc="nn", top_size=(0.6, 0.4)),
                size=(0.8, 0.4),
                pos=("ref", -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec("fruit1", ("fruit",), in_cabinet("cab", (0.5, 0.2), pos=(-0.5, -1.0)), graspable=True),
        ObjectSpec("fruit2", ("fruit",), in_cabinet("cab", (0.5, 0.2), pos=(0.5, -1.0)), graspable=True),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cab", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    goal=AllOf(*(ObjectOn(name, "bowl") for name in _FRUITS), DoorsClosed("cab")),
    stages=(
        Stage("doors", "open", "cab"),
        *(_onto(name, "bowl") for name in _FRUITS),
        Stage("doors", "close", "cab"),
    ),
    instruction="Open the cabinet, put the {fruit1} and the {fruit2} from it into the bowl and close the cabinet.",
    paraphrases=(
        "Make a bowl of fruit from the {fruit1} and the {fruit2} in the cabinet, which is shut in the end.",
        "The bowl should hold the cabinet's {fruit1} and {fruit2}; close the doors after taking them.",
        "Fetch {fruit1} and {fruit2} out of the closed cabinet for the bowl below, then shut it.",
        "Fill the bowl on the counter with both fruits of the cabinet and close that.",
    ),
)

VEGGIE_DIP_PREP = Task(
    name="VeggieDipPrep",
    summary="Cucumber, carrot and bowl are on the tray, the gripper 15 cm away from each.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.6)),),
    robot_start=RobotStart("counter", at_object="tray"),
    objects=(
        ObjectSpec("tray", ("tray",), _at_front((0.3, 0.5), (0.9, 0.6))),
        *(
            ObjectSpec(name, (name,), _at_front((0.8, 0.5), (0.9, 0.6), reuse_region_from="tray"), graspable=True)
            for name in ("cucumber", "carrot")
        ),
        ObjectSpec("bowl", ("bowl",), _at_front((0.8, 0.6), (0.9, 0.6), reuse_region_from="tray"), graspable=True),
    ),
    goal=AllOf(*(ObjectOn(name, "tray") for name in _DIP), *(GripperFar(name, _AWAY_M) for name in _DIP)),
    stages=tuple(
        Stage(
            "pick_place",
            "place",
            "tray",
            object=name,
            until=AllOf(ObjectOn(name, "tray"), GripperFar(name, _AWAY_M)),
        )
        for name in _DIP
    ),
    instruction="Put the cucumber, the carrot and the bowl on the tray.",
    paraphrases=(
        "Make a platter of vegetables with dip: cucumber, carrot and bowl all go on the tray.",
        "The tray should carry the carrot, the cucumber and the bowl that lie around it.",
        "Load the tray with the cucumber and the carrot, then with the bowl.",
        "Gather cucumber, carrot and bowl on the tray.",
    ),
)

YOGURT_DELIGHT_PREP = Task(
    name="YogurtDelightPrep",
    summary="The yogurt and all the fruit are on the counter, the gripper away from each.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab")),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("yogurt", ("yogurt",), in_cabinet("cab", (0.5, 0.3)), graspable=True),
        ObjectSpec("fruit", ("fruit",), in_cabinet("cab", (0.5, 0.2)), count=(1, 3), graspable=True, repeats=True),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(
        ObjectTouches("yogurt", "counter"),
        ForEach("fruit", lambda name: ObjectTouches(name, "counter")),
        GripperFar("yogurt"),
        ForEach("fruit", GripperFar),
    ),
    stages=(_onto("yogurt", "counter"), EachStage("fruit", lambda name: (_onto(name, "counter"),))),
    instruction="Bring the yogurt and {fruit} from the cabinet down to the counter.",
    paraphrases=(
        "Prepare a yogurt with fruit: put the yogurt and {fruit} out on the counter.",
        "All the fruit in the cabinet and the yogurt belong on the counter.",
        "Clear the open cabinet of the yogurt and of {fruit}, onto the counter.",
        "The counter should have the cabinet's yogurt on it, and {fruit} too.",
    ),
)

TASKS = (BREAD_AND_CHEESE, CEREAL_AND_BOWL, MAKE_FRUIT_BOWL, VEGGIE_DIP_PREP, YOGURT_DELIGHT_PREP)
