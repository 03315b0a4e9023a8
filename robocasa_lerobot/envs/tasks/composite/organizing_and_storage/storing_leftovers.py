"""Put leftovers of a meal away."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside, ObjectOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
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
    initial=(InitialOpenness("fridge", 0.9, 1.0),),
    goal=AllOf(
        ObjectOn("chicken_drumstick", "bowl"),
        ObjectOn("vegetable", "bowl"),
        ObjectInside("bowl", "fridge", region="fridge_shelf", lower=0.9),
        GripperFar("bowl"),
    ),
    stages=(
        Stage("pick_place", "place", "bowl", object="chicken_drumstick"),
        Stage("pick_place", "place", "bowl", object="vegetable"),
        Stage("pick_place", "pick", "dining_counter", object="bowl"),
        Stage("navigation", "drive", "fridge", object="bowl"),
        Stage("pick_place", "place", "fridge", object="bowl", part="fridge_shelf"),
    ),
    instruction="Put the drumstick and the {vegetable} from the plates into the bowl, and the bowl into the fridge.",
    paraphrases=(
        "Collect the drumstick and the {vegetable} in the bowl and store it in the fridge.",
        "The leftovers on the plates belong in the bowl, and the bowl belongs in the fridge.",
        "Clear the {vegetable} and the drumstick into the bowl, then set it on a shelf of the fridge.",
        "Store the leftovers: the drumstick and the {vegetable} into the bowl, the bowl into the refrigerator.",
    ),
)

TASKS = (STORE_LEFTOVERS_IN_BOWL,)
