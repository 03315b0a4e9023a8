"""Put leftovers of a meal away."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    DoorsClosed,
    Exactly,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    OnShelf,
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
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task


def _before(stool: str, size: tuple[float, float]) -> Placement:
    return Placement("dining_counter", region=SampleRegion(ref=stool), size=size, pos=("ref", "ref"))


def _on_a_plate(name: str, stool: str) -> tuple[ObjectSpec, ObjectSpec]:
    plate = f"{name}_container"
    groups = (name,)
    return (
        ObjectSpec(plate, ("plate",), _before(stool, (0.4, 0.4)), repeats=True),
        ObjectSpec(name, groups, Placement(object=plate), graspable=True),
    )


def _in_fridge(name: str, x: float) -> ObjectSpec:
    shelf = SampleRegion(name="fridge_shelf", height=(0.5, 1.5))
    start = Placement("fridge", region=shelf, size=(0.3, 0.3), pos=(x, 1.0))
    return ObjectSpec(name, ("any",), start, properties=("fridgable",))


STORE_LEFTOVERS_IN_BOWL = Task(
    name="StoreLeftoversInBowl",
    summary="Drumstick and vegetable are in the bowl, the bowl on a shelf of the fridge, the gripper away.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
        FixtureSpec("fridge", "fridge"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="bowl"),
    objects=(
        *_on_a_plate("chicken_drumstick", "stool1"),
        *_on_a_plate("vegetable", "stool2"),
        ObjectSpec("bowl", ("bowl",), _before("stool2", (1.0, 0.4)), graspable=True),
        _in_fridge("distr1", -0.3),
        _in_fridge("distr2", 0.3),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        ObjectOn("chicken_drumstick", "bowl"),
        ObjectOn("vegetable", "bowl"),
        OnShelf("bowl", "fridge"),
        GripperFar("bowl"),
    ),
    stages=(
        Stage("pick_place", "place", "bowl", object="chicken_drumstick"),
        Stage("pick_place", "place", "bowl", object="vegetable"),
        Stage("pick_place", "pick", "dining_counter", object="bowl"),
        Stage("navigation", "drive", "fridge", object="bowl"),
        Stage("pick_place", "place", "fridge", object="bowl", part="fridge_shelf:any"),
    ),
    instruction="Put the drumstick and the {vegetable} from the plates into the bowl, and the bowl into the fridge.",
    paraphrases=(
        "Collect the drumstick and the {vegetable} in the bowl and store it in the fridge.",
        "The leftovers on the plates belong in the bowl, and the bowl belongs in the fridge.",
        "Clear the {vegetable} and the drumstick into the bowl, then set it on a shelf of the fridge.",
        "Store the leftovers: the drumstick and the {vegetable} into the bowl, the bowl into the refrigerator.",
    ),
)


_KEPT = ("graspable", "freezable")

FREEZE_COOKED_FOOD = Task(
    name="FreezeCookedFood",
    summary="The cooked food is on a shelf of the freezer, which is shut.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer"), counter_near("fridge")),
    needs=("freezer",),
    robot_start=RobotStart("counter", at_object="cooked_food"),
    objects=(
        ObjectSpec("cooked_food", ("cooked_food",), on_counter("fridge", (1.0, 0.4), pos=(0.0, -1.0)), graspable=True),
        ObjectSpec(
            "distractor",
            ("meat",),
            Placement("fridge", region=SampleRegion(name="freezer_shelf", level=0), size=(1.0, 0.3), pos=(0.0, 1.0)),
            graspable=True,
            properties=_KEPT,
        ),
        ObjectSpec(
            "distractor2",
            ("vegetable",),
            Placement(
                "fridge",
                region=SampleRegion(name="freezer_shelf", height=(0.5, 1.5)),
                size=(1.0, 0.2),
                pos=(0.0, 1.0),
            ),
            graspable=True,
            properties=_KEPT,
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="freezer"),),
    goal=AllOf(OnShelf("cooked_food", "fridge", compartment="freezer"), DoorsClosed("fridge", part="freezer")),
    stages=(
        *fetch("cooked_food", "counter", "fridge", part="freezer_shelf:any"),
        Stage("doors", "close_large", "fridge", part="freezer"),
    ),
    instruction="Put the {cooked_food} from the counter into the open freezer and close the freezer.",
    paraphrases=(
        "Freeze what is left of the {cooked_food}: into the freezer with it, then shut the door.",
        "The {cooked_food} on the counter goes on a shelf of the freezer, which is to be closed.",
        "Carry the {cooked_food} to the freezer, put it inside, and shut the freezer.",
        "Store the {cooked_food} in the freezer and leave that closed.",
    ),
)

_WRAPPINGS = ("tupperware", "aluminum_foil")


def _by_plate(name: str) -> AllOf:
    return AllOf(ObjectTouches(name, "dining_counter"), Near(name, "plate", 0.3, in_space=True), GripperFar(name))


PREPARE_STORING_LEFTOVERS = Task(
    name="PrepareStoringLeftovers",
    summary="Box and foil lie on the dining counter, 30 cm from the plate at most, the gripper away from both.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("cabinet", "cabinet_double_door"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("cabinet"),
    choices=(Choice("foil_side", {"left": {}, "right": {}}),),
    objects=(
        ObjectSpec(
            "tupperware",
            ("tupperware",),
            in_cabinet("cabinet", (0.3, 0.3), pos=("-{foil_side}", -1.0), rotation=(np.pi / 2, np.pi / 2)),
            graspable=True,
            scale=(1.3, 1.3, 1.2),
        ),
        ObjectSpec(
            "aluminum_foil",
            ("aluminum_foil",),
            in_cabinet("cabinet", (0.5, 0.15), pos=("{foil_side}", -1.0), rotation=(0.0, 0.0)),
            graspable=True,
        ),
        ObjectSpec("plate", ("plate",), before_stool((0.4, 0.35))),
        *(
            ObjectSpec(
                name, ("meat", "cooked_food", "vegetable"), Placement(object="plate", heaped=True), graspable=True
            )
            for name in ("food1", "food2")
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*(part for name in _WRAPPINGS for part in _by_plate(name).parts)),
    stages=fetch_in_turn(_WRAPPINGS, "cabinet", "dining_counter", until=_by_plate),
    instruction="Bring the box and the roll of foil from the cabinet to the plate on the dining counter.",
    paraphrases=(
        "The leftovers on the plate will be packed: set the cabinet's box and foil down close to the plate.",
        "Carry the plastic box, then the aluminium foil, from the cabinet to beside the plate of {food1} and {food2}.",
        "Lay box and foil next to the plate on the dining counter; both are in the open cabinet.",
        "By the plate on the dining counter there should be a box and a roll of foil.",
    ),
)

_DUMPLINGS = ("dumpling1", "dumpling2", "dumpling3", "dumpling4")
_BOXES = ("tupperware1", "tupperware2")


def _dumpling(name: str, plate: str) -> ObjectSpec:
    return ObjectSpec(name, ("dumpling",), Placement(object=plate, heaped=True), graspable=True, repeats=True)


_PLATES: dict[str, dict[str, str]] = {"dumpling_plate1": {}, "dumpling_plate2": {}}

STORE_DUMPLINGS = Task(
    name="StoreDumplings",
    summary="Each of the two boxes has two of the dumplings, both are on shelves of the fridge, the gripper away.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
        FixtureSpec("fridge", "fridge"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter"),
    choices=(Choice("third_plate", _PLATES), Choice("fourth_plate", _PLATES)),
    objects=(
        *(
            ObjectSpec(
                f"dumpling_plate{number}",
                ("plate",),
                before_stool((0.35, 0.35), stool=f"stool{number}"),
                scale=1.25,
                repeats=True,
            )
            for number in (1, 2)
        ),
        _dumpling("dumpling1", "dumpling_plate1"),
        _dumpling("dumpling2", "dumpling_plate2"),
        _dumpling("dumpling3", "{third_plate}"),
        _dumpling("dumpling4", "{fourth_plate}"),
        *(
            ObjectSpec(
                f"tupperware{number}",
                ("tupperware",),
                before_stool((1.0, 0.4), stool=f"stool{number}", pos=(0.0, -1.0), rotation=(0.0, 0.0)),
                graspable=True,
                scale=(1.5, 1.5, 1.0),
                repeats=True,
            )
            for number in (1, 2)
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(Exactly(2, *(ObjectOn(name, box) for name in _DUMPLINGS)) for box in _BOXES),
        *(OnShelf(box, "fridge") for box in _BOXES),
        *map(GripperFar, (*_DUMPLINGS, *_BOXES)),
    ),
    stages=(
        *(Stage("pick_place", "place", "tupperware1", object=name) for name in _DUMPLINGS[:2]),
        *(Stage("pick_place", "place", "tupperware2", object=name) for name in _DUMPLINGS[2:]),
        *fetch_in_turn(_BOXES, "dining_counter", "fridge", part="fridge_shelf:any", along=True),
    ),
    instruction="Put two of the four dumplings into each of the two boxes, and both boxes into the fridge.",
    paraphrases=(
        "Pack the dumplings on the plates, two to a box, and store the boxes in the open fridge.",
        "Each box gets two dumplings; then both boxes go on shelves of the fridge.",
        "The leftover dumplings belong in the fridge, in the boxes on the dining counter, two in each.",
        "Share the four dumplings between the boxes and carry the boxes to the fridge.",
    ),
)

_PLACES = ("counter", "fridge")
_BY_TYPE = {"meat": "{meat_shelf}", "vegetable": "{_vegetable_shelf}"}


def _kept(kind: str, x: float) -> ObjectSpec:
    start = on_shelf(_BY_TYPE[kind], (0.3, 0.3), (x, 1.0))
    return ObjectSpec(f"{kind}_fridge", (kind,), start, properties=("fridgable",))


def _left_over(kind: str, stool: str, exclude: tuple[str, ...] = ()) -> tuple[ObjectSpec, ObjectSpec]:
    plate = f"{kind}_counter_container"
    return (
        ObjectSpec(plate, ("plate",), _before(stool, (0.4, 0.4)), repeats=True),
        ObjectSpec(f"{kind}_counter", (kind,), Placement(object=plate), graspable=True, exclude=exclude),
    )


STORE_LEFTOVERS_BY_TYPE = Task(
    name="StoreLeftoversByType",
    summary="Meat and vegetable are on the fridge's shelves with their like, the gripper away from both.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
        FixtureSpec("fridge", "fridge"),
        counter_near("fridge"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("stool1"),
    choices=(
        Choice(
            "meat_shelf",
            {
                "highest": {"_vegetable_shelf": "second_highest"},
                "second_highest": {"_vegetable_shelf": "highest"},
            },
        ),
    ),
    objects=(
        *_left_over("meat", "stool1", exclude=("shrimp",)),
        *_left_over("vegetable", "stool2"),
        _kept("meat", -0.3),
        _kept("vegetable", 0.3),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(OnShelf(f"{kind}_{where}", "fridge", level) for kind, level in _BY_TYPE.items() for where in _PLACES),
        *(GripperFar(f"{kind}_counter") for kind in _BY_TYPE),
    ),
    stages=(
        *fetch("meat_counter", "dining_counter", "fridge", part="fridge_shelf:{meat_shelf}"),
        Stage("navigation", "drive", "vegetable_counter"),
        *fetch("vegetable_counter", "dining_counter", "fridge", part="fridge_shelf:{_vegetable_shelf}"),
    ),
    instruction=(
        "Put the {meat_counter} and the {vegetable_counter} from the plates into the fridge, each on the shelf where "
        "its kind is already."
    ),
    paraphrases=(
        "Store the leftovers by type: the {meat_counter} to the meat in the fridge, the {vegetable_counter} to the "
        "vegetable.",
        "One shelf of the fridge is for meat, one for vegetables; put {meat_counter} and {vegetable_counter} there.",
        "Take {meat_counter} and {vegetable_counter} from the dining counter to the fridge, like to like.",
        "Beside the fridge's {meat_fridge} belongs the {meat_counter}, beside its {vegetable_fridge} the "
        "{vegetable_counter}.",
    ),
)

TASKS = (
    FREEZE_COOKED_FOOD,
    PREPARE_STORING_LEFTOVERS,
    STORE_DUMPLINGS,
    STORE_LEFTOVERS_BY_TYPE,
    STORE_LEFTOVERS_IN_BOWL,
)
