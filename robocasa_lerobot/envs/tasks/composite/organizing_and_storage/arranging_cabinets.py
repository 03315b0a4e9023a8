"""Arrange what is in cabinets."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, NearerThan, ObjectInside, OnOneSide
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet
from robocasa_lerobot.envs.tasks.task import Stage, Task

_MUGS = ("glass1", "glass2", "glass3")
_GROUPED = AllOf(NearerThan(_MUGS, _MUGS, "bowl", factor=1.5), OnOneSide(_MUGS, "bowl", "cabinet1"))


def _mug(name: str, start: Placement, *, repeats: bool = True) -> ObjectSpec:
    return ObjectSpec(name, ("mug",), start, graspable=True, repeats=repeats)


GATHER_TABLEWARE = Task(
    name="GatherTableware",
    summary="Mugs and bowl are in one cabinet, the mugs together at one side of the bowl, the gripper away from them.",
    fixtures=(
        FixtureSpec("cabinet1", "cabinet"),
        FixtureSpec("cabinet2", "cabinet", other_than=("cabinet1",)),
        counter_near("cabinet1"),
    ),
    robot_start=RobotStart("cabinet1"),
    choices=(Choice("end", {"left": {}, "right": {}}),),
    objects=(
        _mug("glass1", in_cabinet("cabinet1", (0.3, 0.4), pos=("{end}", 0.0)), repeats=False),
        _mug("glass2", in_cabinet("cabinet1", (0.3, 0.4), pos=("{end}", 0.0), reuse_region_from="glass1")),
        _mug("glass3", in_cabinet("cabinet2", (0.4, 0.4), pos=(0.0, 0.0))),
        ObjectSpec(
            "bowl",
            ("bowl",),
            in_cabinet("cabinet1", (0.25, 0.4), pos=("-{end}", 0.0), reuse_region_from="glass1"),
            graspable=True,
        ),
    ),
    initial=(InitialOpenness("cabinet1", 0.9, 1.0), InitialOpenness("cabinet2", 0.9, 1.0)),
    goal=AllOf(
        *_GROUPED.parts,
        *(ObjectInside(name, "cabinet1") for name in (*_MUGS, "bowl")),
        *(GripperFar(name) for name in _MUGS),
    ),
    stages=(
        Stage("navigation", "drive", "cabinet2"),
        Stage("pick_place", "pick", "cabinet2", object="glass3"),
        Stage("navigation", "drive", "cabinet1", object="glass3"),
        Stage(
            "pick_place",
            "place",
            "cabinet1",
            object="glass3",
            until=AllOf(*_GROUPED.parts, ObjectInside("glass3", "cabinet1"), GripperFar("glass3")),
            text="put the mug into the first cabinet beside the other mugs",
        ),
    ),
    instruction="Gather all mugs and the bowl in one cabinet, the mugs together at one end and the bowl at the other.",
    paraphrases=(
        "Take the mug from the other cabinet to the two that stand with the bowl, beside them and away from it.",
        "All three mugs belong at one end of the cabinet whose other end the bowl has.",
        "The lone mug should join its like, so that one cabinet holds the mugs at one side and the bowl at the other.",
        "Sort the tableware into a single cabinet: mugs here, the bowl there.",
    ),
)

TASKS = (GATHER_TABLEWARE,)
