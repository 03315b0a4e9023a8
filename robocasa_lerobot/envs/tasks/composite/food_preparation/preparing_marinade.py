"""Gather what a marinade is made of."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BESIDE_M = 0.3
_BOTTLE = "oil_or_vinegar_bottle"
_SHELF = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))


def _beside_bowl(name: str) -> AllOf:
    return AllOf(ObjectTouchesAnyCounter(name), Near(name, "mixing_bowl", _BESIDE_M), GripperFar(name))


def _stand(name: str) -> Stage:
    text = f"put the {{{name}}} on the counter beside the bowl"
    return Stage("pick_place", "place", "counter", object=name, until=_beside_bowl(name), text=text)


GATHER_MARINADE_INGREDIENTS = Task(
    name="GatherMarinadeIngredients",
    summary=(
        "The garlic is in the bowl on the counter, bottle and shaker are on a counter 30 cm from the bowl at most, the "
        "gripper away from all three."
    ),
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), FixtureSpec("fridge", "fridge"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("mixing_bowl", ("bowl",), on_counter("cabinet", (1.0, 0.4), pos=(0.0, -1.0))),
        ObjectSpec(
            "garlic", ("garlic",), Placement("fridge", region=_SHELF, size=(0.3, 0.2), pos=(0.0, -1.0)), graspable=True
        ),
        ObjectSpec(
            "distr_fridge",
            ("food",),
            Placement("fridge", region=_SHELF, size=(0.3, 0.2), pos=(0.5, -1.0)),
            exclude=("garlic",),
            properties=("fridgable",),
        ),
        ObjectSpec(
            _BOTTLE,
            ("oil_and_vinegar_bottle",),
            in_cabinet("cabinet", (0.6, 0.2), pos=(-0.5, -1.0)),
            graspable=True,
            scale=0.9,
        ),
        ObjectSpec(
            "shaker",
            ("shaker", "salt_and_pepper_shaker"),
            in_cabinet("cabinet", (0.6, 0.2), pos=(0.5, -1.0)),
            graspable=True,
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0), InitialOpenness("fridge", 0.9, 1.0, part="fridge")),
    goal=AllOf(
        ObjectOn("garlic", "mixing_bowl"),
        *_beside_bowl(_BOTTLE).parts,
        *_beside_bowl("shaker").parts,
        ObjectTouches("mixing_bowl", "counter"),
        GripperFar("garlic"),
    ),
    stages=(
        _stand(_BOTTLE),
        _stand("shaker"),
        Stage("navigation", "drive", "fridge"),
        *fetch("garlic", "fridge", "mixing_bowl"),
    ),
    instruction=(
        "Stand the {oil_or_vinegar_bottle} and the {shaker} from the cabinet beside the bowl on the counter, and put "
        "the garlic from the fridge into it."
    ),
    paraphrases=(
        "Gather a marinade: {oil_or_vinegar_bottle} and {shaker} next to the bowl, the fridge's garlic in it.",
        "The bowl gets the garlic out of the fridge, and {oil_or_vinegar_bottle} and {shaker} at its side.",
        "From the cabinet, bring the {oil_or_vinegar_bottle} and the {shaker} to the bowl; then add garlic.",
        "Place the cabinet's {oil_or_vinegar_bottle} and {shaker} near the bowl, then drop in the garlic.",
    ),
)

TASKS = (GATHER_MARINADE_INGREDIENTS,)
