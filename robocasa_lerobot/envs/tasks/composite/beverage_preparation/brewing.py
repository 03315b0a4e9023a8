"""Brew hot drinks."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    GripperFar,
    GripperFarFromPart,
    Near,
    ObjectAtSite,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnBurner,
    StateIs,
)
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import MUG_UNDER_SPOUT, counter_near, in_cabinet, on_burner, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

# Knobs of stoves are off at the start, as no initial state says otherwise.
KETTLE_BOILING = Task(
    name="KettleBoiling",
    summary="The kettle stands on a burner whose knob is on, the gripper away.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.2, 0.2))),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec(
            "obj",
            ("kettle_non_electric",),
            on_counter("stove", (0.35, 0.35), loc="left_right"),
            graspable=True,
        ),
        ObjectSpec(
            "stove_distr",
            ("pan", "pot"),
            on_burner(SampleRegion(name="any", height=(0.7, 1.2))),
            graspable=True,
        ),
    ),
    goal=AllOf(OnBurner("obj", "stove", lit=True), GripperFar("obj")),
    stages=(
        Stage("pick_place", "place", "stove", object="obj"),
        Stage("knobs", "on", "stove", object="obj"),
    ),
    instruction="Move the kettle from the counter to a free burner of the stove and turn that burner on.",
    paraphrases=(
        "Boil water: the kettle beside the stove goes on a burner, and that burner is lit.",
        "Set the kettle on the stove and switch on the burner below it.",
        "Get the kettle heating on one of the stove's burners.",
        "Pick up the kettle, stand it on an empty burner, and use that burner's knob.",
    ),
)

ARRANGE_TEA = Task(
    name="ArrangeTea",
    summary="Kettle and mug are on the tray, the cabinet is shut, the gripper away from the mug.",
    fixtures=(FixtureSpec("cab", "cabinet_double_door"), counter_near("cab", size=(0.6, 0.4))),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("obj", ("mug",), in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("obj2", ("kettle_non_electric",), on_counter("cab", (0.5, 0.5), offset=(0.1, 0.0)), graspable=True),
        ObjectSpec("container", ("tray",), on_counter("cab", (0.7, 0.7), pos=("ref", -0.6), offset=(-0.1, 0.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(ObjectOn("obj", "container"), ObjectOn("obj2", "container"), DoorsClosed("cab"), GripperFar("obj")),
    stages=(
        Stage("pick_place", "place", "container", object="obj2"),
        Stage("pick_place", "place", "container", object="obj"),
        Stage("doors", "close", "cab"),
    ),
    instruction="Set the kettle from the counter and the mug from the cabinet on the tray, then close the cabinet.",
    paraphrases=(
        "Kettle and mug belong on the tray; leave the cabinet shut.",
        "Get the tray ready for tea with the kettle first, then the {obj} out of the cabinet, and shut its doors.",
        "Put the kettle on the tray, fetch the {obj} to it and close both doors of the cabinet.",
        "The tea tray needs the kettle that stands beside it and the cabinet's {obj}. Close the cabinet after that.",
    ),
)

_BREWS = AllOf(StateIs("coffee_machine", "on"), GripperFarFromPart("coffee_machine", "start_button"))
_UNDER_SPOUT = AllOf(ObjectAtSite("obj", "coffee_machine", "receptacle", across=0.04, high=0.10), GripperFar("obj"))

PREPARE_COFFEE = Task(
    name="PrepareCoffee",
    summary="The mug stands under the spout of the machine, which brews, the gripper away from mug and button.",
    fixtures=(FixtureSpec("coffee_machine", "coffee_machine"), FixtureSpec("cab", "cabinet", near="coffee_machine")),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("obj", ("mug",), in_cabinet("cab", (0.3, 0.2)), graspable=True),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cab", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(*_UNDER_SPOUT.parts, *_BREWS.parts),
    stages=(
        Stage("pick_place", "place", "coffee_machine", object="obj", part="receptacle", until=_UNDER_SPOUT),
        Stage("buttons", "press", "coffee_machine", part="start_button", until=_BREWS),
    ),
    instruction="Put the {obj} from the cabinet under the coffee machine's dispenser and start the machine.",
    paraphrases=(
        "Make a coffee with the {obj} that is in the cabinet.",
        "Bring the cabinet's {obj} to the coffee machine, below its outlet, and press the button.",
        "Get the {obj} out of the cabinet, place it where the coffee comes out, and begin brewing.",
        "The coffee machine should fill the {obj} from the cabinet.",
    ),
)

_BY_BREAKFAST = AllOf(
    ObjectTouches("brewed_coffee", "dining_counter"),
    Near("brewed_coffee", "breakfast_plate", 0.3),
    GripperFar("brewed_coffee"),
)
*_COFFEE_CARRIED, _COFFEE_PUT = fetch("brewed_coffee", "coffee_machine", "dining_counter", until=_BY_BREAKFAST)

DELIVER_BREWED_COFFEE = Task(
    name="DeliverBrewedCoffee",
    summary="The mug of coffee stands on the dining counter, 30 cm from the plate there at most, the gripper away.",
    fixtures=(
        FixtureSpec("coffee_machine", "coffee_machine"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("coffee_machine"),
    objects=(
        ObjectSpec(
            "brewed_coffee",
            ("mug",),
            Placement("coffee_machine", region=SampleRegion(name="cup"), rotation=MUG_UNDER_SPOUT),
            graspable=True,
            filled="coffee",
        ),
        ObjectSpec("breakfast_plate", ("plate",), before_stool((0.35, 0.35))),
        ObjectSpec(
            "breakfast_item1",
            ("bread_food", "pancake", "waffle"),
            Placement(object="breakfast_plate"),
            exclude=("hotdog_bun",),
        ),
        ObjectSpec("breakfast_item2", ("fruit", "cheese"), Placement(object="breakfast_plate", heaped=True)),
    ),
    goal=AllOf(*_BY_BREAKFAST.parts, ObjectTouches("breakfast_plate", "dining_counter")),
    stages=(*_COFFEE_CARRIED, replace(_COFFEE_PUT, text="put the {brewed_coffee} on the counter beside the plate")),
    instruction=(
        "Take the {brewed_coffee} of coffee from the coffee machine to the dining counter and set it beside the plate."
    ),
    paraphrases=(
        "Serve the coffee: the {brewed_coffee} under the machine's dispenser goes next to the breakfast plate.",
        "The coffee is ready; carry it to the dining counter, close to the plate with breakfast.",
        "Breakfast on the dining counter lacks its coffee, which is still at the machine.",
        "Bring the {brewed_coffee} at the coffee machine over to the breakfast on the dining counter.",
    ),
)

_BY_COFFEE = AllOf(ObjectTouchesAnyCounter("milk"), Near("milk", "coffee", 0.25), GripperFar("milk"))
*_MILK_CARRIED, _MILK_PUT = fetch("milk", "fridge", "counter", until=_BY_COFFEE)

SWEETEN_COFFEE = Task(
    name="SweetenCoffee",
    summary="The sugar cube is in the mug of coffee, the milk stands 25 cm from that at most, the gripper away.",
    fixtures=(
        FixtureSpec("coffee_machine", "coffee_machine"),
        counter_near("coffee_machine"),
        FixtureSpec("fridge", "fridge"),
    ),
    robot_start=RobotStart("counter", at_object="coffee"),
    objects=(
        ObjectSpec("coffee", ("mug",), on_counter("coffee_machine", (0.5, 0.25)), graspable=True, filled="coffee"),
        ObjectSpec(
            "milk",
            ("milk",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.3, 0.15),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec("saucer_plate", ("plate",), on_counter("coffee_machine", (0.7, 0.35)), scale=(0.6, 0.6, 1.0)),
        ObjectSpec("sugar_cube", ("sugar_cube",), Placement(object="saucer_plate"), graspable=True, scale=1.1),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *_BY_COFFEE.parts, ObjectTouchesAnyCounter("coffee"), ObjectOn("sugar_cube", "coffee"), GripperFar("sugar_cube")
    ),
    stages=(
        Stage("pick_place", "place", "coffee", object="sugar_cube"),
        Stage("navigation", "drive", "fridge"),
        *_MILK_CARRIED,
        replace(_MILK_PUT, text="put the milk on the counter beside the {coffee}"),
    ),
    instruction="Put the sugar cube from the saucer into the coffee, then bring the milk from the fridge beside it.",
    paraphrases=(
        "Coffee with sugar and milk: the cube goes into the {coffee}, the fridge's milk next to it.",
        "Drop the saucer's sugar cube into the {coffee} and stand the milk out of the fridge close by.",
        "The coffee needs the sugar cube in it and the milk at its side; the milk is in the open fridge.",
        "Sweeten the coffee with the sugar cube, and fetch the milk to it.",
    ),
)

_AT_MUG_M, _CLEAR_M = 0.3, 0.15


def _by_mug(name: str) -> AllOf:
    return AllOf(
        Near(name, "mug", _AT_MUG_M, in_space=True),
        ObjectTouches(name, "counter"),
        GripperFar(name, _CLEAR_M),
    )


def _put_by_mug(name: str) -> Stage:
    text = f"put the {{{name}}} on the counter beside the mug"
    return Stage("pick_place", "place", "counter", object=name, until=_by_mug(name), text=text)


ORGANIZE_COFFEE_CONDIMENTS = Task(
    name="OrganizeCoffeeCondiments",
    summary="Both condiments stand on the counter, 30 cm from the mug at most, the gripper 15 cm away from them.",
    fixtures=(
        FixtureSpec("coffee_machine", "coffee_machine"),
        FixtureSpec("cab", "cabinet", near="coffee_machine"),
        counter_near("cab"),
        counter_near("coffee_machine", name="coffee_machine_counter"),
    ),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("obj1", ("syrup_bottle", "cinnamon"), in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("obj2", ("honey_bottle",), in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("mug", ("mug",), on_counter("cab", (1.0, 0.3), pos=(0.0, -1.0)), graspable=True, filled="coffee"),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cab", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0),),
    goal=AllOf(*_by_mug("obj1").parts, *_by_mug("obj2").parts),
    stages=(_put_by_mug("obj1"), _put_by_mug("obj2")),
    instruction="Put {obj1+obj2} from the cabinet on the counter, beside the mug of coffee.",
    paraphrases=(
        "What the coffee may need is in the cabinet: set {obj1+obj2} down next to the mug.",
        "Take {obj1+obj2} out of the cabinet, to the mug.",
        "The mug of coffee should have {obj1+obj2} at its side.",
        "Organize the coffee corner: {obj1+obj2} from the cabinet go next to the mug.",
    ),
)

TASKS = (ORGANIZE_COFFEE_CONDIMENTS, KETTLE_BOILING, ARRANGE_TEA, DELIVER_BREWED_COFFEE, PREPARE_COFFEE, SWEETEN_COFFEE)
