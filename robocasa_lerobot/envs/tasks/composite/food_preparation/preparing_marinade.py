"""Gather what a marinade is made of."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside
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
from robocasa_lerobot.envs.tasks.composite.common import BLENDER_ON, JAR_MOUTH_M, cover_and_blend, fetch, fetch_in_turn
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


_VEGETABLES = ("marinade_veg1", "marinade_veg2")

BLEND_MARINADE = Task(
    name="BlendMarinade",
    summary="Both ingredients are in the blender, which is covered and runs, the gripper away from its button.",
    fixtures=(FixtureSpec("blender", "blender"), counter_near("blender"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=tuple(
        ObjectSpec(
            name,
            ("garlic", "onion", "lemon", "lemon_wedge", "lime"),
            Placement("fridge", region=_SHELF, size=(0.3, 0.15), pos=(x, -1.0)),
            graspable=True,
            max_size=JAR_MOUTH_M,
            repeats=True,
        )
        for name, x in zip(_VEGETABLES, (-0.3, 0.3), strict=True)
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"), LidAside("blender")),
    goal=AllOf(*(ObjectInside(name, "blender") for name in _VEGETABLES), *BLENDER_ON.parts),
    stages=(*fetch_in_turn(_VEGETABLES, "fridge", "blender"), *cover_and_blend()),
    instruction=(
        "Put {marinade_veg1+marinade_veg2} from the fridge into the blender, put its lid on and switch it on."
    ),
    paraphrases=(
        "Blend a marinade of what is in the fridge, {marinade_veg1+marinade_veg2}, with the lid on the jar.",
        "Carry {marinade_veg1+marinade_veg2} to the blender one after the other, cover the jar, and press the button.",
        "The open blender gets {marinade_veg1+marinade_veg2}; then it is closed and runs.",
        "From the fridge into the blender with {marinade_veg1+marinade_veg2}; lid on, power on.",
    ),
)

PLACE_MEAT_IN_MARINADE = Task(
    name="PlaceMeatInMarinade",
    summary="The meat is in the pan of marinade on the stove, the gripper away from it.",
    fixtures=(FixtureSpec("fridge", "fridge"), FixtureSpec("stove", "stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "pan",
            ("saucepan", "pan"),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
            filled="marinade",
        ),
        ObjectSpec("meat_container", ("plate",), Placement("fridge", region=_SHELF, size=(0.4, 0.25), pos=(0.0, -1.0))),
        ObjectSpec("meat", ("meat",), Placement(object="meat_container"), graspable=True, exclude=("shrimp",)),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.3), pos=(0.0, 1.0)),
            exclude=("meat",),
            properties=("fridgable",),
        ),
    ),
    goal=AllOf(ObjectOn("meat", "pan"), ObjectTouches("pan", "stove"), GripperFar("meat")),
    stages=(
        Stage("navigation", "drive", "fridge"),
        Stage("doors", "open", "fridge", part="fridge"),
        Stage("pick_place", "pick", "fridge", object="meat"),
        Stage("navigation", "drive", "stove", object="meat"),
        Stage("pick_place", "place", "pan", object="meat"),
    ),
    instruction="Take the {meat} out of the fridge and put it into the pan with the marinade on the stove.",
    paraphrases=(
        "The {meat} should soak: bring it from the closed fridge to the pan of marinade.",
        "Go to the fridge, open it, and carry the {meat} to the pan on the stove.",
        "Lay the fridge's {meat} in the marinade; its pan is on the stove.",
        "The pan on the stove holds a marinade for the {meat} that is in the fridge.",
    ),
)

TASKS = (BLEND_MARINADE, GATHER_MARINADE_INGREDIENTS, PLACE_MEAT_IN_MARINADE)
