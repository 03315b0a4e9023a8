"""Keep order in the freezer: its drawers."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_MOVED = ("obj1", "obj2")
_DRAWER = "freezer_drawer1"  # the upper one of two
_SHORT = (0.16, 0.16, 0.13)  # freezer drawers are 20 to 26 cm wide inside


def _on_shelf(name: str, x: float) -> ObjectSpec:
    shelf = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
    start = Placement("fridge", region=shelf, size=(0.3, 0.15), pos=(x, -1.0))
    return ObjectSpec(name, ("fruit", "vegetable"), start, graspable=True, properties=("freezable",), max_size=_SHORT)


def _into_drawer(name: str) -> Stage:
    return Stage(
        "pick_place", "place", "fridge", object=name, part=_DRAWER, text=f"put the {{{name}}} into the freezer drawer"
    )


MOVE_TO_FREEZER_DRAWER = Task(
    name="MoveToFreezerDrawer",
    summary="Both things from the fridge are in the upper drawer of the freezer, the gripper away from them.",
    fixtures=(FixtureSpec("fridge", "fridge_with_freezer", fitted="freezer_drawers"),),
    needs=("freezer",),
    robot_start=RobotStart("fridge"),
    objects=(
        _on_shelf("obj1", 0.25),
        _on_shelf("obj2", -0.25),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.2), pos=(None, 1.0)),
            graspable=True,
            properties=("fridgable",),
            exclude=("fruit", "vegetable"),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0), PartAt("fridge", _DRAWER, (0.9, 1.0))),
    goal=AllOf(*(ObjectInside(name, "fridge", region=_DRAWER) for name in _MOVED), *map(GripperFar, _MOVED)),
    stages=tuple(map(_into_drawer, _MOVED)),
    instruction="Put the {obj1} and the {obj2} from the shelf of the fridge into the freezer drawer that is out.",
    paraphrases=(
        "The open drawer in the freezer should hold the {obj1} and the {obj2}, which lie in the fridge.",
        "Freeze what the fridge has of {obj1} and {obj2}: both belong in the pulled-out drawer of the freezer.",
        "Fill the upper freezer drawer with the {obj2} and the {obj1} from the shelf next to it.",
        "Take {obj1} and {obj2} off their shelf and lay them in the freezer's drawer.",
    ),
)

TASKS = (MOVE_TO_FREEZER_DRAWER,)
