"""Wash dishes: what is needed for it, and where dishes and supplies go, before and after."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    NearFixture,
    Not,
    ObjectInside,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OverBasin,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
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
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, StagesWhen, Task

_OPEN = InitialOpenness("cabinet", 0.9, 1.0)
_DRY = Water("sink", on=False)
_SUPPLIES = ("supply1", "supply2")


def _near_sink(name: str, counter: str, within: float) -> AllOf:
    return AllOf(NearFixture(name, "sink", within), ObjectTouches(name, counter), GripperFar(name))


def _put_near_sink(name: str, counter: str, within: float) -> Stage:
    text = f"put the {{{name}}} on the counter beside the sink"
    return Stage("pick_place", "place", counter, object=name, until=_near_sink(name, counter, within), text=text)


COLLECT_WASHING_SUPPLIES = Task(
    name="CollectWashingSupplies",
    summary="Both supplies stand on the counter, 20 cm from the sink at most, the gripper away from them.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("cabinet", "cabinet", near="sink"), counter_near("sink")),
    robot_start=RobotStart("cabinet"),
    objects=tuple(
        ObjectSpec(
            name, ("cleaner",), in_cabinet("cabinet", (0.3, 0.3), pos=(across, -0.9)), graspable=True, repeats=True
        )
        for name, across in zip(_SUPPLIES, (-0.5, 0.5), strict=True)
    ),
    initial=(_OPEN,),
    goal=AllOf(*(part for name in _SUPPLIES for part in _near_sink(name, "counter", 0.2).parts)),
    stages=tuple(_put_near_sink(name, "counter", 0.2) for name in _SUPPLIES),
    instruction="Take {supply1+supply2} out of the cabinet and put them on the counter, right beside the sink.",
    paraphrases=(
        "For the washing up, {supply1+supply2} should stand next to the sink.",
        "Get {supply1+supply2}, which are in the open cabinet, to the edge of the sink.",
        "Beside the sink there should be {supply1+supply2} from the cabinet.",
        "Collect what is needed to wash dishes at the sink: {supply1+supply2}.",
    ),
)


def _bring_dish(name: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "counter", object=name),
        Stage("navigation", "drive", "sink", object=name),
        _put_near_sink(name, "counter_sink", 0.15),
    )


PLACE_DISHES_BY_SINK = Task(
    name="PlaceDishesBySink",
    summary="Cup and bowl stand on the counter, 15 cm from the sink at most, the gripper away from them.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("stove", "stove"),
        counter_near("stove"),
        counter_near("sink", name="counter_sink"),
    ),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "dish0", ("cup",), on_counter("stove", (0.3, 0.3), loc="left_right", pos=("ref", -0.5)), graspable=True
        ),
        ObjectSpec(
            "dish1", ("bowl",), on_counter("stove", (0.6, 0.35), loc="left_right", pos=("ref", 0.0)), graspable=True
        ),
    ),
    initial=(_DRY,),
    goal=AllOf(*(part for name in ("dish0", "dish1") for part in _near_sink(name, "counter_sink", 0.15).parts)),
    stages=(*_bring_dish("dish0"), Stage("navigation", "drive", "stove"), *_bring_dish("dish1")),
    instruction="Carry the {dish0} and the {dish1} from the stove to the sink and set them down right beside it.",
    paraphrases=(
        "The dishes at the stove should stand next to the sink: the {dish0} and the {dish1}.",
        "Bring first the {dish0}, then the {dish1}, to the counter at the edge of the sink.",
        "Put the {dish0} and the {dish1}, now beside the stove, beside the sink instead.",
        "Before dishes are washed they wait by the sink; take the {dish0} and the {dish1} there.",
    ),
)

RETURN_WASHING_SUPPLIES = Task(
    name="ReturnWashingSupplies",
    summary="Both supplies are in the cabinet, which is shut if it has doors.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("cabinet", "cabinet", near="sink")),
    robot_start=RobotStart("sink"),
    objects=tuple(
        ObjectSpec(
            name,
            ("cleaner",),
            Placement("sink", size=(0.4, 0.3), pos=(None, 1.0)),
            graspable=True,
            repeats=True,
        )
        for name in _SUPPLIES
    ),
    initial=(_OPEN,),
    goal=AllOf(*(ObjectInside(name, "cabinet") for name in _SUPPLIES), DoorsClosed("cabinet")),
    stages=(
        *fetch("supply1", "sink", "cabinet"),
        Stage("navigation", "drive", "sink"),
        *fetch("supply2", "sink", "cabinet"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put {supply1+supply2} from the sink back into the cabinet and close it if it has doors.",
    paraphrases=(
        "The dishes are done: {supply1+supply2} go from the sink into the cabinet, which should be shut then.",
        "Return {supply1+supply2} to the cabinet, and leave no door open.",
        "Clear {supply1+supply2} out of the basin, into the cabinet, and shut that.",
        "The cabinet is where {supply1+supply2} belong; they are in the sink. Close any doors in the end.",
    ),
)

SORTING_CLEANUP = Task(
    name="SortingCleanup",
    summary="The mug is in the sink, the bowl in the cabinet, which is shut, the gripper away from the mug.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("cabinet", "cabinet_with_door", near="sink"),
        counter_near("sink", size=(0.5, 0.5)),
    ),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "mug",
            ("mug",),
            on_counter("sink", (0.2, 0.4), loc="left_right"),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec(
            "bowl",
            ("bowl",),
            on_counter("sink", (0.5, 0.5), loc="left_right"),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("distr_counter", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right", pos=("ref", 1.0))),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (np.inf, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(_OPEN,),
    goal=AllOf(ObjectInside("mug", "sink"), ObjectInside("bowl", "cabinet"), DoorsClosed("cabinet"), GripperFar("mug")),
    stages=(
        Stage("pick_place", "place", "sink", object="mug", until=AllOf(ObjectInside("mug", "sink"), GripperFar("mug"))),
        *fetch("bowl", "counter", "cabinet"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Put the mug into the sink and the bowl into the cabinet, then close the cabinet.",
    paraphrases=(
        "Sort the dishes: the mug is dirty and goes into the sink, the clean bowl into the cabinet. Shut the doors.",
        "Sink for the mug, cabinet for the bowl, and no open door at the end.",
        "The mug belongs in the basin; the bowl belongs in the cabinet, which should be shut after that.",
        "Clean up bowl and mug: the one behind the cabinet's doors, the other in the sink.",
    ),
)

_LEFT, _RIGHT = "basin0", "basin1"
_CUPS = ("cup", "mug", "glass_cup", "measuring_cup")


def _over(name: str, basin: str) -> AllOf:
    return AllOf(OverBasin(name, "sink", basin), GripperFar(name))


def _into(name: str, basin: str) -> Stage:
    side = {_LEFT: "left", _RIGHT: "right"}[basin]
    text = f"put the {{{name}}} into the {side} basin of the sink"
    return Stage("pick_place", "place", "sink", object=name, part=basin, until=_over(name, basin), text=text)


DIVIDE_BASINS = Task(
    name="DivideBasins",
    summary="One is in the left basin, what dries in the right one, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink_with_two_basins"), counter_near("sink")),
    robot_start=RobotStart("counter"),
    choices=(Choice("drying_basin", {_LEFT: {"drying_side": "left"}, _RIGHT: {"drying_side": "right"}}),),
    objects=(
        ObjectSpec(
            "obj_to_wash", _CUPS, on_counter("sink", (0.4, 0.4), loc="left_right", pos=("ref", -0.5)), graspable=True
        ),
        ObjectSpec(
            "obj_drying",
            _CUPS,
            Placement("sink", region=SampleRegion(name="{drying_basin}"), size=(0.4, 0.4), pos=(None, 1.0)),
            graspable=True,
        ),
    ),
    initial=(_DRY,),
    goal=AllOf(*_over("obj_to_wash", _LEFT).parts, *_over("obj_drying", _RIGHT).parts),
    stages=(
        StagesWhen("drying_basin", {_LEFT: (_into("obj_drying", _RIGHT),)}),
        _into("obj_to_wash", _LEFT),
    ),
    instruction=(
        "The right basin is for drying: the {obj_drying} in the {drying_side} basin belongs there. Put the "
        "{obj_to_wash} from the counter into the left basin."
    ),
    paraphrases=(
        "Left basin for the {obj_to_wash} from the counter, right basin for the {obj_drying} that is in the sink.",
        "Wash on the left, dry on the right: {obj_to_wash} into the left basin, {obj_drying} in the right one.",
        "See that the {obj_drying} is in the right basin, and put the {obj_to_wash} into the left one.",
        "Divide the sink: the {obj_drying} dries on the right, the {obj_to_wash} waits on the left.",
    ),
)


def _dish(name: str, group: str, size: tuple[float, float]) -> ObjectSpec:
    start = on_counter("sink", size, loc="left_right")
    return ObjectSpec(name, (group,), start, graspable=True, max_size=(0.2, 0.2, 0.15), repeats=True)


PRE_RINSE_STATION = Task(
    name="PreRinseStation",
    summary="One dish is in the left basin, the other in the right one, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink_with_two_basins"), counter_near("sink")),
    robot_start=RobotStart("counter"),
    choices=(
        Choice(
            "first",
            {
                "receptacle": {"_left": "receptacle", "_right": "stackable"},
                "stackable": {"_left": "stackable", "_right": "receptacle"},
            },
        ),
    ),
    objects=(_dish("left_obj", "{_left}", (0.5, 0.5)), _dish("right_obj", "{_right}", (0.4, 0.4))),
    initial=(_DRY,),
    goal=AllOf(*_over("left_obj", _LEFT).parts, *_over("right_obj", _RIGHT).parts),
    stages=(_into("left_obj", _LEFT), _into("right_obj", _RIGHT)),
    instruction="Put the {left_obj} into the left basin of the sink and the {right_obj} into the right one.",
    paraphrases=(
        "Before they are rinsed, dishes are sorted: {left_obj} to the left basin, {right_obj} to the right one.",
        "The left basin gets the {left_obj}, the right basin the {right_obj}.",
        "Divide the two dishes on the counter between the basins: {left_obj} left, {right_obj} right.",
        "Right basin: {right_obj}. Left basin: {left_obj}.",
    ),
)


def _in_basin(name: str, groups: tuple[str, ...], basin: str, *, graspable: bool = True) -> ObjectSpec:
    start = Placement("sink", region=SampleRegion(name=basin))
    return ObjectSpec(name, groups, start, graspable=graspable, repeats=True)


_CLEAN, _DIRTY = ("clean_item1", "clean_item2"), ("dirty_item1", "dirty_item2")


def _racked(name: str) -> AllOf:
    return AllOf(ObjectTouches(name, "dish_rack"), Not(ObjectTouchesAnyCounter(name)), GripperFar(name))


PLACE_ON_DISH_RACK = Task(
    name="PlaceOnDishRack",
    summary="Both clean dishes are on the dish rack, the dirty ones still in the left basin, the gripper away.",
    fixtures=(FixtureSpec("sink", "sink_with_two_basins"), FixtureSpec("dish_rack", "dish_rack")),
    robot_start=RobotStart("sink"),
    objects=(
        *(_in_basin(name, ("mug", "cup"), _RIGHT) for name in _CLEAN),
        _in_basin("dirty_item1", ("mug", "cup", "glass_cup"), _LEFT),
        _in_basin("dirty_item2", ("fork", "cup", "spoon"), _LEFT, graspable=False),
    ),
    initial=(_DRY,),
    goal=AllOf(
        *(part for name in _CLEAN for part in _racked(name).parts),
        *(part for name in _DIRTY for part in _over(name, _LEFT).parts),
    ),
    stages=tuple(Stage("pick_place", "place", "dish_rack", object=name, until=_racked(name)) for name in _CLEAN),
    instruction="Put both clean dishes from the right basin on the dish rack; leave those in the left basin alone.",
    paraphrases=(
        "The right basin's {clean_item1+clean_item2} are clean and belong on the dish rack.",
        "Move what is in the right basin to the dish rack, and nothing of what is in the left one.",
        "Let {clean_item1+clean_item2} out of the right basin dry on the rack. The left basin stays as it is.",
        "Dirty dishes stay on the left; {clean_item1+clean_item2} from the right go onto the rack.",
    ),
)

_RINSED = StepsWhile(UnderWater("obj", "sink"), 100, label="teapot_rinsed")
_IN_RACK = ObjectInside("obj", "dish_rack", margin=0.02)

RINSE_FRAGILE_ITEM = Task(
    name="RinseFragileItem",
    summary="The teapot was under running water for 100 steps and stands in the dish rack, the gripper away from it.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("dish_rack", "dish_rack"),
        FixtureSpec("stove", "stove"),
        counter_near("stove"),
    ),
    robot_start=RobotStart("counter", at_object="obj"),
    objects=(ObjectSpec("obj", ("teapot",), on_counter("stove", (0.6, 0.3), loc="left_right"), graspable=True),),
    initial=(Water("sink", on=True),),
    goal=AllOf(_RINSED, GripperFar("obj"), _IN_RACK),
    stages=(
        Stage("pick_place", "pick", "counter", object="obj"),
        Stage("navigation", "drive", "sink", object="obj"),
        Stage("pick_place", "hold", "sink", object="obj", until=_RINSED),
        Stage("pick_place", "place", "dish_rack", object="obj", until=AllOf(_IN_RACK, GripperFar("obj"))),
    ),
    instruction="Carry the teapot to the sink, hold it under the running water and stand it in the dish rack.",
    paraphrases=(
        "Rinse the teapot for five seconds and let it dry in the dish rack.",
        "The teapot beside the stove needs a rinse under the faucet, and then a place in the dish rack.",
        "Bring the teapot to the running water, let it be rinsed, and put it into the rack.",
        "With care: teapot under the stream, then into the dish rack.",
    ),
)

_UPSIDE_DOWN = ObjectTilt("mug", low=float(np.deg2rad(170.0)), label="upside_down")
_DRIES = AllOf(GripperFar("mug"), _UPSIDE_DOWN, ObjectTouches("mug", "cabinet"))

DRY_DRINKWARE = Task(
    name="DryDrinkware",
    summary="The mug stands upside down in the cabinet, the gripper away from it.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet", size=(0.3, 0.5))),
    robot_start=RobotStart("cabinet"),
    choices=(Choice("mug_side", {"left": {"_across": "-0.5"}, "right": {"_across": "0.5"}}),),
    objects=(
        ObjectSpec("mug", ("mug",), on_counter("cabinet", (0.5, 0.3), pos=("{_across}", -1.0)), graspable=True),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (np.inf, 0.2), pos=(0.0, 1.0))),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (np.inf, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(_OPEN,),
    goal=_DRIES,
    stages=(
        Stage("pick_place", "pick", "counter", object="mug"),
        Stage(
            "pick_place",
            "place_upside_down",
            "cabinet",
            object="mug",
            until=_DRIES,
            text="put the mug into the cabinet upside down",
        ),
    ),
    instruction="Pick up the mug and put it into the cabinet upside down.",
    paraphrases=(
        "The mug should stand on its rim in the open cabinet.",
        "Turn the mug over and set it down in the cabinet, so that it dries.",
        "Let the mug dry in the cabinet, bottom up.",
        "The mug from the counter goes into the cabinet with its opening down.",
    ),
)

TASKS = (
    COLLECT_WASHING_SUPPLIES,
    DIVIDE_BASINS,
    DRY_DRINKWARE,
    PLACE_DISHES_BY_SINK,
    PLACE_ON_DISH_RACK,
    PRE_RINSE_STATION,
    RETURN_WASHING_SUPPLIES,
    RINSE_FRAGILE_ITEM,
    SORTING_CLEANUP,
)
