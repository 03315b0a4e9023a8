"""Steam food in the microwave."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    OnBurner,
    Once,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_burner, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

STEAM_IN_MICROWAVE = Task(
    name="SteamInMicrowave",
    summary="The vegetable is in the bowl, the bowl in the microwave, shut and running, the gripper off its button.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("microwave", "microwave"), counter_near("sink")),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.35, 0.4), loc="left_right"), graspable=True),
        ObjectSpec(
            "vegetable",
            ("vegetable",),
            Placement("sink", size=(0.3, 0.2), pos=(0.0, 1.0)),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("distr_counter_0", ("any",), on_counter("microwave", (0.5, 0.3), offset=(0.0, 0.3))),
        ObjectSpec("distr_counter_1", ("any",), on_counter("sink", (0.5, 0.5), loc="left_right")),
    ),
    initial=(Water("sink", on=False), InitialOpenness("microwave", 0.9, 1.0)),
    goal=AllOf(
        ObjectOn("vegetable", "bowl"),
        ObjectInside("bowl", "microwave"),
        DoorsClosed("microwave"),
        StateIs("microwave", "on"),
        GripperFarFromPart("microwave", "start_button"),
    ),
    stages=(
        Stage("pick_place", "place", "bowl", object="vegetable"),
        Stage("pick_place", "pick", "counter", object="bowl"),
        Stage("navigation", "drive", "microwave", object="bowl"),
        Stage("pick_place", "place", "microwave", object="bowl"),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction=(
        "Take the {vegetable} out of the sink into the bowl, carry the bowl to the microwave, put it in, shut the door "
        "and start it."
    ),
    paraphrases=(
        "Steam the {vegetable} from the sink: into the bowl with it, the bowl into the microwave, door shut, start.",
        "The washed {vegetable} goes into the bowl, and the bowl into the running microwave.",
        "Cook the {vegetable} that lies in the sink in the microwave, in the bowl.",
        "Fill the bowl with the {vegetable} out of the basin, then close it in the microwave and press start.",
    ),
)

_WATER = StateIs("sink", "water_on")
_WAS_ON = Once(_WATER, label="water_was_on")
_RINSED = Once(AllOf(ObjectInside("vegetable1", "sink"), _WATER), label="vegetable1_rinsed")
_ON_KNOB = OnBurner("pot", "stove", burner="{knob}", within=0.08)

MULTISTEP_STEAMING = Task(
    name="MultistepSteaming",
    summary=(
        "The vegetable was in the sink while water ran, which is off now; it is in the pot, the pot on the burner that "
        "is named."
    ),
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("stove", "stove"),
        counter_near("sink"),
        counter_near("stove", name="stove_counter"),
    ),
    robot_start=RobotStart("sink"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "pot",
            ("pot",),
            on_counter("stove", (0.6, 0.5), loc="left_right", counter="stove_counter"),
            graspable=True,
        ),
        ObjectSpec("vegetable1", ("vegetable",), on_counter("sink", (0.3, 0.3), loc="left_right"), graspable=True),
        ObjectSpec("obj", ("any",), on_counter("sink", (0.4, 0.4), loc="left_right", pos=("ref", None))),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(_WAS_ON, _RINSED, StateIs("sink", "water_on", value=False), _ON_KNOB, ObjectOn("vegetable1", "pot")),
    stages=(
        Stage("levers", "on", "sink", part="handle", until=_WAS_ON),
        Stage("pick_place", "place", "sink", object="vegetable1", until=AllOf(_RINSED, GripperFar("vegetable1"))),
        Stage("levers", "off", "sink", part="handle"),
        Stage("pick_place", "pick", "sink", object="vegetable1"),
        Stage("navigation", "drive", "pot", object="vegetable1"),
        Stage("pick_place", "place", "pot", object="vegetable1"),
        Stage("pick_place", "place", "stove", object="pot", part="{knob}", until=AllOf(_ON_KNOB, GripperFar("pot"))),
    ),
    instruction=(
        "Turn on the faucet, rinse the {vegetable1} in the sink, turn the faucet off, put the {vegetable1} into the "
        "pot beside the stove, and the pot on the {knob} burner."
    ),
    paraphrases=(
        "Rinse the {vegetable1} under running water, close the faucet, and set it in the pot on the {knob} burner.",
        "Water on, {vegetable1} into the sink, water off; then into the pot with it, and that on the {knob} burner.",
        "The {vegetable1} must be rinsed in the sink before it goes in the pot, which belongs on the {knob} burner.",
        "Prepare to steam the rinsed {vegetable1}: it lies in the pot over the {knob} burner, the faucet is off.",
    ),
)

_PAN_OVER_FLAME = OnBurner("pan", "stove", burner="{knob}", lit=True)

STEAM_FISH = Task(
    name="SteamFish",
    summary="The fish lies in the pan, the pan over the lit burner, the gripper away from both.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("counter", at_object="fish_container"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "pan",
            ("pan",),
            on_burner(size_m=0.03, rotation=HANDLE_TO_FRONT),
            scale=(1.0, 1.0, 1.25),
            filled="soy_sauce",
        ),
        ObjectSpec(
            "fish",
            ("fish",),
            on_counter("stove", (0.4, 0.4), loc="left_right", try_to_place_in="plate"),
            graspable=True,
        ),
    ),
    goal=AllOf(
        _PAN_OVER_FLAME,
        ObjectOn("fish", "pan"),
        StateIs("stove", "{knob}_on"),
        GripperFar("fish"),
        GripperFar("pan"),
    ),
    stages=(
        Stage("pick_place", "place", "pan", object="fish"),
        Stage(
            "knobs",
            "on",
            "stove",
            part="knob_{knob}",
            until=AllOf(StateIs("stove", "{knob}_on"), GripperFar("fish"), GripperFar("pan")),
        ),
    ),
    instruction="Put the fish from its plate into the pan with the soy sauce and turn on the burner under the pan.",
    paraphrases=(
        "Steam the fish in soy sauce: into the pan with it, then light the {knob} burner.",
        "The fish belongs in the sauce in the pan, and the {knob} burner below should be on.",
        "Lay the fish in the pan on the stove and heat that.",
        "From the plate into the pan with the fish; switch on the {knob} burner.",
    ),
)

TASKS = (MULTISTEP_STEAMING, STEAM_FISH, STEAM_IN_MICROWAVE)
