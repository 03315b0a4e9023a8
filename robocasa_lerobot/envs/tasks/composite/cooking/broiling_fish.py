"""Broil fish: get it ready, into the oven and out of it."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    PartWithin,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import PartAt, Water
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
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ON_RACK = ObjectTouches("obj", "oven", part="{rack}")
_STEPS = 10  # that the fish lies in the shut oven in a row

OVEN_BROIL_FISH = Task(
    name="OvenBroilFish",
    summary="The fish lies on the rack that is named, the oven is shut; both have been so for half a second.",
    fixtures=(FixtureSpec("oven", "oven"), counter_near("oven")),
    needs=("oven",),
    robot_start=RobotStart("counter", at_object="obj"),
    choices=(Choice("rack", of="oven"),),
    objects=(ObjectSpec("obj", ("fish",), on_counter("oven", (1.0, 0.4), try_to_place_in="plate"), graspable=True),),
    initial=(InitialOpenness("oven", 1.0, 1.0), PartAt("oven", "{rack}", (1.0, 1.0))),
    goal=AllOf(
        _ON_RACK,
        DoorsClosed("oven"),
        StepsWhile(AllOf(_ON_RACK, DoorsClosed("oven")), _STEPS, consecutive=True, label="fish_shut_in"),
    ),
    stages=(
        Stage("pick_place", "place", "oven", object="obj", part="{rack}", until=AllOf(_ON_RACK, GripperFar("obj"))),
        Stage("racks", "push", "oven", part="{rack}"),
        Stage("doors", "lift_shut", "oven"),
    ),
    instruction="Put the fish from its plate on the {rack} rack of the oven, push the rack in and close the oven.",
    paraphrases=(
        "The fish is to be broiled: onto the oven's {rack} rack with it, then rack and door shut.",
        "Lay the fish on the {rack} rack that stands out of the oven, and shut it up in there.",
        "Load the open oven with the fish from the plate, slide its {rack} rack back and close the door.",
        "Get the fish from the counter into the oven, which is to be closed after that.",
    ),
)

PREPARE_BROILING_STATION = Task(
    name="PrepareBroilingStation",
    summary="The tongs lie on a counter, 30 cm from the plate at most, the plate stands there too, the gripper away.",
    fixtures=(
        FixtureSpec("oven", "oven"),
        FixtureSpec("counter_oven", "counter", near="oven"),
        FixtureSpec("counter_items", "counter"),
    ),
    needs=("oven",),
    robot_start=RobotStart("counter_items", at_object="tongs"),
    objects=(
        ObjectSpec(
            "tongs",
            ("tongs",),
            Placement("counter_items", size=(0.2, 0.4), pos=(-1.0, -1.0)),
            scale=(1.0, 1.0, 1.5),
        ),
        ObjectSpec("plate", ("plate",), on_counter("oven", (0.5, 0.5), counter="counter_oven")),
    ),
    initial=(InitialOpenness("oven", 1.0, 1.0),),
    goal=AllOf(
        Near("tongs", "plate", 0.3),
        ObjectTouchesAnyCounter("tongs"),
        ObjectTouchesAnyCounter("plate"),
        GripperFar("tongs"),
    ),
    stages=fetch(
        "tongs",
        "counter_items",
        "counter_oven",
        until=AllOf(Near("tongs", "plate", 0.3), ObjectTouchesAnyCounter("tongs"), GripperFar("tongs")),
    ),
    instruction="Bring the tongs to the counter by the oven and put them down close to the plate.",
    paraphrases=(
        "Get ready to broil: the tongs belong next to the plate by the oven.",
        "The plate by the oven lacks its tongs; lay them beside it.",
        "Pick up the tongs, go over to the plate near the open oven, and put them down there.",
        "Tongs and plate should lie side by side on the counter at the oven.",
    ),
)

REMOVE_BROILED_FISH = Task(
    name="RemoveBroiledFish",
    summary="The fish is on the plate, the gripper away from it.",
    fixtures=(FixtureSpec("oven", "oven"), counter_near("oven")),
    needs=("oven",),
    robot_start=RobotStart("oven", beside=True, clearance=0.2, setback=0.1),
    objects=(
        ObjectSpec(
            "fish",
            ("fish",),
            Placement("oven", region=SampleRegion(name="rack0"), size=(0.4, 0.4), pos=(0.0, -1.0)),
            graspable=True,
            scale=0.9,
        ),
        ObjectSpec("plate", ("plate",), on_counter("oven", (0.5, 0.5))),
    ),
    goal=AllOf(ObjectOn("fish", "plate"), GripperFar("fish")),
    stages=(
        Stage("doors", "open", "oven"),
        Stage("racks", "pull", "oven", part="rack0"),
        *fetch("fish", "oven", "plate"),
    ),
    instruction="Open the oven, pull its rack out and put the fish on the plate on the counter.",
    paraphrases=(
        "The fish in the oven is done: serve it on the plate.",
        "Take the broiled fish off the rack of the closed oven and lay it on the plate.",
        "The plate on the counter waits for the fish that is in the oven.",
        "Get the fish out of the oven and onto the plate.",
    ),
)

_WASHED = StepsWhile(UnderWater("obj", "sink"), 25, label="fish_washed")

WASH_FISH = Task(
    name="WashFish",
    summary="The fish was under running water for 25 steps and lies on the tray, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "obj",
            ("fish",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.2, 0.25),
                pos=(0.0, -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.5, 0.3), pos=(0.5, 1.0)),
            properties=("fridgable",),
            exclude=("fish",),
        ),
        ObjectSpec("tray", ("oven_tray",), on_counter("sink", (1.0, 0.5), loc="left_right", rotation=(0.0, 0.0))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), Water("sink", on=True)),
    goal=AllOf(_WASHED, ObjectOn("obj", "tray"), GripperFar("obj")),
    stages=(
        Stage("pick_place", "pick", "fridge", object="obj"),
        Stage("navigation", "drive", "sink", object="obj"),
        Stage("pick_place", "hold", "sink", object="obj", until=_WASHED, text="hold the fish under the faucet"),
        Stage("pick_place", "place", "tray", object="obj"),
    ),
    instruction=("Take the fish from the fridge, hold it under the running water for a moment and put it on the tray."),
    paraphrases=(
        "Wash the fish from the fridge under the faucet, then lay it on the tray beside the sink.",
        "Carry the fridge's fish to the sink, rinse it well, and onto the tray with it.",
        "The water runs: rinse the fish that is in the open fridge and leave it on the tray.",
        "A clean fish should lie on the tray; now it is in the fridge.",
    ),
)

_IN_TOASTER_OVEN = ObjectTouches("obj", "toaster_oven", part="{rack}")
_HOTTEST = PartWithin("toaster_oven", "knob_temp", low=0.95, label="highest")

TOASTER_OVEN_BROIL_FISH = Task(
    name="ToasterOvenBroilFish",
    summary="The fish lies on the rack that is named, the toaster oven is shut, its temperature highest.",
    fixtures=(FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven")),
    robot_start=RobotStart("counter", at_object="obj"),
    choices=(Choice("rack", of="toaster_oven"),),
    objects=(
        ObjectSpec(
            "obj",
            ("fish",),
            on_counter("toaster_oven", (0.5, 0.4), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
    ),
    initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "{rack}", (1.0, 1.0))),
    goal=AllOf(_IN_TOASTER_OVEN, DoorsClosed("toaster_oven"), _HOTTEST),
    stages=(
        Stage(
            "pick_place",
            "place",
            "toaster_oven",
            object="obj",
            part="{rack}",
            until=AllOf(_IN_TOASTER_OVEN, GripperFar("obj")),
        ),
        Stage("racks", "push", "toaster_oven", part="{rack}"),
        Stage("doors", "lift_shut", "toaster_oven"),
        Stage("knobs", "highest", "toaster_oven", part="knob_temp", until=_HOTTEST),
    ),
    instruction=(
        "Put the fish on the {rack} of the toaster oven, push it in, close the door and turn the temperature all the "
        "way up."
    ),
    paraphrases=(
        "Broil the fish in the toaster oven, on its {rack}, at the highest temperature.",
        "The fish from the plate goes on the {rack}; then shut the toaster oven and give it full heat.",
        "Load the toaster oven with the fish: {rack} in, door shut, temperature to the stop.",
        "Lay the fish in the toaster oven, close that, and set its heat to the maximum.",
    ),
)

TASKS = (OVEN_BROIL_FISH, PREPARE_BROILING_STATION, REMOVE_BROILED_FISH, TOASTER_OVEN_BROIL_FISH, WASH_FISH)
