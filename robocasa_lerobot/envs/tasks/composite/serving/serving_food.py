"""Serve food."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    GripperTouches,
    Never,
    ObjectOn,
    ObjectTouches,
    OnBurner,
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
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, in_cabinet, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SERVED = ObjectOn("vegetable", "plate")
_BACK = OnBurner("vegetable_container", "stove", within=0.08)

PAN_TRANSFER = Task(
    name="PanTransfer",
    summary=(
        "The vegetable is on the plate and was never touched by the gripper, the pan is back on a burner, the "
        "gripper away from it."
    ),
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.3, 0.4))),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "vegetable_container",
            ("pan",),
            on_burner(SampleRegion(name="any", height=(0.7, 1.2)), size_m=0.05, rotation=HANDLE_TO_FRONT),
            graspable=True,
        ),
        ObjectSpec("vegetable", ("vegetable",), Placement(object="vegetable_container"), properties=("cookable",)),
        ObjectSpec("plate", ("plate",), on_counter("stove", (0.3, 0.3), loc="left_right")),
        ObjectSpec(
            "dstr_dining",
            ("any",),
            Placement("counter", size=(0.3, 0.2), pos=(0.5, 0.5)),
            exclude=("plate", "pan", "vegetable"),
        ),
    ),
    goal=AllOf(
        _SERVED,
        ObjectTouches("vegetable_container", "stove"),
        _BACK,
        GripperFar("vegetable_container"),
        Never(GripperTouches("vegetable")),
    ),
    stages=(
        Stage("pick_place", "pick", "stove", object="vegetable_container"),
        Stage(
            "pick_place",
            "pour",
            "plate",
            object="vegetable_container",
            until=_SERVED,
            text="pour the {vegetable} out of the pan onto the plate",
        ),
        Stage(
            "pick_place",
            "place",
            "stove",
            object="vegetable_container",
            until=AllOf(_BACK, GripperFar("vegetable_container")),
        ),
    ),
    instruction="Pick up the pan, pour the {vegetable} onto the plate and set the pan down on the stove again.",
    paraphrases=(
        "Serve the {vegetable} from the pan on the plate, and return the pan to a burner.",
        "Tilt the pan over the plate so that the {vegetable} slides out; then the pan goes back to the stove.",
        "Without touching the {vegetable}, get it out of the pan onto the plate. Leave the pan on the stove.",
        "The {vegetable} is done: empty the pan onto the plate beside the stove and put it back.",
    ),
)

*_PAN_CARRIED, _PAN_PUT = fetch("obj_container", "stove", "dining_table")

SERVE_STEAK = Task(
    name="ServeSteak",
    summary="The steak lies on the plate, the pan stands on the dining counter, the gripper away from the steak.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "counter", near="stool", size=(0.75, 0.2)),
    ),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "obj_container",
            ("pan",),
            Placement(
                "stove",
                region=SampleRegion(name="any", height=(0.7, 1.2)),
                size=(0.05, 0.05),
                rotation=HANDLE_TO_FRONT,
                ensure_inside=False,
            ),
            graspable=True,
        ),
        ObjectSpec("obj", ("steak",), Placement(object="obj_container"), graspable=True),
        ObjectSpec("plate", ("plate",), before_stool((0.5, 0.35), counter="dining_table", pos=("ref", -1.0))),
        ObjectSpec(
            "dstr_dining",
            ("mug", "cup"),
            before_stool((0.5, 0.25), counter="dining_table", pos=("ref", -1.0), offset=(0.0, 0.1)),
            graspable=True,
        ),
    ),
    goal=AllOf(ObjectOn("obj", "plate"), ObjectTouches("obj_container", "dining_table"), GripperFar("obj")),
    stages=(*_PAN_CARRIED, _PAN_PUT, Stage("pick_place", "place", "plate", object="obj")),
    instruction="Carry the pan with the steak from the stove to the dining counter and put the steak on the plate.",
    paraphrases=(
        "Serve the steak: its pan goes on the dining counter, and the steak goes from there on the plate.",
        "Bring the steak in its pan to the dining counter, then lay it on the plate.",
        "The plate at the dining counter waits for the steak that lies in the pan on the stove; bring that pan along.",
        "Set the pan down on the dining counter and move the steak out of it onto the plate.",
    ),
)

_DESSERTS = ("dessert1", "dessert2")


def _at_front(**more: object) -> Placement:
    region = SampleRegion(top_size=(0.9, 0.4))
    return Placement("counter", region=region, size=(1.0, 0.4), pos=(0.0, -1.0), **more)  # type: ignore[arg-type]


DESSERT_UPGRADE = Task(
    name="DessertUpgrade",
    summary="Both desserts lie on the tray, the gripper away from it.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.4)),),
    robot_start=RobotStart("counter", at_object="receptacle"),
    objects=(
        ObjectSpec("receptacle", ("tray",), _at_front(rotation=(0.0, 0.0))),  # else plates hardly find room beside it
        *(
            ObjectSpec(
                name, ("sweets",), _at_front(reuse_region_from="receptacle", try_to_place_in="plate"), graspable=True
            )
            for name in _DESSERTS
        ),
    ),
    goal=AllOf(*(ObjectOn(name, "receptacle") for name in _DESSERTS), GripperFar("receptacle")),
    stages=tuple(Stage("pick_place", "place", "receptacle", object=name) for name in _DESSERTS),
    instruction="Move the {dessert1} and the {dessert2} from their plates to the tray.",
    paraphrases=(
        "Serve the desserts on the tray: {dessert1} and {dessert2}.",
        "The {dessert1} and the {dessert2} look better on the tray than on plates; put them there.",
        "Take both desserts off the plates and lay them on the tray.",
        "The tray should have the {dessert1} on it, and the {dessert2} too.",
    ),
)


def _one_each(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn("food1", first), ObjectOn("food2", second))


_BOWLS = ("receptacle1", "receptacle2")

PLACE_FOOD_IN_BOWLS = Task(
    name="PlaceFoodInBowls",
    summary="Both bowls stand on the counter, each with one of the two foods in it, the gripper away from the food.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab")),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("receptacle1", ("bowl",), in_cabinet("cab", (0.4, 0.4), pos=(-1.0, -1.0)), graspable=True),
        ObjectSpec(
            "receptacle2", ("bowl",), in_cabinet("cab", (0.4, 0.4), pos=(1.0, -1.0)), graspable=True, repeats=True
        ),
        ObjectSpec("food1", ("food",), on_counter("cab", (0.6, 0.3)), graspable=True),
        ObjectSpec("food2", ("food",), on_counter("cab", (0.6, 0.3)), graspable=True),
        ObjectSpec("distr_counter", ("any",), on_counter("cab", (0.5, 0.2), pos=("ref", 1.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(
        AnyOf(_one_each(*_BOWLS), _one_each(*reversed(_BOWLS))),
        *(ObjectTouches(bowl, "counter") for bowl in _BOWLS),
        GripperFar("food1"),
        GripperFar("food2"),
    ),
    stages=(
        *(Stage("pick_place", "place", "counter", object=bowl) for bowl in _BOWLS),
        Stage("pick_place", "place", "receptacle1", object="food1"),
        Stage("pick_place", "place", "receptacle2", object="food2"),
    ),
    instruction="Set the cabinet's two bowls on the counter, and put {food1} into one, {food2} into the other.",
    paraphrases=(
        "The {food1} and the {food2} need a bowl each; the bowls are in the cabinet.",
        "Set the cabinet's two bowls on the counter, then fill one with the {food1}, the other with the {food2}.",
        "Serve {food1} and {food2} in separate bowls out of the cabinet.",
        "Bowls down from the cabinet, {food1} into the one, {food2} into the other.",
    ),
)


_FOR_DRINKING = ("alcohol", "cup")

ALCOHOL_SERVING_PREP = Task(
    name="AlcoholServingPrep",
    summary="Bottle and cup stand on the dining counter, the gripper away from them.",
    fixtures=(
        FixtureSpec("cab", "cabinet_double_door"),
        FixtureSpec("dining_table", "dining_counter", size=(0.75, 0.2)),
        FixtureSpec("sink", "sink"),
    ),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("alcohol", ("alcohol",), in_cabinet("cab", (0.5, 0.2), pos=(-0.6, -1.0)), graspable=True),
        ObjectSpec("cup", ("cup", "mug"), in_cabinet("cab", (0.5, 0.2), pos=(0.6, -1.0)), graspable=True),
        ObjectSpec("decoration", ("decoration",), Placement("dining_table", size=(0.3, 0.3), pos=(0.0, 0.0))),
        ObjectSpec(
            "distr_counter",
            ("vegetable", "fruit", "sweets", "dairy"),
            Placement("dining_table", size=(0.3, 0.3), pos=(-1.0, -1.0)),
        ),
        ObjectSpec(
            "distr_sink", ("any",), Placement("sink", size=(0.25, 0.25), pos=(0.0, 1.0)), properties=("washable",)
        ),
    ),
    goal=AllOf(*(ObjectTouches(name, "dining_table") for name in _FOR_DRINKING), *map(GripperFar, _FOR_DRINKING)),
    stages=(Stage("doors", "open", "cab"), *fetch_in_turn(_FOR_DRINKING, "cab", "dining_table")),
    instruction="Open the cabinet and bring its {alcohol} and its {cup} to the dining counter with the {decoration}.",
    paraphrases=(
        "Serve a drink: {alcohol} and {cup} are in the closed cabinet and belong on the dining counter.",
        "The dining counter, where the {decoration} is, should also have the cabinet's {alcohol} and {cup}.",
        "Take the {alcohol} out of the cabinet to the dining counter, then the {cup}.",
        "Carry {alcohol} and {cup} from behind the cabinet's doors over to the dining counter.",
    ),
)

PREPARE_SOUP_SERVING = Task(
    name="PrepareSoupServing",
    summary="The ladle is in the pot, the cabinet is shut.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("cab", "cabinet_with_door", near="stove"),
        counter_near("stove"),
    ),
    robot_start=RobotStart("cab"),
    choices=(Choice("burner", of="stove"),),
    objects=(
        ObjectSpec(
            "ladle",
            ("ladle",),
            in_cabinet("cab", (0.5, 0.2), rotation=(-np.pi / 8, np.pi / 8)),
            graspable=True,
        ),
        ObjectSpec(
            "pot",
            ("pot",),
            on_burner(SampleRegion(name="{burner}")),
            graspable=True,
        ),
        ObjectSpec("bowl1", ("bowl",), on_counter("stove", (0.4, 0.4), loc="left_right"), graspable=True),
    ),
    goal=AllOf(ObjectOn("ladle", "pot"), DoorsClosed("cab")),
    stages=(
        Stage("doors", "open", "cab"),
        Stage("pick_place", "place", "pot", object="ladle"),
        Stage("doors", "close", "cab"),
    ),
    instruction="Take the ladle out of the cabinet, put it into the pot on the stove, and close the cabinet.",
    paraphrases=(
        "The soup in the pot is to be served: fetch the ladle from the cabinet into it and shut the cabinet.",
        "Open the cabinet, lay the ladle into the pot, and leave the cabinet closed.",
        "The pot on the stove needs the ladle that is in the cabinet; close the cabinet afterwards.",
        "Move the ladle from the cabinet to the pot and shut the cabinet's door.",
    ),
)

TASKS = (ALCOHOL_SERVING_PREP, DESSERT_UPGRADE, PAN_TRANSFER, PLACE_FOOD_IN_BOWLS, PREPARE_SOUP_SERVING, SERVE_STEAK)
