"""Take an object from one place to another: counter, cabinet, drawer, sink, stove, microwave."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Not,
    ObjectInside,
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
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_burner, on_counter, place
from robocasa_lerobot.envs.tasks.task import Task

_TOOLS, _NOT_TOOLS = ("reamer", "strainer", "cheese_grater"), ("tool", "utensil")
_IN_PAN_M = 0.07  # horizontally from the middle of a pan
_PAN = on_burner(SampleRegion(name="any", height=(0.7, 1.2)))
_DOOR_OPEN = (0.90, 1.0)


def _back(ref: str, size: tuple[float, float], offset: tuple[float, float] = (0.0, 0.0)) -> ObjectSpec:
    return ObjectSpec("distr_counter", ("any",), on_counter(ref, size, pos=("ref", 1.0), offset=offset))


CABINET = (
    Task(
        name="PickPlaceCounterToCabinet",
        summary="The object is inside the cabinet, the gripper away.",
        fixtures=(FixtureSpec("cab", "cabinet"), counter_near("cab")),
        robot_start=RobotStart("cab"),
        objects=(
            ObjectSpec("obj", ("any",), on_counter("cab", (0.6, 0.3), offset=(0.0, 0.1)), graspable=True),
            ObjectSpec("distr_counter", ("any",), on_counter("cab", (1.0, 0.3), offset=(0.0, 0.3))),
            ObjectSpec("distr_cab", ("any",), Placement("cab", size=(1.0, 0.2), pos=(0.0, 1.0))),
        ),
        initial=(InitialOpenness("cab", *_DOOR_OPEN),),
        goal=AllOf(ObjectInside("obj", "cab"), GripperFar("obj")),
        stages=place(target="cab"),
        instruction="Take the {obj} off the counter and put it into the cabinet.",
        paraphrases=(
            "The {obj} belongs in the cabinet.",
            "Store the {obj} behind the open cabinet door.",
            "Move the {obj} from the worktop up into the cabinet.",
            "Clear the {obj} away into the cabinet.",
        ),
    ),
    Task(
        name="PickPlaceCabinetToCounter",
        summary="The object is on the counter below the cabinet, the gripper away.",
        fixtures=(FixtureSpec("cab", "cabinet"), counter_near("cab")),
        robot_start=RobotStart("cab"),
        objects=(
            ObjectSpec(
                "obj",
                ("any",),
                in_cabinet("cab", (0.5, 0.2)),
                graspable=True,
            ),
            _back("cab", (1.0, 0.3), (0.0, -0.05)),
            ObjectSpec("distr_cab", ("any",), Placement("cab", size=(1.0, 0.2), pos=(0.0, 1.0))),
        ),
        initial=(InitialOpenness("cab", *_DOOR_OPEN),),
        goal=AllOf(ObjectTouches("obj", "counter"), GripperFar("obj")),
        stages=place(),
        instruction="Take the {obj} out of the cabinet and put it on the counter.",
        paraphrases=(
            "Bring the {obj} from the cabinet to the worktop.",
            "I need the {obj} from the cabinet down on the counter.",
            "The {obj} should stand on the counter instead of in the cabinet.",
            "Fetch the {obj} out of the open cabinet.",
        ),
    ),
)

TOP_DRAWER = (
    Task(
        name="PickPlaceCounterToDrawer",
        summary="The object is inside the drawer and touches no counter, the gripper away.",
        fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
        robot_start=RobotStart("drawer"),
        objects=(
            ObjectSpec("obj", _NOT_TOOLS, on_counter("drawer", (0.6, 0.3)), graspable=True, exclude=_TOOLS),
            ObjectSpec("distr", ("any",), on_counter("drawer", (0.6, 0.3), pos=("ref", -0.5)), exclude=_NOT_TOOLS),
        ),
        initial=(InitialOpenness("drawer", *_DOOR_OPEN),),
        goal=AllOf(ObjectInside("obj", "drawer"), Not(ObjectTouchesAnyCounter("obj")), GripperFar("obj")),
        stages=place(target="drawer"),
        instruction="Take the {obj} off the counter and put it into the drawer.",
        paraphrases=(
            "The {obj} belongs in the open drawer.",
            "Drop the {obj} from the worktop into the drawer.",
            "Clear the {obj} away into the drawer.",
            "Stow the {obj} in the drawer before you.",
        ),
    ),
    Task(
        name="PickPlaceDrawerToCounter",
        summary="The object is on a counter, the gripper away.",
        fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
        robot_start=RobotStart("drawer", setback=0.3),
        objects=(
            ObjectSpec(
                "obj",
                _NOT_TOOLS,
                Placement("drawer", size=(0.3, 0.25), pos=(0.0, -0.25)),
                graspable=True,
                exclude=_TOOLS,
            ),
            ObjectSpec("distr", ("any",), on_counter("drawer", (0.5, 0.3), pos=("ref", -0.5)), exclude=_NOT_TOOLS),
        ),
        initial=(InitialOpenness("drawer", 1.0, 1.0),),
        goal=AllOf(ObjectTouchesAnyCounter("obj"), GripperFar("obj")),
        stages=place(),
        instruction="Take the {obj} out of the drawer and put it on the counter.",
        paraphrases=(
            "Bring the {obj} from the drawer to the worktop.",
            "I need the {obj} from the open drawer up on the counter.",
            "The {obj} should lie on the counter instead of in the drawer.",
            "Fetch the {obj} out of the drawer.",
        ),
    ),
)

SINK = (
    Task(
        name="PickPlaceSinkToCounter",
        summary="The object is on the plate, the plate on the counter, the gripper away.",
        fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
        robot_start=RobotStart("sink"),
        objects=(
            ObjectSpec(
                "obj",
                ("food",),
                Placement("sink", size=(0.25, 0.25), pos=(0.0, 1.0)),
                graspable=True,
                properties=("washable",),
            ),
            ObjectSpec("container", ("plate",), on_counter("sink", (0.35, 0.4), loc="left_right")),
            ObjectSpec("distr_counter", ("any",), on_counter("sink", (0.3, 0.3), loc="left_right", offset=(0.0, 0.3))),
        ),
        goal=AllOf(ObjectOn("obj", "container"), ObjectTouches("container", "counter"), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} out of the sink and put it on the {container} on the counter.",
        paraphrases=(
            "The washed {obj} goes onto the {container} beside the sink.",
            "Bring the {obj} from the basin to the {container}.",
            "Lay the {obj} that is in the sink on the {container}.",
            "Get the {obj} from the sink to the {container} on the worktop.",
        ),
    ),
)

STOVE = (
    Task(
        name="PickPlaceCounterToStove",
        summary="The object is in the pan, the gripper away.",
        fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.3, 0.4))),
        robot_start=RobotStart("stove"),
        objects=(
            ObjectSpec("container", ("pan",), _PAN),
            ObjectSpec(
                "obj",
                ("food",),
                on_counter("stove", (0.3, 0.3), try_to_place_in="plate"),
                graspable=True,
                properties=("cookable",),
            ),
        ),
        goal=AllOf(ObjectOn("obj", "container", within=_IN_PAN_M), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} off the plate and put it into the {container} on the stove.",
        paraphrases=(
            "The {obj} should be cooked: move it into the {container}.",
            "Bring the {obj} from the counter to the {container} on the burner.",
            "Lay the {obj} in the {container} that stands on the stove.",
            "Transfer the {obj} from its plate into the {container}.",
        ),
    ),
    Task(
        name="PickPlaceStoveToCounter",
        summary="The object is in the plate or bowl on the counter, the gripper away.",
        fixtures=(FixtureSpec("stove", "stove"), counter_near("stove", size=(0.3, 0.4))),
        robot_start=RobotStart("stove"),
        objects=(
            ObjectSpec("obj_container", ("pan",), _PAN),
            ObjectSpec(
                "obj",
                ("food",),
                Placement(object="obj_container", size=(0.02, 0.02)),
                graspable=True,
                properties=("cookable",),
                max_size=(0.15, 0.15, None),
            ),
            ObjectSpec("container", ("plate", "bowl"), on_counter("stove", (0.3, 0.3))),
        ),
        goal=AllOf(ObjectOn("obj", "container", within=_IN_PAN_M), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} out of the {obj_container} and put it on the {container} on the counter.",
        paraphrases=(
            "Serve the {obj} from the stove on the {container}.",
            "Bring the {obj} from the {obj_container} to the {container}.",
            "The {obj} is done; it goes onto the {container}.",
            "Move the {obj} off the stove to the {container} beside it.",
        ),
    ),
)

MICROWAVE = (
    Task(
        name="PickPlaceCounterToMicrowave",
        summary="The object is on the plate in the microwave, the gripper away.",
        fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave")),
        robot_start=RobotStart("microwave"),
        objects=(
            ObjectSpec(
                "obj",
                ("food",),
                on_counter("microwave", (0.3, 0.3), try_to_place_in="plate"),
                graspable=True,
                properties=("microwavable",),
            ),
            ObjectSpec(
                "container", ("plate",), Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False)
            ),
            _back("microwave", (0.3, 0.3)),
        ),
        initial=(InitialOpenness("microwave", *_DOOR_OPEN),),
        goal=AllOf(ObjectTouches("obj", "container"), ObjectTouches("container", "microwave"), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} off its plate and put it on the plate in the microwave.",
        paraphrases=(
            "The {obj} should be warmed: move it into the microwave.",
            "Bring the {obj} from the counter into the open microwave.",
            "Lay the {obj} on the plate that is inside the microwave.",
            "Transfer the {obj} to the microwave's plate.",
        ),
    ),
    Task(
        name="PickPlaceMicrowaveToCounter",
        summary="The object is on the plate on the counter, the gripper away.",
        fixtures=(FixtureSpec("microwave", "microwave"), counter_near("microwave")),
        robot_start=RobotStart("microwave"),
        objects=(
            ObjectSpec(
                "obj",
                ("food",),
                Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False, try_to_place_in="plate"),
                graspable=True,
                properties=("microwavable",),
            ),
            ObjectSpec("container", ("plate",), on_counter("microwave", (0.3, 0.3))),
            _back("microwave", (0.3, 0.3)),
        ),
        initial=(InitialOpenness("microwave", *_DOOR_OPEN),),
        goal=AllOf(ObjectOn("obj", "container"), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} out of the microwave and put it on the {container} on the counter.",
        paraphrases=(
            "The {obj} is warm; it goes onto the {container}.",
            "Bring the {obj} from the microwave to the {container}.",
            "Move the {obj} out of the open microwave to the {container} beside it.",
            "Serve the {obj} from the microwave on the {container}.",
        ),
    ),
)

TASKS = (
    *CABINET,
    *TOP_DRAWER,
    *SINK,
    *STOVE,
    *MICROWAVE,
)
