"""Thaw frozen food."""

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectInside, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.initial_states import BurnerAt, Water
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BEFORE = SampleRegion(ref="microwave", loc="nn")

MICROWAVE_THAWING = Task(
    name="MicrowaveThawing",
    summary="The food is in the microwave, which is shut and runs, the gripper away.",
    fixtures=(FixtureSpec("microwave", "microwave"), FixtureSpec("counter", "counter", near="microwave")),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec(
            "obj",
            ("food",),
            Placement("counter", region=_BEFORE, size=(0.3, 0.3), pos=("ref", -1.0), try_to_place_in="plate"),
            graspable=True,
            properties=("microwavable", "freezable"),
        ),
        ObjectSpec(
            "container", ("plate",), Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False)
        ),
        ObjectSpec("distr_counter", ("any",), Placement("counter", region=_BEFORE, size=(0.5, 0.2), pos=("ref", 1.0))),
    ),
    goal=AllOf(
        ObjectInside("obj", "microwave"), DoorsClosed("microwave"), StateIs("microwave", "on"), GripperFar("obj")
    ),
    stages=(
        Stage("doors", "open", "microwave"),
        Stage(
            "pick_place",
            "place",
            "container",
            object="obj",
            until=AllOf(ObjectInside("obj", "microwave"), GripperFar("obj")),
            text="put the {obj} into the microwave",
        ),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction="Take the {obj} off the counter, put it into the microwave and start the microwave.",
    paraphrases=(
        "Thaw the {obj} that lies on the counter in the microwave.",
        "The {obj} is frozen: place it in the microwave, shut the door and press start.",
        "Open the microwave, lay the {obj} inside, close it and switch it on.",
        "Defrost the {obj} with the microwave.",
    ),
)

_FROSTED = ("meat", "vegetable")
_FRONT_OF_SHELF = Placement(
    "fridge", region=SampleRegion(name="fridge_shelf", height=(0.5, 1.5)), size=(0.3, 0.25), pos=(None, -1.0)
)

MOVE_TO_COUNTER = Task(
    name="MoveToCounter",
    summary="The food lies on the plate on the counter, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("frosted_food", _FROSTED, _FRONT_OF_SHELF, graspable=True),
        ObjectSpec(
            "distractor_obj", ("any",), _FRONT_OF_SHELF, graspable=True, exclude=_FROSTED, properties=("fridgable",)
        ),
        ObjectSpec("plate", ("plate",), on_counter("fridge", (0.4, 0.4))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(ObjectOn("frosted_food", "plate"), GripperFar("frosted_food")),
    stages=fetch("frosted_food", "fridge", "plate"),
    instruction="Take the {frosted_food} out of the fridge and put it on the plate on the counter to defrost.",
    paraphrases=(
        "Let the {frosted_food} thaw on the counter's plate; it is in the open fridge.",
        "The {frosted_food} is to defrost: carry it from the fridge to the plate.",
        "The plate on the counter waits for the fridge's {frosted_food}.",
        "Move the {frosted_food} from the fridge to where it gets warmer, onto the plate.",
    ),
)


_FRUITS, _VEGETABLES = ("obj0", "obj1"), ("obj2", "obj3")

# The food takes all of its place up to the edges: with the usual margin most draws have no room for the fourth.
DEFROST_BY_CATEGORY = Task(
    name="DefrostByCategory",
    summary="Both fruits are in the sink, both vegetables in the bowl, the gripper away from all four.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.5, 0.5))),
    robot_start=RobotStart("sink"),
    choices=(Choice("bowl_side", {"left": {"_food_side": "right"}, "right": {"_food_side": "left"}}),),
    objects=(
        *(
            ObjectSpec(
                name,
                ("fruit" if name in _FRUITS else "vegetable",),
                on_counter("sink", (0.3, 0.4), loc="{_food_side}", margin=0.0),
                graspable=True,
                repeats=True,
            )
            for name in (*_FRUITS, *_VEGETABLES)
        ),
        ObjectSpec("container", ("bowl",), on_counter("sink", (0.3, 0.4), loc="{bowl_side}")),
    ),
    initial=(Water("sink", on=True),),
    goal=AllOf(
        *(ObjectInside(name, "sink") for name in _FRUITS),
        *(ObjectOn(name, "container") for name in _VEGETABLES),
        *map(GripperFar, (*_FRUITS, *_VEGETABLES)),
    ),
    stages=(
        *(Stage("pick_place", "place", "sink", object=name) for name in _FRUITS),
        *(Stage("pick_place", "place", "container", object=name) for name in _VEGETABLES),
    ),
    instruction="Put the fruits, {obj0+obj1}, into the running sink, and the vegetables, {obj2+obj3}, into the bowl.",
    paraphrases=(
        "Fruits thaw in the sink, where water runs; vegetables go into the bowl on its other side.",
        "Sort what is frozen: {obj0+obj1} into the basin, {obj2+obj3} into the bowl.",
        "Only fruits belong under the running water; put the vegetables into the bowl.",
        "Divide the food beside the sink: the bowl is for vegetables, the sink for fruits.",
    ),
)

_THERE = AllOf(ObjectInside("meat", "microwave"), GripperFar("meat"))

MICROWAVE_THAWING_FRIDGE = Task(
    name="MicrowaveThawingFridge",
    summary="The meat is in the microwave, which is shut and runs, the gripper away.",
    fixtures=(FixtureSpec("microwave", "microwave"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("meat_container", ("plate",), on_shelf("any", (0.3, 0.275))),
        ObjectSpec("meat", ("meat",), Placement(object="meat_container"), graspable=True),
        ObjectSpec("vegetable", ("vegetable",), on_shelf("any", (0.3, 0.25)), graspable=True),
        ObjectSpec(
            "container",
            ("plate",),
            Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False),
            repeats=True,
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), InitialOpenness("microwave", 0.9, 1.0)),
    goal=AllOf(*_THERE.parts, DoorsClosed("microwave"), StateIs("microwave", "on")),
    stages=(
        Stage("pick_place", "pick", "fridge", object="meat"),
        Stage("navigation", "drive", "microwave", object="meat"),
        Stage(
            "pick_place", "place", "container", object="meat", until=_THERE, text="put the {meat} into the microwave"
        ),
        Stage("doors", "close", "microwave"),
        Stage("buttons", "press", "microwave", part="start_button", until=StateIs("microwave", "on")),
    ),
    instruction="Take the {meat} from the fridge to the microwave, put it inside and start the microwave.",
    paraphrases=(
        "Thaw the fridge's {meat} in the microwave.",
        "The {meat} in the open fridge goes into the microwave; shut that and press start.",
        "Carry the {meat} over to the microwave, lay it inside, close the door and switch it on.",
        "Let the microwave run with the {meat} that is in the fridge.",
    ),
)

QUICK_THAW = Task(
    name="QuickThaw",
    summary="The meat is in the pot, the burner below it is on, the gripper 15 cm away from the meat.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec("meat_container", ("plate",), on_counter("stove", (0.4, 0.3), loc="left_right")),
        ObjectSpec("meat", ("meat",), Placement(object="meat_container"), graspable=True),
        ObjectSpec(
            "container",
            ("pot",),
            on_burner(),
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "off"),),
    goal=AllOf(StateIs("stove", "{knob}_on"), ObjectOn("meat", "container"), GripperFar("meat", 0.15)),
    stages=(
        Stage("pick_place", "place", "container", object="meat"),
        Stage("knobs", "on", "stove", part="knob_{knob}"),
    ),
    instruction="Put the {meat} from the plate into the pot on the stove and turn on the burner below the pot.",
    paraphrases=(
        "Thaw the {meat} quickly: into the pot with it, then light the burner under the pot.",
        "The frozen {meat} on the plate goes into the pot; switch on the pot's burner.",
        "Lay the {meat} in the pot on the stove and let the burner beneath it heat.",
        "Heat the {meat} in the pot: move it there and turn the knob of that burner.",
    ),
)

THAW_IN_SINK = Task(
    name="ThawInSink",
    summary="The object is in the sink, and water runs.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.4, 0.4))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "obj",
            ("any",),
            on_counter("sink", (0.3, 0.4), loc="left_right", try_to_place_in="plate"),
            graspable=True,
            properties=("washable", "freezable"),
        ),
        ObjectSpec("distr_counter", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.3))),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(ObjectInside("obj", "sink"), StateIs("sink", "water_on")),
    stages=(
        Stage("pick_place", "place", "sink", object="obj"),
        Stage("levers", "on", "sink", part="handle"),
    ),
    instruction="Put the {obj} from the counter into the sink and turn on the water.",
    paraphrases=(
        "Thaw the {obj} in the sink under running water.",
        "The frozen {obj} belongs in the basin; open the faucet then.",
        "Lay the {obj} into the sink and let the water run.",
        "Move the {obj} beside the sink into it, and start the water.",
    ),
)

TASKS = (DEFROST_BY_CATEGORY, MICROWAVE_THAWING, MICROWAVE_THAWING_FRIDGE, MOVE_TO_COUNTER, QUICK_THAW, THAW_IN_SINK)
