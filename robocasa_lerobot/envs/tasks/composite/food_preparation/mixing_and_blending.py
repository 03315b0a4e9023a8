"""Gather what is mixed."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
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

TASKS = (COLORFUL_SALSA, SPICY_MARINADE)
