"""Arrange what is in cabinets."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    NearerThan,
    ObjectInside,
    OnOneSide,
    RestsOn,
)
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
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

_CABINETS = ("cabinet1", "cabinet2", "cabinet3")

RESET_CABINET_DOORS = Task(
    name="ResetCabinetDoors",
    summary="All three cabinets are shut.",
    fixtures=(
        FixtureSpec("cabinet1", "cabinet_with_door"),
        FixtureSpec("cabinet2", "cabinet_with_door", other_than=("cabinet1",)),
        FixtureSpec("cabinet3", "cabinet_with_door", other_than=("cabinet1", "cabinet2")),
        counter_near("cabinet1"),
    ),
    robot_start=RobotStart("counter"),
    objects=(ObjectSpec("distr_counter_1", ("any",), on_counter("cabinet1", (0.3, 0.3), offset=(0.0, 0.3))),),
    initial=(
        InitialOpenness("cabinet1", 0.3, 1.0),
        InitialOpenness("cabinet2", 0.4, 1.0),
        InitialOpenness("cabinet3", 0.25, 0.9),
    ),
    goal=AllOf(*map(DoorsClosed, _CABINETS)),
    stages=(
        Stage("doors", "close", "cabinet1"),
        Stage("navigation", "drive", "cabinet2"),
        Stage("doors", "close", "cabinet2"),
        Stage("navigation", "drive", "cabinet3"),
        Stage("doors", "close", "cabinet3"),
    ),
    instruction="Close all three cabinets that are open.",
    paraphrases=(
        "No cabinet should be left open: shut the three that are.",
        "Go round the kitchen and close the doors of every open cabinet.",
        "Three cabinets are open. Shut them, one after the other.",
        "Leave the kitchen with all its cabinets closed.",
    ),
)

_CANS = ("can1", "can2", "can3", "can4")
_PAIRINGS = (
    (("can1", "can2"), ("can3", "can4")),
    (("can1", "can3"), ("can2", "can4")),
    (("can1", "can4"), ("can2", "can3")),
)


def _stacked(first: str, second: str) -> AnyOf:
    return AnyOf(RestsOn(first, second), RestsOn(second, first))


def _stack(name: str, other: str) -> Stage:
    return Stage("pick_place", "place", other, object=name, until=AllOf(RestsOn(name, other), GripperFar(name)))


def _can(name: str) -> ObjectSpec:
    again = "" if name == "can1" else "can1"
    start = in_cabinet("cabinet", (1.0, 0.15), pos=(0.0, -0.9), reuse_region_from=again)
    return ObjectSpec(name, ("canned_food",), start, graspable=True, repeats=True)


STACK_CANS = Task(
    name="StackCans",
    summary="The four cans are two stacks, of two cans each, the gripper away from all of them.",
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        *map(_can, _CANS),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (1.0, 0.3), pos=(0.0, 1.0), offset=(0.0, -0.05))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        AnyOf(*(AllOf(_stacked(*first), _stacked(*second)) for first, second in _PAIRINGS)), *map(GripperFar, _CANS)
    ),
    stages=(_stack("can1", "can2"), _stack("can3", "can4")),
    instruction="Stack the four cans in the cabinet in pairs, one can on another.",
    paraphrases=(
        "Make room in the cabinet: two stacks of two cans each.",
        "Put two of the cans on top of the other two.",
        "The cabinet's cans should stand in two stacks instead of a row.",
        "Build two towers of two cans from the four in the cabinet.",
    ),
)

TASKS = (GATHER_TABLEWARE, RESET_CABINET_DOORS, STACK_CANS)
