"""Get food onto cutting boards, and off them."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, ForEach, GripperFar, Not, ObjectOn, ObjectTouches, OnShelf
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch_in_turn
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_ACROSS, _ALONG = (np.pi / 2, np.pi / 2), (0.0, 0.0)  # radians
_BOARD = "non_vegetable_container"


def _beside_sink(size: tuple[float, float], **more: object) -> Placement:
    region = SampleRegion(ref="sink", loc="left_right", top_size=(0.45, 0.55))
    return Placement("counter", region=region, size=size, pos=("ref", -1.0), **more)  # type: ignore[arg-type]


def _in_basin(name: str, x: float) -> ObjectSpec:
    return ObjectSpec(name, ("vegetable",), Placement("sink", size=(0.3, 0.2), pos=(x, 1.0)), graspable=True)


def _at_front(size: tuple[float, float], top_size: tuple[float, float], **more: object) -> Placement:
    return Placement("counter", region=SampleRegion(top_size=top_size), size=size, pos=(None, -1.0), **more)  # type: ignore[arg-type]


def _onto(name: str, board: str) -> Stage:
    return Stage("pick_place", "place", board, object=name)


ARRANGE_VEGETABLES = Task(
    name="ArrangeVegetables",
    summary="Both vegetables lie on the cutting board, the gripper away from it.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.45, 0.55))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("cutting_board", ("cutting_board",), _beside_sink((0.35, 0.45), rotation=_ACROSS)),
        ObjectSpec("knife", ("knife",), _beside_sink((0.45, 0.45), offset=(0.0, 0.05))),
        _in_basin("vegetable1", -1.0),
        _in_basin("vegetable2", 1.0),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(
        ObjectOn("vegetable1", "cutting_board"), ObjectOn("vegetable2", "cutting_board"), GripperFar("cutting_board")
    ),
    stages=(_onto("vegetable1", "cutting_board"), _onto("vegetable2", "cutting_board")),
    instruction="Put the {vegetable1} and the {vegetable2} from the sink on the cutting board.",
    paraphrases=(
        "Both vegetables in the basin belong on the cutting board.",
        "Lift the {vegetable1} and then the {vegetable2} out of the sink and lay them on the board.",
        "Arrange the washed {vegetable1} and {vegetable2} on the cutting board beside the sink.",
        "Clear the vegetables out of the sink, onto the cutting board.",
    ),
)


def _bread_on_board(name: str) -> ObjectOn:
    return ObjectOn(name, "receptacle")


BREAD_SETUP_SLICING = Task(
    name="BreadSetupSlicing",
    summary="Every piece of bread lies on the cutting board, the gripper away from the first.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.4)),),
    robot_start=RobotStart("counter", at_object="receptacle"),
    objects=(
        ObjectSpec("receptacle", ("cutting_board",), _at_front((np.inf, 0.4), (0.9, 0.4))),
        ObjectSpec(
            "obj",
            ("bread",),
            _at_front((np.inf, 0.4), (0.9, 0.4), reuse_region_from="receptacle", try_to_place_in="plate"),
            count=(1, 3),
            graspable=True,
            scale=0.75,
            repeats=True,
        ),
    ),
    goal=AllOf(ForEach("obj", _bread_on_board), GripperFar("obj_0")),
    stages=(EachStage("obj", lambda name: (_onto(name, "receptacle"),)),),
    instruction="Put {obj} on the cutting board.",
    paraphrases=(
        "Set up for slicing: {obj} belong on the cutting board.",
        "Move all the bread from its plates to the cutting board.",
        "Take the bread off every plate and lay it on the board.",
        "The cutting board should hold {obj}.",
    ),
)

CLEAR_CUTTING_BOARD = Task(
    name="ClearCuttingBoard",
    summary="Both vegetables are on the cutting board, what is no vegetable is not, the gripper away from the board.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.5)),),
    robot_start=RobotStart("counter", at_object=_BOARD),
    objects=(
        ObjectSpec(
            "non_vegetable",
            ("food",),
            _at_front((0.75, 0.5), (0.9, 0.5), try_to_place_in="cutting_board"),
            graspable=True,
            exclude=("vegetable",),
        ),
        *(
            ObjectSpec(
                name,
                ("vegetable",),
                _at_front((0.75, 0.35), (0.9, 0.5), reuse_region_from="non_vegetable"),
                graspable=True,
            )
            for name in ("vegetable1", "vegetable2")
        ),
    ),
    goal=AllOf(
        ObjectOn("vegetable1", _BOARD),
        ObjectOn("vegetable2", _BOARD),
        Not(ObjectOn("non_vegetable", _BOARD)),
        GripperFar(_BOARD),
    ),
    stages=(_onto("non_vegetable", "counter"), _onto("vegetable1", _BOARD), _onto("vegetable2", _BOARD)),
    instruction="Take the {non_vegetable} off the cutting board and put the {vegetable1} and the {vegetable2} on it.",
    paraphrases=(
        "Only vegetables belong on the cutting board: the {non_vegetable} goes, {vegetable1} and {vegetable2} come.",
        "Replace the {non_vegetable} on the board by the two vegetables.",
        "Clear the board of the {non_vegetable}, then lay both vegetables there.",
        "Move the {non_vegetable} to the counter, and the {vegetable1} and the {vegetable2} to the cutting board.",
    ),
)


def _one_each(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn(first, "cutting_board1"), ObjectOn(second, "cutting_board2"))


ORGANIZE_VEGETABLES = Task(
    name="OrganizeVegetables",
    summary="Each of the two lies on a cutting board of its own.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.4)),),
    robot_start=RobotStart("counter", at_object="vegetable1"),
    objects=(
        ObjectSpec("cutting_board1", ("cutting_board",), _at_front((np.inf, 0.4), (1.0, 0.5), rotation=_ACROSS)),
        ObjectSpec(
            "cutting_board2",
            ("cutting_board",),
            _at_front((np.inf, 0.4), (1.0, 0.5), rotation=_ALONG, reuse_region_from="cutting_board1"),
            repeats=True,
        ),
        *(
            ObjectSpec(
                name,
                ("vegetable", "fruit"),
                _at_front((0.4, 0.35), (1.0, 0.5), reuse_region_from="cutting_board1"),
                graspable=True,
            )
            for name in ("vegetable1", "vegetable2")
        ),
    ),
    goal=AnyOf(_one_each("vegetable1", "vegetable2"), _one_each("vegetable2", "vegetable1")),
    stages=(_onto("vegetable1", "cutting_board1"), _onto("vegetable2", "cutting_board2")),
    instruction="Put the {vegetable1} on one of the cutting boards and the {vegetable2} on the other.",
    paraphrases=(
        "There are two cutting boards: one for the {vegetable1}, one for the {vegetable2}.",
        "Give the {vegetable1} and the {vegetable2} a cutting board each.",
        "Lay {vegetable1} and {vegetable2} on different boards.",
        "Each board should have one thing on it, either the {vegetable1} or the {vegetable2}.",
    ),
)


_FRUITS, _KEPT = ("fruit1", "fruit2"), ("non_fruit1", "non_fruit2")


def _in_fridge(name: str, x: float) -> ObjectSpec:
    region = SampleRegion(name="fridge_shelf", height=(1.0, 1.5))
    fruit = name in _FRUITS
    return ObjectSpec(
        name,
        ("fruit",) if fruit else ("any",),
        Placement("fridge", region=region, size=(0.5 if fruit else 0.8, 0.25), pos=(x, -1.0)),
        graspable=True,
        exclude=() if fruit else ("fruit",),
        properties=() if fruit else ("fridgable",),
    )


def _by_board(size: tuple[float, float], along: float | None) -> Placement:
    return Placement(
        "counter",
        region=SampleRegion(ref="sink"),
        size=size,
        pos=(None, along),
        rotation=(0.0, 0.0),
        reuse_region_from="cutting_board",
    )


ARRANGE_CUTTING_FRUITS = Task(
    name="ArrangeCuttingFruits",
    summary="Both fruits are on the cutting board, what else the fridge had is on its shelves, the gripper away.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("sink", "sink"),
        counter_near("sink", size=(0.5, 0.5)),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "cutting_board",
            ("cutting_board",),
            on_counter("sink", (0.35, 0.45), loc="left_right", rotation=(np.pi / 2, np.pi / 2)),
        ),
        ObjectSpec("knife", ("knife",), _by_board((0.5, 0.35), -1.0)),
        ObjectSpec("bowl", ("bowl",), _by_board((np.inf, 0.7), None)),
        *(_in_fridge(names, x) for names, x in zip((*_FRUITS, *_KEPT), (0.5, -0.5, 0.5, -0.5), strict=True)),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(ObjectOn(name, "cutting_board") for name in _FRUITS),
        *(OnShelf(name, "fridge") for name in _KEPT),
        *map(GripperFar, (*_FRUITS, *_KEPT)),
    ),
    stages=fetch_in_turn(_FRUITS, "fridge", "cutting_board"),
    instruction="Bring {fruit1} and {fruit2} from the fridge to the cutting board by the sink; the rest stays inside.",
    paraphrases=(
        "Only the fridge's fruits go to the cutting board: {fruit1} and {fruit2}.",
        "The {fruit1} and the {fruit2} will be cut: carry them from the fridge to the board at the sink.",
        "Lay both fruits of the fridge on the cutting board and leave everything else in the fridge.",
        "Take the {fruit1}, then the {fruit2}, out of the open fridge to the board beside the sink.",
    ),
)

MEAT_TRANSFER = Task(
    name="MeatTransfer",
    summary="The container stands on the counter with the meat in it, the gripper away from the meat.",
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet", size=(0.5, 0.5))),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec(
            "container",
            ("pan", "bowl", "tupperware"),
            in_cabinet("cabinet", (np.inf, 0.5), rotation=(-0.2, 0.2)),
            graspable=True,
        ),
        ObjectSpec("meat", ("meat",), on_counter("cabinet", (0.5, 0.4)), graspable=True),
    ),
    goal=AllOf(ObjectTouches("container", "counter"), GripperFar("meat"), ObjectOn("meat", "container")),
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "counter", object="container"),
        Stage("pick_place", "place", "container", object="meat"),
    ),
    instruction="Take the {container} out of the cabinet, set it on the counter and put the {meat} into it.",
    paraphrases=(
        "The {meat} on the counter belongs in the {container}, which is still in the cabinet.",
        "Open the cabinet, bring the {container} down to the counter, and lay the {meat} in it.",
        "Get the cabinet's {container} for the {meat}: onto the counter with it, and the {meat} inside.",
        "Transfer the {meat} into the {container}, once that stands on the counter.",
    ),
)

TASKS = (
    ARRANGE_CUTTING_FRUITS,
    ARRANGE_VEGETABLES,
    BREAD_SETUP_SLICING,
    CLEAR_CUTTING_BOARD,
    MEAT_TRANSFER,
    ORGANIZE_VEGETABLES,
)
