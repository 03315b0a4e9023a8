"""Clear the dining counter, an island or a counter: what stands there goes elsewhere."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    ForEach,
    Goal,
    GripperFar,
    Near,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
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
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_CABINET_OPEN = InitialOpenness("cabinet", 0.9, 1.0)
_ELSEWHERE = AllOf(ObjectTouchesAnyCounter("bowl"), Not(ObjectTouches("bowl", "dining_table")))

BOWL_AND_CUP = Task(
    name="BowlAndCup",
    summary="The cup is in the bowl, the bowl on a counter that is not the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool", size=(0.5, 0.35)),
        FixtureSpec("counter", "counter", other_than=("dining_table",)),
    ),
    robot_start=RobotStart("dining_table", at_object="cup"),
    objects=(
        ObjectSpec(
            "cup",
            ("cup",),
            before_stool((0.5, 0.35), counter="dining_table"),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec(
            "bowl",
            ("bowl",),
            before_stool((0.5, 0.35), counter="dining_table", reuse_region_from="cup"),
            graspable=True,
            properties=("washable",),
        ),
    ),
    goal=AllOf(ObjectOn("cup", "bowl"), _ELSEWHERE, GripperFar("bowl")),
    stages=(
        Stage("pick_place", "place", "bowl", object="cup"),
        *fetch("bowl", "dining_table", "counter", until=AllOf(_ELSEWHERE, GripperFar("bowl"))),
    ),
    instruction="Put the cup into the bowl and carry the bowl from the dining counter to another counter.",
    paraphrases=(
        "Clear the dining counter: the cup goes into the bowl, the bowl onto a different counter.",
        "Bowl and cup should leave the dining counter together, the cup inside the bowl.",
        "Place the cup in the bowl, then take both to any other counter.",
        "Move the bowl with the cup in it off the dining counter, to a counter elsewhere.",
    ),
)


def _decoration(name: str, aside: float) -> ObjectSpec:
    region = SampleRegion(ref="cabinet")
    start = Placement("dining_table", region=region, size=(0.6, 0.3), pos=(0.0, -1.0), offset=(aside, 0.0))
    return ObjectSpec(name, ("decoration",), start, graspable=True, repeats=True)


CANDLE_CLEANUP = Task(
    name="CandleCleanup",
    summary="Both decorations are in the cabinet, which is shut.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_with_door"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool", size=(0.75, 0.2)),
    ),
    robot_start=RobotStart("dining_table", at_object="obj1"),
    objects=(
        _decoration("obj1", -0.05),
        _decoration("obj2", 0.05),
        ObjectSpec("distr_counter", ("any",), Placement("dining_table", size=(1.0, 0.3), pos=(0.0, 0.0))),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(_CABINET_OPEN,),
    goal=AllOf(ObjectInside("obj1", "cabinet"), ObjectInside("obj2", "cabinet"), DoorsClosed("cabinet")),
    stages=(
        *fetch("obj1", "dining_table", "cabinet"),
        Stage("navigation", "drive", "obj2"),
        *fetch("obj2", "dining_table", "cabinet"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put {obj1+obj2} from the dining counter into the open cabinet and close it.",
    paraphrases=(
        "Dinner is over: {obj1+obj2} belong in the cabinet, which should be shut then.",
        "Clear {obj1+obj2} off the dining counter, into the cabinet; close its doors.",
        "Store the decoration of the dining counter, {obj1+obj2}, in the cabinet and shut that.",
        "The cabinet takes {obj1+obj2} from the dining counter. Leave it closed.",
    ),
)

_CLUSTER = ("anchor_item", "item1", "item2")
_ON_TABLE = AllOf(*(ObjectTouches(name, "dining_table") for name in _CLUSTER))
_CLOSE = AllOf(*(Near(name, tuple(other for other in _CLUSTER if other != name), 0.3) for name in _CLUSTER))


def _at_far_edge(name: str, across: float) -> ObjectSpec:
    start = Placement("dining_table", size=(0.3, 0.3), pos=(across, 1.0))
    return ObjectSpec(name, ("mug", "bowl", "cup"), start, graspable=True, repeats=True)


def _to_anchor(name: str) -> tuple[Stage, ...]:
    there = AllOf(ObjectTouches(name, "dining_table"), Near(name, "anchor_item", 0.3), GripperFar(name, 0.15))
    return (
        Stage("pick_place", "pick", "dining_table", object=name),
        Stage("navigation", "drive", "anchor_item", object=name),
        Stage(
            "pick_place",
            "place",
            "dining_table",
            object=name,
            until=there,
            text=f"put the {{{name}}} beside the {{anchor_item}}",
        ),
    )


CLUSTER_ITEMS_FOR_CLEARING = Task(
    name="ClusterItemsForClearing",
    summary="All three stand on the dining counter, each 30 cm from another at most, the gripper 15 cm away from them.",
    fixtures=(FixtureSpec("dining_table", "dining_counter"),),
    robot_start=RobotStart("dining_table", at_object="item1"),
    choices=(Choice("anchor_side", {"left": {}, "right": {}}),),
    objects=(
        ObjectSpec(
            "anchor_item",
            ("plate", "pitcher", "glass_cup"),
            Placement("dining_table", size=(0.25, 0.25), pos=("{anchor_side}", -1.0)),
        ),
        _at_far_edge("item1", -0.2),
        _at_far_edge("item2", 0.0),
    ),
    goal=AllOf(_ON_TABLE, _CLOSE, *(GripperFar(name, 0.15) for name in _CLUSTER)),
    stages=(*_to_anchor("item1"), Stage("navigation", "drive", "item2"), *_to_anchor("item2")),
    instruction="Put {item1+item2} close to the {anchor_item} on the dining counter.",
    paraphrases=(
        "Gather the dishes: {item1+item2} should stand next to the {anchor_item}.",
        "So that they can be cleared together, move {item1+item2} to the {anchor_item}.",
        "The {anchor_item} stays where it is; bring {item1+item2} beside it.",
        "Make one group on the dining counter out of {anchor_item+item1+item2}, at the {anchor_item}.",
    ),
)


def _in_cabinet(name: str) -> Goal:
    return ObjectInside(name, "cabinet")


DRINKWARE_CONSOLIDATION = Task(
    name="DrinkwareConsolidation",
    summary="Every drink from the island is in the cabinet, the gripper away from each.",
    fixtures=(FixtureSpec("island", "island"), FixtureSpec("cabinet", "cabinet_with_door", near="island")),
    robot_start=RobotStart("island", at_object="obj_0"),
    objects=(
        ObjectSpec(
            "obj",
            ("drink",),
            Placement("island", region=SampleRegion(ref="cabinet"), size=(0.3, 0.4), pos=("ref", -1.0)),
            count=(1, 3),
            graspable=True,
            properties=("washable",),
            exclude=("wine",),
            repeats=True,
        ),
    ),
    initial=(_CABINET_OPEN,),
    goal=AllOf(ForEach("obj", _in_cabinet), ForEach("obj", GripperFar)),
    stages=(EachStage("obj", lambda name: fetch(name, "island", "cabinet")),),
    instruction="Carry {obj} from the island to the open cabinet and put everything inside.",
    paraphrases=(
        "The island should be clear: {obj} into the cabinet.",
        "Put {obj}, which stands on the island, away in the open cabinet.",
        "Collect the drinks on the island in the cabinet: {obj}.",
        "The cabinet near the island is for {obj}.",
    ),
)

FOOD_CLEANUP = Task(
    name="FoodCleanup",
    summary="All the food is in the cabinet, which is shut if it has doors, the gripper away from the food.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec(
            "food",
            ("fruit", "vegetable", "boxed_food"),
            on_counter("cabinet", (0.3, 0.3), offset=(0.05, 0.0)),
            count=(1, 3),
            graspable=True,
            repeats=True,
        ),
    ),
    initial=(_CABINET_OPEN,),
    goal=AllOf(ForEach("food", _in_cabinet), ForEach("food", GripperFar), DoorsClosed("cabinet")),
    stages=(
        EachStage("food", lambda name: (Stage("pick_place", "place", "cabinet", object=name),)),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put {food} from the counter into the cabinet, and close it if it has doors.",
    paraphrases=(
        "Clean up the food: {food} into the cabinet, and no open door left behind.",
        "Clear the counter of {food}; the cabinet is where it goes, shut afterwards.",
        "The cabinet takes {food}. Close whatever doors it has.",
        "Store the food on the counter, {food}, in the cabinet above and shut that.",
    ),
)

TASKS = (BOWL_AND_CUP, CANDLE_CLEANUP, CLUSTER_ITEMS_FOR_CLEARING, DRINKWARE_CONSOLIDATION, FOOD_CLEANUP)
