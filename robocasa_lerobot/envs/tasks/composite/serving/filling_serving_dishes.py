"""Fill dishes at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_STARTERS = ("cheese", "meat", "vegetable")
_SHELF = Placement(
    "fridge", region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)), size=(0.4, 0.2), pos=(0.0, -1.0)
)


def _fetch(name: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "fridge", object=name),
        Stage("navigation", "drive", "appetizer_plate", object=name),
        Stage("pick_place", "place", "appetizer_plate", object=name),
    )


BUILD_APPETIZER_PLATE = Task(
    name="BuildAppetizerPlate",
    summary="Cheese, meat and vegetable lie on the plate on the dining counter, the gripper away from each.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge", setback=0.3),
    objects=(
        ObjectSpec("cheese", ("cheese",), _SHELF, graspable=True),
        ObjectSpec("vegetable", ("vegetable",), _SHELF, graspable=True),
        ObjectSpec("meat", ("meat",), _SHELF, graspable=True),
        ObjectSpec(
            "appetizer_plate",
            ("plate",),
            Placement("dining_table", region=SampleRegion(ref="stool"), size=(0.4, 0.4), pos=("ref", "ref")),
            scale=1.25,
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(ObjectOn(name, "appetizer_plate") for name in _STARTERS),
        ObjectTouches("appetizer_plate", "dining_table"),
        *(GripperFar(name) for name in _STARTERS),
    ),
    stages=(
        *_fetch("cheese"),
        Stage("navigation", "drive", "fridge"),
        *_fetch("meat"),
        Stage("navigation", "drive", "fridge"),
        *_fetch("vegetable"),
    ),
    instruction="Bring {cheese}, {meat} and {vegetable} from the fridge to the plate on the dining counter.",
    paraphrases=(
        "Make a plate of starters on the dining counter from the {cheese}, the {meat} and the {vegetable}.",
        "The {cheese}, the {meat} and the {vegetable} in the fridge belong on the plate at the dining counter.",
        "Lay the {cheese}, the {meat} and the {vegetable} out of the fridge on the appetizer plate.",
        "Serve starters: put the fridge's {cheese}, {meat} and {vegetable} on the dining counter's plate.",
    ),
)

_SKEWERS = ("skewer1", "skewer2")


def _skewer(name: str) -> ObjectSpec:
    # Skewers are longer than the plate is wide.
    start = Placement(object="skewer_plate", ensure_inside=False)
    return ObjectSpec(name, ("kebab_skewer",), start, graspable=True, repeats=True)


MEAT_SKEWER_ASSEMBLY = Task(
    name="MeatSkewerAssembly",
    summary="Both skewers lie on the oven tray on the dining counter, the gripper away from them.",
    fixtures=(FixtureSpec("stool", "stool"), FixtureSpec("dining_counter", "dining_counter", near="stool")),
    robot_start=RobotStart("dining_counter", at_object="skewer_plate"),
    objects=(
        ObjectSpec("skewer_plate", ("plate",), before_stool((1.0, 0.35)), scale=1.25),
        *map(_skewer, _SKEWERS),
        ObjectSpec("oven_tray", ("oven_tray",), before_stool((1.0, 0.35), rotation=(0.0, 0.0)), scale=1.05),
    ),
    goal=AllOf(
        *(ObjectOn(name, "oven_tray") for name in _SKEWERS),
        ObjectTouches("oven_tray", "dining_counter"),
        *map(GripperFar, _SKEWERS),
    ),
    stages=tuple(Stage("pick_place", "place", "oven_tray", object=name) for name in _SKEWERS),
    instruction="Move both kebab skewers from the plate to the oven tray.",
    paraphrases=(
        "The two skewers on the plate go onto the oven tray before they are baked.",
        "Take the skewers off the plate, one after the other, and lay them on the oven tray.",
        "Load the oven tray with the pair of skewers from the plate.",
        "Both skewers should lie on the oven tray instead of the plate.",
    ),
)

_PLATES = ("plate1_container", "plate2_container")


def _filled_plate(number: int) -> tuple[ObjectSpec, ObjectSpec]:
    plate = f"plate{number}_container"
    start = before_stool((0.35, 0.35), counter="dining_table", stool=f"stool{number}")
    return (
        ObjectSpec(plate, ("plate",), start, repeats=True),
        ObjectSpec(f"plate{number}", ("cooked_food",), Placement(object=plate), graspable=True, repeats=True),
    )


def _shared(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn("fruit1", first), ObjectOn("fruit2", second))


MIXED_FRUIT_PLATTER = Task(
    name="MixedFruitPlatter",
    summary="Each of the plates on the dining counter has one of the fruits, the gripper away from both.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_table", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("fruit1", ("fruit",), on_shelf("second_highest", (0.2, 0.2)), graspable=True),
        ObjectSpec("fruit2", ("fruit",), on_shelf("highest", (0.2, 0.2)), graspable=True),
        ObjectSpec(
            "distr_fridge",
            ("food",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.3, 0.3), pos=(0.0, 1.0)),
            properties=("fridgable",),
            exclude=("fruit",),
        ),
        *_filled_plate(1),
        *_filled_plate(2),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        AnyOf(_shared(*_PLATES), _shared(*reversed(_PLATES))),
        *(ObjectTouches(plate, "dining_table") for plate in _PLATES),
        GripperFar("fruit1"),
        GripperFar("fruit2"),
    ),
    stages=(
        *fetch("fruit1", "fridge", "plate1_container"),
        Stage("navigation", "drive", "fridge"),
        *fetch("fruit2", "fridge", "plate2_container"),
    ),
    instruction="Bring {fruit1} and {fruit2} from the fridge to the plates on the dining counter, one for each.",
    paraphrases=(
        "Every plate at the dining counter gets a fruit from the fridge, either the {fruit1} or the {fruit2}.",
        "Share {fruit1} and {fruit2} out of the open fridge between the two plates.",
        "Carry the {fruit1} to one of the plates on the dining counter and the {fruit2} to the other.",
        "Serve fruit with the food: {fruit1} on one plate, {fruit2} on the other.",
    ),
)


_MEATS = {"chicken": "chicken_drumstick", "shrimp": "shrimp", "beef": "steak"}

DISPLAY_MEAT_VARIETY = Task(
    name="DisplayMeatVariety",
    summary="Drumstick, shrimp and steak lie on the tray on the dining counter, the gripper away from them.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        *(
            ObjectSpec(
                name,
                (kind,),
                Placement(
                    "fridge",
                    region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                    size=(0.4, 0.2),
                    pos=(0.0, -1.0),
                ),
                graspable=True,
                scale=(1.0, 1.0, 3.0) if name == "shrimp" else 1.0,
            )
            for name, kind in _MEATS.items()
        ),
        ObjectSpec(
            "serving_tray",
            ("tray",),
            before_stool((0.6, 0.4), counter="dining_table", rotation=(0.0, 0.0)),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(ObjectOn(name, "serving_tray") for name in _MEATS),
        ObjectTouches("serving_tray", "dining_table"),
        *map(GripperFar, _MEATS),
    ),
    stages=fetch_in_turn(_MEATS, "fridge", "serving_tray"),
    instruction="Bring the {chicken}, the {shrimp} and the {beef} from the fridge to the tray on the dining counter.",
    paraphrases=(
        "Display three meats on the dining counter's tray: {chicken}, {shrimp} and {beef}, all in the open fridge.",
        "The tray on the dining counter should carry the fridge's {chicken}, {shrimp} and {beef}.",
        "Fetch {chicken}, {shrimp} and {beef} out of the fridge, one after the other, and lay them on the tray.",
        "Serve meat: everything of it that is in the fridge goes onto the tray at the dining counter.",
    ),
)

TASKS = (BUILD_APPETIZER_PLATE, DISPLAY_MEAT_VARIETY, MEAT_SKEWER_ASSEMBLY, MIXED_FRUIT_PLATTER)
