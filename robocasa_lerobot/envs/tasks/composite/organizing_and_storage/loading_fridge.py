"""Load the fridge."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, Not, OnShelf, When
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
from robocasa_lerobot.envs.tasks.composite.common import both_together, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, StagesWhen, Task

_IN_BOWLS = {"vegetable1": "veg_bowl", "vegetable2": "veg_bowl", "meat1": "meat_bowl", "meat2": "meat_bowl"}


def _bowl(name: str, x: float, again: str = "") -> ObjectSpec:
    start = on_counter("fridge", (np.inf, 0.4), pos=(x, -1.0), reuse_region_from=again)
    return ObjectSpec(name, ("bowl",), start, graspable=True, repeats=True)


def _in_bowl(name: str, exclude: tuple[str, ...] = ()) -> ObjectSpec:
    start = Placement(object=_IN_BOWLS[name], heaped=True)
    return ObjectSpec(
        name, (name.rstrip("12"),), start, graspable=True, properties=("fridgable",), exclude=exclude, repeats=True
    )


# All fridges have two usable shelves at least.
LOAD_FRIDGE_BY_TYPE = Task(
    name="LoadFridgeByType",
    summary=(
        "The bowl with both vegetables is on its shelf of the fridge, the bowl with both pieces of meat on the other, "
        "the gripper away from the bowls."
    ),
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("counter", at_object="veg_bowl"),
    choices=(
        Choice(
            "veg_shelf",
            {
                "highest": {"_meat_shelf": "second_highest", "meat_level": "second highest", "veg_level": "highest"},
                "second_highest": {"_meat_shelf": "highest", "meat_level": "highest", "veg_level": "second highest"},
            },
        ),
    ),
    objects=(
        _bowl("veg_bowl", -0.25),
        _bowl("meat_bowl", 0.25, again="veg_bowl"),
        _in_bowl("vegetable1"),
        _in_bowl("vegetable2"),
        _in_bowl("meat1", exclude=("shrimp",)),
        _in_bowl("meat2", exclude=("shrimp",)),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *both_together("vegetable1", "vegetable2", "veg_bowl"),
        *both_together("meat1", "meat2", "meat_bowl"),
        OnShelf("veg_bowl", "fridge", "{veg_shelf}"),
        OnShelf("meat_bowl", "fridge", "{_meat_shelf}"),
        GripperFar("veg_bowl"),
        GripperFar("meat_bowl"),
    ),
    stages=(
        *fetch("veg_bowl", "counter", "fridge", part="fridge_shelf:{veg_shelf}"),
        Stage("navigation", "drive", "meat_bowl"),
        *fetch("meat_bowl", "counter", "fridge", part="fridge_shelf:{_meat_shelf}"),
    ),
    instruction=(
        "Put the bowl with {vegetable1+vegetable2} on the {veg_level} shelf of the fridge and the bowl with "
        "{meat1+meat2} on the {meat_level}."
    ),
    paraphrases=(
        "Vegetables go on the {veg_level} shelf of the fridge, meat on the {meat_level}; keep them in their bowls.",
        "Load the fridge: {veg_level} shelf for the bowl of vegetables, {meat_level} shelf for the bowl of meat.",
        "Carry the bowl of vegetables to the fridge's {veg_level} shelf, then the bowl of meat to the {meat_level}.",
        "The bowl of meat belongs on the {meat_level} shelf of the fridge, that of vegetables on the {veg_level}.",
    ),
)


_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")
_FITS_M = 0.2  # height that every usable shelf has room for
_LOW, _TOP = "fridge_shelf:second_highest", "fridge_shelf:highest"


def _not_highest(name: str) -> Not:
    return Not(OnShelf(name, "fridge", "highest"))


def _by_fridge(size: tuple[float, float], x: float = 0.0, again: str = "") -> Placement:
    return on_counter("fridge", size, pos=(x, -1.0), reuse_region_from=again)


CREATE_CHILD_FRIENDLY_FRIDGE = Task(
    name="CreateChildFriendlyFridge",
    summary=(
        "Drinks with alcohol are on the fridge's highest shelf, fruit and vegetables on another one, the gripper away "
        "from all three."
    ),
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("counter", at_object="item3"),
    choices=(
        Choice(
            "third",
            {
                "alcohol": {"_one": "alcohol", "_other": "alcohol", "_level": "highest"},
                "fruit_vegetable": {"_one": "fruit", "_other": "vegetable", "_level": "second_highest"},
            },
        ),
    ),
    objects=(
        ObjectSpec(
            "item1",
            ("fruit", "vegetable"),
            _by_fridge((0.5, 0.3)),
            graspable=True,
            properties=("fridgable",),
        ),
        ObjectSpec(
            "item2",
            ("alcohol",),
            _by_fridge((0.5, 0.3), again="item1"),
            graspable=True,
            properties=("fridgable",),
            exclude=("wine",),
            repeats=True,
        ),
        ObjectSpec(
            "item3",
            ("{_one}", "{_other}"),
            on_counter("fridge", (0.6, 0.3), pos=(0.0, 0.0), reuse_region_from="item1"),
            graspable=True,
            properties=("fridgable",),
            exclude=("wine",),
            repeats=True,
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        OnShelf("item1", "fridge"),
        _not_highest("item1"),
        OnShelf("item2", "fridge", "highest"),
        When(
            "third",
            {
                "alcohol": OnShelf("item3", "fridge", "highest"),
                "fruit_vegetable": AllOf(OnShelf("item3", "fridge"), _not_highest("item3")),
            },
        ),
        *map(GripperFar, ("item1", "item2", "item3")),
    ),
    stages=(
        *fetch("item1", "counter", "fridge", part=_LOW),
        Stage("navigation", "drive", "item2"),
        *fetch("item2", "counter", "fridge", part=_TOP),
        Stage("navigation", "drive", "item3"),
        *fetch("item3", "counter", "fridge", part="fridge_shelf:{_level}"),
    ),
    instruction=(
        "Put {item1+item2+item3} into the fridge: what has alcohol on the highest shelf, fruit and vegetables on the "
        "shelf below."
    ),
    paraphrases=(
        "No child should reach the alcohol: it goes on the fridge's highest shelf, the rest on the second highest.",
        "Load the fridge with {item1+item2+item3}, alcohol at the top and fresh food below it.",
        "Store {item1+item2+item3} in the open fridge; only drinks with alcohol belong on its highest shelf.",
        "Fresh things go on the fridge's second highest shelf, alcohol on the highest.",
    ),
)

_CONDIMENTS = ("condiment1", "condiment2")


def _at_side(name: str, x: float, again: str = "") -> ObjectSpec:
    return ObjectSpec(
        name,
        ("condiment",),
        _by_fridge((0.4, 0.3), x, again),
        graspable=True,
        properties=("fridgable",),
        max_height=_FITS_M,
        repeats=True,
    )


def _in_the_way(name: str, x: float, shelf: str) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("any",),
        on_shelf(shelf, (0.4, 0.2), (x, -1.0)),
        graspable=True,
        properties=("fridgable",),
        exclude=("condiment",),
        max_height=_FITS_M,
    )


def _shift(name: str) -> Stage:
    return Stage("pick_place", "place", "fridge", object=name, part=_LOW)


LOAD_CONDIMENTS_IN_FRIDGE = Task(
    name="LoadCondimentsInFridge",
    summary="Both condiments are on the fridge's highest shelf, what was in it on another one, the gripper away.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice("first_shelf", {"highest": {}, "second_highest": {}}),
        Choice("second_shelf", {"highest": {}, "second_highest": {}}),
    ),
    objects=(
        _at_side("condiment1", 0.25),
        _at_side("condiment2", -0.25, again="condiment1"),
        _in_the_way("distractor1", -0.3, "{first_shelf}"),
        _in_the_way("distractor2", 0.3, "{second_shelf}"),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        *(OnShelf(name, "fridge", "highest") for name in _CONDIMENTS),
        *(_not_highest(name) for name in ("distractor1", "distractor2")),
        *(OnShelf(name, "fridge") for name in ("distractor1", "distractor2")),
        *map(GripperFar, (*_CONDIMENTS, "distractor1", "distractor2")),
    ),
    stages=(
        StagesWhen("first_shelf", {"highest": (_shift("distractor1"),)}),
        StagesWhen("second_shelf", {"highest": (_shift("distractor2"),)}),
        *fetch("condiment1", "counter", "fridge", part=_TOP),
        Stage("navigation", "drive", "condiment2"),
        *fetch("condiment2", "counter", "fridge", part=_TOP),
    ),
    instruction=(
        "Put the {condiment1} and the {condiment2} on the highest shelf of the fridge; what is there already goes one "
        "shelf down."
    ),
    paraphrases=(
        "The fridge's highest shelf is for condiments alone: {condiment1} and {condiment2}. Move the rest below.",
        "Keep {condiment1} and {condiment2} at the top of the fridge and nothing else beside them.",
        "First clear the fridge's highest shelf onto the second highest, then stand both condiments on it.",
        "Load the {condiment1} and the {condiment2} onto the top shelf of the open fridge, free of other things.",
    ),
)

MOVE_FREEZER_TO_FRIDGE = Task(
    name="MoveFreezerToFridge",
    summary="The meat is on a shelf of the fridge, what was beside it stays, fridge and freezer are shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"),),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "frozen_meat",
            ("meat",),
            Placement(
                "fridge",
                region=SampleRegion(name="freezer_shelf", height=(1.0, 1.5)),
                size=(0.3, 0.2),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            exclude=("shrimp",),
            properties=("fridgable", "freezable"),
        ),
        ObjectSpec(
            "freezer_distractor",
            ("any",),
            on_shelf("any", (0.4, 0.2), (-0.3, -0.5), compartment="freezer"),
            graspable=True,
            properties=("freezable",),
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            on_shelf("any", (0.4, 0.2), (0.3, -0.5)),
            graspable=True,
            properties=("fridgable",),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0),),
    goal=AllOf(
        OnShelf("frozen_meat", "fridge"),
        DoorsClosed("fridge", part="freezer"),
        DoorsClosed("fridge", part="fridge"),
        OnShelf("freezer_distractor", "fridge", compartment="freezer"),
        OnShelf("fridge_distractor", "fridge"),
    ),
    stages=(
        Stage("pick_place", "place", "fridge", object="frozen_meat", part="fridge_shelf:any"),
        Stage("doors", "close_large", "fridge"),
    ),
    instruction="Move the {frozen_meat} from the freezer to a shelf of the fridge and close both doors.",
    paraphrases=(
        "The {frozen_meat} should thaw in the fridge: take it there from the freezer and shut both.",
        "Take the {frozen_meat} out of the freezer into the fridge compartment and leave both closed.",
        "A shelf of the fridge is where the freezer's {frozen_meat} belongs. Close everything afterwards.",
        "From freezer to fridge with the {frozen_meat}; no door stays open.",
    ),
)

_SHIFTED = ("item1_source", "item2_source")

REARRANGE_FRIDGE_ITEMS = Task(
    name="RearrangeFridgeItems",
    summary="The pitcher is on the one shelf, what was there on the other, the gripper away from all three.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("fridge"),
    choices=(
        Choice(
            "source",
            {
                "highest": {"_other": "second_highest", "level": "highest", "below": "second highest"},
                "second_highest": {"_other": "highest", "level": "second highest", "below": "highest"},
            },
        ),
    ),
    objects=(
        ObjectSpec("pitcher", ("pitcher",), _by_fridge((0.6, 0.3)), graspable=True, scale=0.85),
        *(
            ObjectSpec(
                name,
                ("any",),
                on_shelf("{source}", (0.4, 0.2), (x, -1.0)),
                graspable=True,
                properties=("fridgable",),
                max_height=_FITS_M,
            )
            for name, x in zip(_SHIFTED, (-0.3, 0.3), strict=True)
        ),
    ),
    initial=(_OPEN,),
    goal=AllOf(
        OnShelf("pitcher", "fridge", "{source}"),
        *(OnShelf(name, "fridge", "{_other}") for name in _SHIFTED),
        *map(GripperFar, ("pitcher", *_SHIFTED)),
    ),
    stages=(
        *(Stage("pick_place", "place", "fridge", object=name, part="fridge_shelf:{_other}") for name in _SHIFTED),
        Stage("pick_place", "place", "fridge", object="pitcher", part="fridge_shelf:{source}"),
    ),
    instruction=(
        "Move {item1_source} and {item2_source} from the fridge's {level} shelf to the {below} one, and put the "
        "pitcher on the shelf that is free now."
    ),
    paraphrases=(
        "The pitcher needs the fridge's {level} shelf; {item1_source} and {item2_source} go on the {below} one.",
        "Make room for the pitcher on the {level} shelf of the fridge by moving what is there to the {below} one.",
        "Rearrange the fridge: {item1_source} and {item2_source} on its {below} shelf, the pitcher on its {level} one.",
        "Clear the fridge's {level} shelf onto the {below} one and stand the pitcher there.",
    ),
)

TASKS = (
    CREATE_CHILD_FRIENDLY_FRIDGE,
    LOAD_CONDIMENTS_IN_FRIDGE,
    LOAD_FRIDGE_BY_TYPE,
    MOVE_FREEZER_TO_FRIDGE,
    REARRANGE_FRIDGE_ITEMS,
)
