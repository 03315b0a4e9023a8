"""Sort ingredients."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Near, ObjectOn, ObjectTouches, When
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_RAW = ("meat_ingredient", "vegetable_ingredient", "random_ingredient")
_BACK = Stage("navigation", "drive", "fridge")


def _raw(name: str, group: str) -> ObjectSpec:
    region = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
    start = Placement("fridge", region=region, size=(0.5, 0.2), pos=(0.0, -1.0))
    return ObjectSpec(name, (group,), start, graspable=True, exclude=("shrimp",), repeats=True)


SEPARATE_RAW_INGREDIENTS = Task(
    name="SeparateRawIngredients",
    summary="Meat from the fridge is on the cutting board, vegetables are in the bowl, the gripper away from all.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    choices=(Choice("kind", {"meat": {"_target": "cutting_board"}, "vegetable": {"_target": "vegetable_bowl"}}),),
    objects=(
        _raw("meat_ingredient", "meat"),
        _raw("vegetable_ingredient", "vegetable"),
        _raw("random_ingredient", "{kind}"),
        ObjectSpec(
            "cutting_board",
            ("cutting_board",),
            on_counter("fridge", (0.4, 0.4), pos=(0.0, -1.0), rotation=(0.0, 0.0), margin=0.0),
        ),
        ObjectSpec(
            "vegetable_bowl",
            ("bowl",),
            on_counter("fridge", (0.8, 0.4), pos=(0.0, -1.0), reuse_region_from="cutting_board"),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        ObjectOn("meat_ingredient", "cutting_board"),
        ObjectOn("vegetable_ingredient", "vegetable_bowl"),
        When(
            "kind",
            {
                "meat": ObjectOn("random_ingredient", "cutting_board"),
                "vegetable": ObjectOn("random_ingredient", "vegetable_bowl"),
            },
        ),
        *map(GripperFar, _RAW),
    ),
    stages=(
        *fetch("meat_ingredient", "fridge", "cutting_board"),
        _BACK,
        *fetch("vegetable_ingredient", "fridge", "vegetable_bowl"),
        _BACK,
        *fetch("random_ingredient", "fridge", "{_target}"),
    ),
    instruction=(
        "Of {meat_ingredient+vegetable_ingredient+random_ingredient} in the fridge, put meat on the cutting board and "
        "vegetables into the bowl."
    ),
    paraphrases=(
        "Keep what is raw apart: the fridge's meat on the board, its vegetables in the bowl.",
        "Sort {meat_ingredient+vegetable_ingredient+random_ingredient}: the bowl takes vegetables, the board meat.",
        "Empty the fridge of its ingredients, meat onto the cutting board, vegetables into the bowl on the counter.",
        "No vegetable belongs on the cutting board and no meat in the bowl; all three ingredients are in the fridge.",
    ),
)

_PAIRED = {"jam": "bread_plate", "cereal": "milk"}


def _paired(name: str) -> AllOf:
    return AllOf(Near(name, _PAIRED[name], 0.3), ObjectTouches(name, "dining_counter"), GripperFar(name))


def _by_cabinet(name: str, x: float | str, again: str = "") -> ObjectSpec:
    start = on_counter("cabinet", (0.3, 0.3), pos=(x, -1.0), reuse_region_from=again)
    return ObjectSpec(name, (name,), start, graspable=True)


SORT_BREAKFAST_INGREDIENTS = Task(
    name="SortBreakfastIngredients",
    summary="On the dining counter, the jam is by the bread and the cereal by the milk, 30 cm apart at most.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
    ),
    robot_start=RobotStart("counter", at_object="jam"),
    objects=(
        ObjectSpec("milk", ("milk",), before_stool((0.2, 0.2), stool="stool1")),
        ObjectSpec("bowl_milk", ("bowl",), before_stool((0.6, 0.35), stool="stool1", pos=("ref", -0.5))),
        ObjectSpec("bread_plate", ("plate",), before_stool((0.3, 0.3), stool="stool2")),
        ObjectSpec("bread", ("bread", "sandwich_bread"), Placement(object="bread_plate")),
        _by_cabinet("jam", "ref"),
        _by_cabinet("cereal", 0.0, again="jam"),
    ),
    goal=AllOf(*_paired("jam").parts, *_paired("cereal").parts),
    stages=(
        *fetch("jam", "counter", "dining_counter", until=_paired("jam")),
        Stage("navigation", "drive", "cereal"),
        *fetch("cereal", "counter", "dining_counter", until=_paired("cereal")),
    ),
    instruction="Set the jam beside the plate with the {bread} on the dining counter, and the cereal beside the milk.",
    paraphrases=(
        "Breakfast comes in pairs: jam next to the {bread}, cereal next to the milk, on the dining counter.",
        "Carry the jam to the plate of {bread} and the cereal to the milk; both start on the counter.",
        "On the dining counter, the milk wants the cereal close by, and the {bread} the jam.",
        "Sort the breakfast: whatever goes with bread to the bread, whatever goes with milk to the milk.",
    ),
)

TASKS = (SEPARATE_RAW_INGREDIENTS, SORT_BREAKFAST_INGREDIENTS)
