"""Gather what is mixed."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    NearFixture,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside
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

_SALSA = ("avocado", "onion", "tomato", "bell_pepper")


def _at_front(**more: object) -> Placement:
    region = SampleRegion(top_size=(1.0, 0.4))
    return Placement("counter", region=region, size=(0.85, 0.4), pos=(None, -1.0), **more)  # type: ignore[arg-type]


def _onto(name: str, target: str = "receptacle") -> Stage:
    return Stage("pick_place", "place", target, object=name)


COLORFUL_SALSA = Task(
    name="ColorfulSalsa",
    summary="Avocado, onion, tomato and bell pepper lie on the cutting board, the gripper away from it.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.4)),),
    robot_start=RobotStart("counter", at_object="receptacle"),
    objects=(
        ObjectSpec("receptacle", ("cutting_board",), _at_front()),
        *(
            ObjectSpec(name, (name,), _at_front(reuse_region_from="receptacle"), graspable=True)
            for name in ("bell_pepper", "tomato", "avocado", "onion")
        ),
    ),
    goal=AllOf(*(ObjectOn(name, "receptacle") for name in _SALSA), GripperFar("receptacle")),
    stages=tuple(map(_onto, _SALSA)),
    instruction="Put the avocado, the onion, the tomato and the bell pepper on the cutting board.",
    paraphrases=(
        "A salsa needs avocado, onion, tomato and bell pepper: lay all of them on the cutting board.",
        "Gather the four vegetables for the salsa on the board.",
        "Tomato, bell pepper, avocado and onion belong on the cutting board.",
        "Collect everything around the cutting board on it, avocado first and bell pepper last.",
    ),
)

SPICY_MARINADE = Task(
    name="SpicyMarinade",
    summary=(
        "Bowl and condiment are on the counter, lime and garlic on the cutting board, the gripper away from board, "
        "bowl and condiment."
    ),
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("receptacle", ("cutting_board",), on_counter("cabinet", (0.8, 0.4))),
        ObjectSpec("bowl", ("bowl",), in_cabinet("cabinet", (0.6, 0.4)), graspable=True),
        ObjectSpec("condiment", ("condiment",), in_cabinet("cabinet", (0.5, 0.2)), graspable=True),
        ObjectSpec("lime", ("lime",), on_counter("cabinet", (0.3, 0.2)), graspable=True),
        ObjectSpec("garlic", ("garlic",), on_counter("cabinet", (0.3, 0.2)), graspable=True),
    ),
    goal=AllOf(
        ObjectTouches("bowl", "counter"),
        ObjectTouches("condiment", "counter"),
        ObjectOn("lime", "receptacle"),
        ObjectOn("garlic", "receptacle"),
        *map(GripperFar, ("receptacle", "bowl", "condiment")),
    ),
    stages=(
        Stage("doors", "open", "cabinet"),
        _onto("bowl", "counter"),
        _onto("condiment", "counter"),
        _onto("lime"),
        _onto("garlic"),
    ),
    instruction=(
        "Open the cabinet and bring the bowl and the {condiment} from it to the counter, then put the lime and the "
        "garlic on the cutting board."
    ),
    paraphrases=(
        "Get a marinade ready: bowl and {condiment} down from the cabinet, lime and garlic onto the board.",
        "The counter lacks the bowl and the {condiment} in the cabinet, the cutting board the lime and the garlic.",
        "Fetch bowl and {condiment} out of the closed cabinet; lay garlic and lime on the cutting board.",
        "From the cabinet come the bowl and the {condiment}, and from the counter lime and garlic onto the board.",
    ),
)


_SHELF = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
_IN_JUG = AllOf(ObjectInside("banana", "blender"), GripperFar("banana"))


def _by_blender(name: str) -> AllOf:
    return AllOf(NearFixture(name, "blender", 0.3), ObjectTouchesAnyCounter(name), GripperFar(name))


def _in_front(name: str, kind: str, depth: float) -> ObjectSpec:
    return ObjectSpec(
        name, (kind,), Placement("fridge", region=_SHELF, size=(0.5, depth), pos=(0.0, -1.0)), graspable=True
    )


MAKE_BANANA_MILKSHAKE = Task(
    name="MakeBananaMilkshake",
    summary="The banana is in the blender's jug, milk and honey stand 30 cm from it at most, the gripper away.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("cabinet", "cabinet"),
        FixtureSpec("blender", "blender"),
        counter_near("blender"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        _in_front("banana", "banana", 0.2),
        _in_front("milk", "milk", 0.15),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.5, 0.3), pos=(0.0, 0.0)),
            exclude=("milk", "honey_bottle", "banana"),
            properties=("fridgable",),
        ),
        ObjectSpec("honey", ("honey_bottle",), in_cabinet("cabinet", (0.3, 0.2)), graspable=True),
    ),
    initial=(
        InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        InitialOpenness("cabinet", 0.9, 1.0),
        LidAside("blender"),
    ),
    goal=AllOf(*_IN_JUG.parts, *_by_blender("milk").parts, *_by_blender("honey").parts),
    stages=(
        *fetch("honey", "cabinet", "counter", until=_by_blender("honey")),
        Stage("navigation", "drive", "fridge"),
        *fetch("banana", "fridge", "blender", until=_IN_JUG),
        Stage("navigation", "drive", "fridge"),
        *fetch("milk", "fridge", "counter", until=_by_blender("milk")),
    ),
    instruction=(
        "Put the banana from the fridge into the blender, and the honey from the cabinet and the milk from the fridge "
        "beside it."
    ),
    paraphrases=(
        "For a milkshake, the banana goes into the blender's jug, milk and honey next to the blender.",
        "Bring honey, banana and milk to the blender; only the banana goes in.",
        "Fill the open blender with the fridge's banana, and set milk and honey down close to it.",
        "Beside the blender there should be honey and milk, and inside it the banana.",
    ),
)

TASKS = (COLORFUL_SALSA, MAKE_BANANA_MILKSHAKE, SPICY_MARINADE)
