"""Tidy cabinets and drawers."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    DrawerClosed,
    GripperFar,
    NearFixture,
    Not,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch_in_turn
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BY_SINK = AllOf(
    ObjectTouches("cleaner", "counter"),
    NearFixture("cleaner", "sink", within=0.35, to_corner=True),
    GripperFar("cleaner"),
)

ORGANIZE_CLEANING_SUPPLIES = Task(
    name="OrganizeCleaningSupplies",
    summary="The cleaner stands on the counter, 35 cm from a corner of the sink at most, the cabinet is shut.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("cab", "cabinet", near="sink"), counter_near("sink")),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("cleaner", ("cleaner",), in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("distr_counter_1", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.3))),
        ObjectSpec("distr_counter_2", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right")),
    ),
    goal=AllOf(*_BY_SINK.parts, DoorsClosed("cab")),
    stages=(
        Stage("doors", "open", "cab"),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="cleaner",
            until=_BY_SINK,
            text="put the {cleaner} on the counter beside the sink",
        ),
        Stage("doors", "close", "cab"),
    ),
    instruction="Take the {cleaner} out of the cabinet, stand it on the counter beside the sink and close the cabinet.",
    paraphrases=(
        "The {cleaner} belongs next to the sink; it is in the cabinet, which you leave shut.",
        "Open the cabinet for the {cleaner}, put that by the sink and shut the cabinet.",
        "Get ready to clean: the cabinet's {cleaner} stands right beside the sink, the cabinet is closed.",
        "Move the {cleaner} out of the cabinet to the side of the sink, and leave the cabinet as it was, closed.",
    ),
)


_UTENSILS = ("utensil1", "utensil2")
# Published shares are of the slide's range, of which full travel is 0.55.
_PARTLY_OUT = InitialOpenness("drawer", 0.49, 0.55)


def _put_away(name: str) -> AllOf:
    return AllOf(ObjectInside(name, "drawer"), Not(ObjectTouchesAnyCounter(name)), GripperFar(name))


def _into_drawer(name: str) -> Stage:
    return Stage("pick_place", "place", "drawer", object=name, until=_put_away(name))


DRAWER_UTENSIL_SORT = Task(
    name="DrawerUtensilSort",
    summary="Both utensils are in the drawer, off the counter, the gripper away from them.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer", size=(0.4, 0.2))),
    robot_start=RobotStart("drawer", beside=True),
    objects=tuple(
        ObjectSpec(name, ("utensil",), on_counter("drawer", (width, 0.35)), graspable=True)
        for name, width in zip(_UTENSILS, (0.3, 0.5), strict=True)
    ),
    goal=AllOf(*(part for name in _UTENSILS for part in _put_away(name).parts)),
    stages=(Stage("drawers", "open", "drawer"), *map(_into_drawer, _UTENSILS)),
    instruction="Open the drawer to the {side} and put {utensil1+utensil2} from the counter into it.",
    paraphrases=(
        "Tidy the counter: {utensil1+utensil2} belong in the closed drawer to your {side}.",
        "Pull the {side} drawer out and lay both utensils in it.",
        "The two utensils on the counter go into the drawer to the {side}, which has to be opened.",
        "Put the {utensil1} and the {utensil2} away in the {side} drawer.",
    ),
)

_BREAKFAST = ("cereal", "jam", "syrup_bottle", "honey_bottle")
_ITEMS = ("breakfast_item1", "breakfast_item2")

PLACE_BREAKFAST_ITEMS_AWAY = Task(
    name="PlaceBreakfastItemsAway",
    summary="Both things from breakfast are in the cabinet, the gripper away from them.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("cabinet", "cabinet_with_door", near="dining_counter"),
    ),
    robot_start=RobotStart("dining_counter", at_object="breakfast_item1"),
    objects=(
        *(
            ObjectSpec(name, _BREAKFAST, before_stool((width, 0.25)), graspable=True)
            for name, width in zip(_ITEMS, (0.3, 0.6), strict=True)
        ),
        ObjectSpec(
            "distr_dining1",
            ("any",),
            Placement("dining_counter", size=(1.0, 0.5), pos=(0.0, 1.0)),
            graspable=True,
            exclude=_BREAKFAST,
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*(ObjectInside(name, "cabinet") for name in _ITEMS), *map(GripperFar, _ITEMS)),
    stages=fetch_in_turn(_ITEMS, "dining_counter", "cabinet", along=True),
    instruction="Put the {breakfast_item1} and the {breakfast_item2} from the dining counter into the open cabinet.",
    paraphrases=(
        "Breakfast is over: {breakfast_item1} and {breakfast_item2} go back into the cabinet.",
        "Clear the dining counter of {breakfast_item1} and {breakfast_item2}; the cabinet for them is open.",
        "Carry the {breakfast_item1} to the cabinet, then the {breakfast_item2}.",
        "The open cabinet is where {breakfast_item1} and {breakfast_item2} are kept.",
    ),
)

SNACK_SORTING = Task(
    name="SnackSorting",
    summary="The bar is in the bowl, the drawer is shut.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec(
            "bar", ("bar",), Placement("drawer", size=(0.2, 0.25), pos=(None, -0.75)), graspable=True, max_height=0.1
        ),
        ObjectSpec(
            "dist",
            ("receptacle", "tool", "utensil"),
            Placement("drawer", size=(0.3, 0.3), pos=(None, 1.0)),
            max_height=0.1,
        ),
        ObjectSpec(
            "bowl",
            ("bowl",),
            on_counter("drawer", (0.15, 0.1), offset=(0.0, 0.075), margin=0.0, ensure_inside=False),
            graspable=True,
        ),
    ),
    initial=(_PARTLY_OUT,),
    goal=AllOf(ObjectOn("bar", "bowl"), DrawerClosed("drawer", at_most=0.05)),
    stages=(Stage("pick_place", "place", "bowl", object="bar"), Stage("drawers", "close", "drawer")),
    instruction="Put the bar from the drawer into the bowl on the counter and close the drawer.",
    paraphrases=(
        "The snack in the open drawer belongs in the bowl; shut the drawer afterwards.",
        "Take the bar out of the drawer into the bowl, then push the drawer in.",
        "The bowl on the counter should hold the bar, and the drawer should be closed.",
        "Sort the bar into the bowl and leave no drawer open.",
    ),
)

UTENSIL_SHUFFLE = Task(
    name="UtensilShuffle",
    summary="Both utensils are in the drawer, the condiment is not, nothing of them on a counter, the gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), FixtureSpec("cab", "cabinet", near="drawer")),
    robot_start=RobotStart("cab"),
    objects=(
        *(ObjectSpec(name, ("utensil",), in_cabinet("cab", (0.5, 0.35)), graspable=True) for name in _UTENSILS),
        ObjectSpec("condiment", ("condiment_bottle",), in_cabinet("cab", (1.0, 0.2), pos=(0.0, 0.0)), graspable=True),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0), _PARTLY_OUT),
    goal=AllOf(
        *(part for name in _UTENSILS for part in _put_away(name).parts), Not(ObjectInside("condiment", "drawer"))
    ),
    stages=tuple(map(_into_drawer, _UTENSILS)),
    instruction="Move {utensil1+utensil2} from the cabinet into the open drawer; the {condiment} stays.",
    paraphrases=(
        "Utensils belong in the drawer: take both of them out of the cabinet.",
        "Put the cabinet's utensils into the drawer that is open, and leave the {condiment} where it is.",
        "From the cabinet to the drawer with {utensil1+utensil2}.",
        "The drawer should hold {utensil1+utensil2}; they are in the cabinet with the {condiment}.",
    ),
)

TASKS = (DRAWER_UTENSIL_SORT, ORGANIZE_CLEANING_SUPPLIES, PLACE_BREAKFAST_ITEMS_AWAY, SNACK_SORTING, UTENSIL_SHUFFLE)
