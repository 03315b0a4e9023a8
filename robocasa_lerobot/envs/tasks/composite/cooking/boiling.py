"""Boil water and what goes into it."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectInBasin,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    PartWithin,
    StateIs,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, PartAt
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
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.composite.cooking.lids import (
    COVERED,
    COVERS,
    FRONT_BURNER,
    LID,
    ON_ITS_PAN,
    ON_LIT_BURNER,
    STOVE_AND_COUNTER,
    UNCOVERS,
    lid,
    on_plate,
    saucepan,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_LID, _HEATS = PartWithin("electric_kettle", "lid", high=0.01, label="closed"), StateIs("electric_kettle", "on")

START_ELECTRIC_KETTLE = Task(
    name="StartElectricKettle",
    summary="The lid of the electric kettle is shut, and it heats.",
    fixtures=(FixtureSpec("electric_kettle", "electric_kettle"),),
    robot_start=RobotStart("electric_kettle"),
    initial=(PartAt("electric_kettle", "lid", (1.0, 1.0)),),
    goal=AllOf(_LID, _HEATS),
    stages=(
        Stage("doors", "push_lid", "electric_kettle", part="lid", until=_LID),
        Stage("levers", "press", "electric_kettle", part="switch", until=_HEATS),
    ),
    instruction="Close the lid of the electric kettle and press its switch down.",
    paraphrases=(
        "Start the electric kettle, with its lid shut.",
        "Heat water in the kettle: lid down, switch down.",
        "The electric kettle stands open; close it and switch it on.",
        "Get the electric kettle going. It must be covered.",
    ),
)

FILL_KETTLE = Task(
    name="FillKettle",
    summary="The kettle stands in the sink, the gripper away from it.",
    fixtures=(FixtureSpec("sink", "sink"), FixtureSpec("cabinet", "cabinet_with_door", near="sink")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", ("kettle_non_electric",), in_cabinet("cabinet", (0.5, 0.3)), graspable=True),
        ObjectSpec(
            "distr_sink",
            ("any",),
            Placement("sink", size=(0.25, 0.25), pos=(0.0, 1.0)),
            properties=("washable",),
        ),
    ),
    goal=AllOf(ObjectInBasin("obj", "sink"), GripperFar("obj")),
    stages=(Stage("doors", "open", "cabinet"), *fetch("obj", "cabinet", "sink")),
    instruction="Open the cabinet, take the kettle out of it and put it into the sink.",
    paraphrases=(
        "The kettle has to be filled: from the closed cabinet into the sink with it.",
        "Get the kettle that is in the cabinet and stand it in the basin.",
        "In the sink there should be the kettle, which the cabinet holds now.",
        "Fetch the kettle out of the cabinet and set it down below the faucet.",
    ),
)

_LIT_POT = OnBurner("obj", "stove", lit=True)
_LIT_KETTLE = OnBurner("obj2", "stove", lit=True, within=0.08)

HEAT_MULTIPLE_WATER = Task(
    name="HeatMultipleWater",
    summary="Pot and kettle stand on two burners, both lit, the gripper away from both.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("cabinet", "cabinet", near="stove"),
        counter_near("cabinet", size=(0.2, 0.2)),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj", ("pot",), on_counter("cabinet", (0.4, 0.5)), graspable=True),
        ObjectSpec("obj2", ("kettle_non_electric",), in_cabinet("cabinet", (0.5, 0.3)), graspable=True),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        _LIT_POT, _LIT_KETTLE, OnBurner("obj", "stove", other_than="obj2"), GripperFar("obj"), GripperFar("obj2")
    ),
    stages=(
        Stage(
            "pick_place",
            "place",
            "stove",
            object="obj2",
            until=AllOf(OnBurner("obj2", "stove", within=0.08), GripperFar("obj2")),
        ),
        Stage("pick_place", "place", "stove", object="obj"),
        Stage("knobs", "on", "stove", object="obj2"),
        Stage("knobs", "on", "stove", object="obj"),
    ),
    instruction=(
        "Put the kettle from the cabinet and the pot from the counter on two burners of the stove and turn both on."
    ),
    paraphrases=(
        "Heat water in pot and kettle at once, each on a lit burner of its own.",
        "The cabinet's kettle and the counter's pot belong on the stove; light the burners under them.",
        "Two burners are needed: one for the kettle in the cabinet, one for the pot below it. Switch both on.",
        "Stand kettle and pot on separate burners, and use both burners' knobs.",
    ),
)

_COOLED = StepsWhile(
    AllOf(ObjectTouches("kettle", "stove"), StateIs("stove", "{burner}_on", value=False)), 150, label="kettle_cooled"
)
*_KETTLE_CARRIED, _KETTLE_PUT = fetch("kettle", "stove", "dining_counter")

COOL_KETTLE = Task(
    name="CoolKettle",
    summary=(
        "The kettle has stood on the stove for 150 steps (7.5 s) with its burner off; it is on the dining counter, the "
        "gripper 15 cm away."
    ),
    fixtures=(FixtureSpec("stove", "stove"), FixtureSpec("dining_counter", "dining_counter")),
    needs=("dining_counter",),
    robot_start=RobotStart("stove"),
    choices=(Choice("burner", of="stove"),),
    objects=(
        ObjectSpec(
            "kettle",
            ("kettle_non_electric",),
            Placement(
                "stove",
                region=SampleRegion(name="{burner}"),
                size=(0.05, 0.05),
                pos=(0.0, 0.0),
                ensure_inside=False,
            ),
            graspable=True,
        ),
    ),
    initial=(BurnerAt("stove", "{burner}", "on"),),
    goal=AllOf(_COOLED, ObjectTouches("kettle", "dining_counter"), GripperFar("kettle", 0.15)),
    stages=(
        Stage(
            "knobs",
            "off",
            "stove",
            part="knob_{burner}",
            until=_COOLED,
            text="turn off the {burner} burner and let the kettle cool for eight seconds",
        ),
        *_KETTLE_CARRIED,
        _KETTLE_PUT,
    ),
    instruction=(
        "Turn off the burner under the kettle, leave the kettle there for 8 seconds to cool, then carry it to the "
        "dining counter."
    ),
    paraphrases=(
        "Let the kettle cool on the stove for 8 seconds with its burner off, then bring it to the dining counter.",
        "Switch off the {burner} burner; 8 seconds later the kettle may go to the dining counter.",
        "The kettle belongs on the dining counter, but only after 8 seconds on a burner that is off.",
        "No more heat for the kettle: wait 8 seconds, pick it up and serve it on the dining counter.",
    ),
)

_IN_SAUCEPAN = OnBurner("saucepan", "stove", burner="{knob}", lit=True, within=0.08)
_EGGS = ("egg1", "egg2")

BOIL_EGGS = Task(
    name="BoilEggs",
    summary="Both eggs are in the saucepan over the lit burner, the gripper away from the saucepan.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("counter", at_object="egg_plate"),
    choices=(Choice("knob", of="stove", beginning="front"),),
    objects=(
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
            filled="water",
        ),
        ObjectSpec("egg_plate", ("plate",), on_counter("stove", (0.4, 0.35), loc="left_right")),
        ObjectSpec("egg1", ("egg",), Placement(object="egg_plate"), graspable=True),
        ObjectSpec("egg2", ("egg",), Placement(object="egg_plate"), graspable=True, repeats=True),
    ),
    initial=(BurnerAt("stove", "{knob}", "high"),),
    goal=AllOf(_IN_SAUCEPAN, *(ObjectOn(name, "saucepan") for name in _EGGS), GripperFar("saucepan")),
    stages=(
        Stage("pick_place", "place", "saucepan", object="egg1"),
        Stage(
            "pick_place",
            "place",
            "saucepan",
            object="egg2",
            until=AllOf(ObjectOn("egg2", "saucepan"), GripperFar("saucepan")),
        ),
    ),
    instruction="Put both eggs from the plate into the saucepan with the hot water on the stove.",
    paraphrases=(
        "Boil the two eggs: they go from the plate into the saucepan.",
        "The water in the saucepan is hot; add the eggs that lie on the plate.",
        "Neither egg stays on the plate, both belong in the saucepan on the {knob} burner.",
        "Into the saucepan of water with the first egg, then with the second one.",
    ),
)

_POT_HEATS = OnBurner("pot", "stove", lit=True)

BOIL_POT = Task(
    name="BoilPot",
    summary="The pot stands on a burner of the stove that is on, the gripper away from it.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("counter_sink", "counter", near="sink", size=(0.5, 0.5)),
        FixtureSpec("stove", "stove"),
    ),
    robot_start=RobotStart("counter_sink", at_object="pot"),
    objects=(
        ObjectSpec(
            "pot",
            ("pot",),
            on_counter("sink", (0.35, 0.35), loc="left_right", counter="counter_sink"),
            graspable=True,
            filled="water",
        ),
    ),
    goal=AllOf(ObjectTouches("pot", "stove"), _POT_HEATS, GripperFar("pot")),
    stages=(*fetch("pot", "counter_sink", "stove"), Stage("knobs", "on", "stove", object="pot")),
    instruction="Carry the pot of water from beside the sink to the stove, put it on a burner and turn that burner on.",
    paraphrases=(
        "Bring the water in the pot to the boil: onto a burner of the stove with it, and light that.",
        "The pot by the sink is full; it should heat on the stove.",
        "Take the pot over to the stove, stand it on any burner and switch that burner on.",
        "Get the pot from the sink to a lit burner.",
    ),
)

_LARGE, _COBS = 1.15, ("corn1", "corn2")

BOIL_CORN = Task(
    name="BoilCorn",
    summary="Both cobs are in the saucepan over its lit burner, its lid lies level on it, the gripper far from it.",
    fixtures=STOVE_AND_COUNTER,
    robot_start=RobotStart("stove"),
    choices=(FRONT_BURNER,),
    objects=(
        saucepan("water", rotation=HANDLE_TO_FRONT, scale=_LARGE),
        lid(ON_ITS_PAN, scale=_LARGE),
        ObjectSpec("corn_plate", ("plate",), on_counter("stove", (0.4, 0.35), loc="left_right")),
        *(
            ObjectSpec(name, ("corn",), on_plate("corn_plate"), graspable=True, repeats=True, scale=0.95)
            for name in _COBS
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "high"),),
    goal=AllOf(ON_LIT_BURNER, *(ObjectOn(name, "saucepan") for name in _COBS), *COVERED.parts),
    stages=(
        UNCOVERS,
        *(Stage("pick_place", "place", "saucepan", object=name) for name in _COBS),
        COVERS,
    ),
    instruction="Open the saucepan, put both cobs of corn from the plate into its water and close it with its lid.",
    paraphrases=(
        "Boil the corn: both cobs into the saucepan, and the lid on it.",
        "The water on the {knob} burner is for the corn. Lid off, two cobs in, lid on.",
        "The corn on the plate should cook in the saucepan, which is covered at the end as it is now.",
        "Move the cobs from the plate into the hot water under the saucepan's lid.",
    ),
)

PLACE_LID_TO_BOIL = Task(
    name="PlaceLidToBoil",
    summary="The lid lies level on the saucepan, which stands on its lit burner; the gripper is away from the lid.",
    fixtures=(FixtureSpec("stove", "stove"), FixtureSpec("cabinet", "cabinet")),
    robot_start=RobotStart("cabinet"),
    choices=(FRONT_BURNER,),
    objects=(
        saucepan("water", rotation=HANDLE_TO_FRONT, graspable=True),
        lid(in_cabinet("cabinet", (0.3, 0.3))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0), BurnerAt("stove", "{knob}", "high")),
    goal=AllOf(ON_LIT_BURNER, *COVERED.parts),
    stages=(
        Stage("pick_place", "pick", "cabinet", object=LID),
        Stage("navigation", "drive", "stove", object=LID),
        COVERS,
    ),
    instruction="Take the lid out of the open cabinet and cover the saucepan on the stove with it.",
    paraphrases=(
        "The water comes to the boil faster under its lid, which is in the cabinet: put it on the saucepan.",
        "Fetch the saucepan's lid from the cabinet and close the saucepan with it.",
        "The saucepan on the {knob} burner is open; the cabinet holds what covers it.",
        "Cabinet to stove: carry the lid over and lay it on the saucepan.",
    ),
)

TASKS = (
    BOIL_CORN,
    BOIL_EGGS,
    BOIL_POT,
    COOL_KETTLE,
    FILL_KETTLE,
    HEAT_MULTIPLE_WATER,
    PLACE_LID_TO_BOIL,
    START_ELECTRIC_KETTLE,
)
