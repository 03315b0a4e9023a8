"""Keep order in the freezer."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, ObjectOn, ObjectTouches, OnShelf
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
from robocasa_lerobot.envs.tasks.composite.common import fetch, fetch_in_turn, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_ACROSS = (np.pi / 2, np.pi / 2)  # radians


def _box(name: str, x: float, *, repeats: bool = False) -> ObjectSpec:
    start = Placement("counter", region=SampleRegion(ref="fridge"), size=(1.0, 0.4), pos=(x, -1.0), rotation=_ACROSS)
    return ObjectSpec(name, ("tupperware",), start, graspable=True, scale=(1.5, 1.5, 1.0), repeats=repeats)


def _in_box(name: str, group: str, box: str) -> ObjectSpec:
    return ObjectSpec(name, (group,), Placement(object=box, size=(0.8, 0.8)), graspable=True)


def _store(box: str, level: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "counter", object=box),
        Stage("navigation", "drive", "fridge", object=box),
        Stage("pick_place", "place", "fridge", object=box, part=f"freezer_shelf:{level}"),
    )


SEPARATE_FREEZER_RACK = Task(
    name="SeparateFreezerRack",
    summary=(
        "The box with the meat is on the second highest shelf of the freezer, the one with both vegetables on the "
        "highest, the gripper away from both."
    ),
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), FixtureSpec("counter", "counter", near="fridge")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="meat_tupperware"),
    objects=(
        _box("meat_tupperware", 0.25),
        _in_box("meat", "meat", "meat_tupperware"),
        _box("veg_tupperware", -0.25, repeats=True),
        _in_box("vegetable1", "vegetable", "veg_tupperware"),
        _in_box("vegetable2", "vegetable", "veg_tupperware"),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"),),
    goal=AllOf(
        ObjectOn("meat", "meat_tupperware"),
        ObjectOn("vegetable1", "veg_tupperware"),
        ObjectOn("vegetable2", "veg_tupperware"),
        OnShelf("meat_tupperware", "fridge", "second_highest", compartment="freezer"),
        OnShelf("veg_tupperware", "fridge", "highest", compartment="freezer"),
        GripperFar("meat_tupperware"),
        GripperFar("veg_tupperware"),
    ),
    stages=(
        *_store("meat_tupperware", "second_highest"),
        Stage("navigation", "drive", "veg_tupperware"),
        *_store("veg_tupperware", "highest"),
    ),
    instruction=(
        "Put the box of {meat} on the second highest shelf of the freezer and the box of {vegetable1} and {vegetable2} "
        "on the highest."
    ),
    paraphrases=(
        "The box with the {vegetable1} and the {vegetable2} goes on top in the freezer, the {meat} box just below.",
        "Freeze the {meat} on the second shelf from the top and the {vegetable1} and {vegetable2} on the first.",
        "Keep {meat} and vegetables apart: its box on the freezer's second highest shelf, theirs on the highest.",
        "Put both boxes into the freezer, vegetables on the uppermost shelf, {meat} one shelf lower.",
    ),
)

_BOTTLES = ("bottle1", "bottle2")


def _bottle(name: str) -> ObjectSpec:
    again = "" if name == "bottle1" else "bottle1"
    start = Placement(
        "counter", region=SampleRegion(ref="fridge"), size=(0.5, 0.3), pos=(0.0, -1.0), reuse_region_from=again
    )
    return ObjectSpec(name, ("bottled_water",), start, graspable=True, repeats=True)


def _freeze(name: str) -> tuple[Stage, ...]:
    return fetch(name, "counter", "fridge", part="freezer_shelf:any")


FREEZE_BOTTLED_WATERS = Task(
    name="FreezeBottledWaters",
    summary="Both bottles are on shelves of the freezer, which is shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), FixtureSpec("counter", "counter", near="fridge")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="bottle1"),
    objects=tuple(map(_bottle, _BOTTLES)),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"),),
    goal=AllOf(
        *(OnShelf(name, "fridge", compartment="freezer") for name in _BOTTLES), DoorsClosed("fridge", part="freezer")
    ),
    stages=(
        *_freeze("bottle1"),
        Stage("navigation", "drive", "bottle2"),
        *_freeze("bottle2"),
        Stage("doors", "close_large", "fridge", part="freezer"),
    ),
    instruction="Put both bottles of water into the freezer and close it.",
    paraphrases=(
        "Freeze the two bottles of water on the counter; leave the freezer shut.",
        "Both water bottles belong on a shelf of the freezer, behind its closed {freezer_doors}.",
        "Carry one bottle of water after the other from the counter to the open freezer, then shut that.",
        "Load the freezer with the counter's two bottles and close the {freezer_doors}.",
    ),
)


_FREEZER_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="freezer")
_FREEZER_SHUT = DoorsClosed("fridge", part="freezer")
_SHUT_FREEZER = Stage("doors", "close_large", "fridge", part="freezer")
_ITEMS = ("item1", "item2", "item3")


def _at_1_m(
    compartment: str, size: tuple[float, float] = (0.3, 0.2), pos: tuple[float, float] = (0.0, -1.0)
) -> Placement:
    """On a shelf of a compartment whose floor is 1.0 to 1.5 m high."""
    region = SampleRegion(name=f"{compartment}_shelf", height=(1.0, 1.5))
    return Placement("fridge", region=region, size=size, pos=pos)


def _frozen(name: str) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("vegetable", "fruit", "meat"),
        _at_1_m("freezer", (0.4, 0.2)),
        graspable=True,
        properties=("freezable",),
    )


CLEAR_FREEZER = Task(
    name="ClearFreezer",
    summary="All three things from the freezer are in the bowl on the counter, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), counter_near("fridge")),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        *map(_frozen, _ITEMS),
        ObjectSpec("bowl", ("bowl",), on_counter("fridge", (0.5, 0.4), pos=(0.0, -1.0))),
    ),
    initial=(_FREEZER_OPEN,),
    goal=AllOf(
        *(ObjectOn(name, "bowl") for name in _ITEMS), ObjectTouches("bowl", "counter"), *map(GripperFar, _ITEMS)
    ),
    stages=fetch_in_turn(_ITEMS, "fridge", "bowl"),
    instruction="Take the {item1}, the {item2} and the {item3} out of the freezer and put them into the bowl.",
    paraphrases=(
        "Clear the freezer: what is in it goes into the bowl on the counter.",
        "The bowl on the counter is for the freezer's {item1}, {item2} and {item3}.",
        "Empty the open freezer into the bowl, one thing after the other.",
        "Move {item1}, {item2} and {item3} from the freezer to the counter's bowl.",
    ),
)

FREEZE_ICE_TRAY = Task(
    name="FreezeIceTray",
    summary="The ice tray is on a shelf of the freezer, which is shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), FixtureSpec("sink", "sink"), counter_near("sink")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="ice_tray"),
    objects=(
        ObjectSpec(
            "ice_tray",
            ("ice_cube_tray",),
            on_counter("sink", (0.5, 0.5), loc="left_right", rotation=(np.pi / 2, np.pi / 2)),
            scale=(1.0, 0.75, 1.0),
            filled="water",
        ),
    ),
    initial=(_FREEZER_OPEN,),
    goal=AllOf(OnShelf("ice_tray", "fridge", compartment="freezer"), _FREEZER_SHUT),
    stages=(*fetch("ice_tray", "counter", "fridge", part="freezer_shelf:any"), _SHUT_FREEZER),
    instruction="Take the tray of water to the freezer, put it inside and close the freezer.",
    paraphrases=(
        "There should be ice cubes: the filled tray goes into the freezer, and the freezer is shut.",
        "Carry the ice tray from beside the sink to a shelf of the open freezer, then close its door.",
        "Freeze the water in the ice tray; leave the freezer closed.",
        "The ice tray on the counter belongs in the freezer. Shut it afterwards.",
    ),
)


# Two things lie side by side in a freezer, which is 27 to 33 cm wide inside, and two more behind them in the end: each
# starts in its own half of the front, and is no longer than that.
_HALF = (0.15, 0.2)
_SMALL = (0.13, 0.08, 0.09)


def _on_rack(name: str, side: float, rack: str, exclude: tuple[str, ...] = ()) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("meat", "vegetable", "fruit"),
        on_shelf(rack, _HALF, (side, -1.0), compartment="freezer", margin=0.01),
        graspable=True,
        properties=("freezable",),
        exclude=exclude,
        max_size=_SMALL,
    )


MAXIMIZE_FREEZER_SPACE = Task(
    name="MaximizeFreezerSpace",
    summary="All four things are on the one shelf of the freezer, which is shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), counter_near("fridge")),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice(
            "direction",
            {
                "up": {"_from": "second_highest", "_to": "highest", "source": "second highest", "level": "highest"},
                "down": {"_from": "highest", "_to": "second_highest", "source": "highest", "level": "second highest"},
            },
        ),
    ),
    objects=(
        _on_rack("item1", -1.0, "{_from}"),
        _on_rack("item2", 1.0, "{_from}"),
        _on_rack("item3", -1.0, "{_to}", exclude=("shrimp",)),
        _on_rack("item4", 1.0, "{_to}", exclude=("shrimp",)),
    ),
    initial=(_FREEZER_OPEN,),
    goal=AllOf(*(OnShelf(name, "fridge", "{_to}", "freezer") for name in (*_ITEMS, "item4")), _FREEZER_SHUT),
    stages=(
        *(Stage("pick_place", "place", "fridge", object=name, part="freezer_shelf:{_to}") for name in _ITEMS[:2]),
        _SHUT_FREEZER,
    ),
    instruction=(
        "Move {item1} and {item2} from the {source} shelf of the freezer to the {level} one, to the {item3} and "
        "the {item4}, and close the freezer."
    ),
    paraphrases=(
        "Make room in the freezer: everything belongs on its {level} shelf. Shut it then.",
        "The freezer's {source} shelf should be empty; put {item1} and {item2} on the {level} one and close the door.",
        "Gather the freezer's four things on the {level} shelf, then close it.",
        "Shift {item1} and {item2} to the shelf of {item3} and {item4}, and leave the freezer shut.",
    ),
)

MOVE_FRIDGE_TO_FREEZER = Task(
    name="MoveFridgeToFreezer",
    summary="The meat is on a shelf of the freezer, what was beside it stays, fridge and freezer are shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"),),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "refrigerated_item",
            ("meat",),
            _at_1_m("fridge"),
            graspable=True,
            exclude=("shrimp",),
            properties=("freezable",),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            on_shelf("any", (0.4, 0.2), (-0.3, -0.5)),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec(
            "freezer_distractor",
            ("any",),
            on_shelf("any", (0.4, 0.2), (0.3, -0.5), compartment="freezer"),
            graspable=True,
            properties=("freezable",),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0),),
    goal=AllOf(
        OnShelf("refrigerated_item", "fridge", compartment="freezer"),
        _FREEZER_SHUT,
        DoorsClosed("fridge", part="fridge"),
        OnShelf("fridge_distractor", "fridge"),
        OnShelf("freezer_distractor", "fridge", compartment="freezer"),
    ),
    stages=(
        Stage("pick_place", "place", "fridge", object="refrigerated_item", part="freezer_shelf:any"),
        Stage("doors", "close_large", "fridge"),
    ),
    instruction="Move the {refrigerated_item} from the fridge to a shelf of the freezer and close both doors.",
    paraphrases=(
        "The {refrigerated_item} is to be frozen: put it into the freezer, then shut freezer and fridge.",
        "Take the {refrigerated_item} out of the fridge compartment into the freezer and leave both closed.",
        "Freeze the fridge's {refrigerated_item}; no door stays open.",
        "A shelf of the freezer is where the {refrigerated_item} belongs. Close everything afterwards.",
    ),
)

_FROZEN_VEGETABLES = ("vegetable1", "vegetable2")
_BOX_AWAY = ("vegetable1", "vegetable2", "tupperware")

REORGANIZE_FROZEN_VEGETABLES = Task(
    name="ReorganizeFrozenVegetables",
    summary="Both vegetables are in the box, the box on a shelf of the freezer, the gripper away from all three.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), counter_near("fridge")),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        *(ObjectSpec(name, ("vegetable",), _at_1_m("freezer"), graspable=True) for name in _FROZEN_VEGETABLES),
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            on_counter("fridge", (0.4, 0.4), pos=(0.0, -1.0)),
            graspable=True,
            scale=(1.5, 1.5, 1.0),
        ),
    ),
    initial=(_FREEZER_OPEN,),
    goal=AllOf(
        *(ObjectOn(name, "tupperware") for name in _FROZEN_VEGETABLES),
        OnShelf("tupperware", "fridge", compartment="freezer"),
        *map(GripperFar, _BOX_AWAY),
    ),
    stages=(
        *(Stage("pick_place", "place", "tupperware", object=name) for name in _FROZEN_VEGETABLES),
        Stage("pick_place", "place", "fridge", object="tupperware", part="freezer_shelf:any"),
    ),
    instruction="Put {vegetable1} and {vegetable2} from the freezer into the box, and the box into the freezer.",
    paraphrases=(
        "Pack the freezer's vegetables into the box on the counter and freeze them again in it.",
        "The box should hold {vegetable1} and {vegetable2} and stand in the freezer.",
        "Take both vegetables out of the freezer, put them in the box, and store that on a freezer shelf.",
        "Keep the frozen {vegetable1} and {vegetable2} in the box from the counter, inside the freezer.",
    ),
)

TASKS = (
    CLEAR_FREEZER,
    FREEZE_BOTTLED_WATERS,
    FREEZE_ICE_TRAY,
    MAXIMIZE_FREEZER_SPACE,
    MOVE_FRIDGE_TO_FREEZER,
    REORGANIZE_FROZEN_VEGETABLES,
    SEPARATE_FREEZER_RACK,
)
