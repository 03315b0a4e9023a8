"""Pick and place at ovens, toaster, blender and stand mixer."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside, PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter, place
from robocasa_lerobot.envs.tasks.task import Task

OVENS = (
    Task(
        name="PickPlaceCounterToOven",
        summary="The object is on the tray, the tray on the rack, the gripper away.",
        fixtures=(FixtureSpec("oven", "oven"), counter_near("oven")),
        robot_start=RobotStart("counter", at_object="obj"),
        choices=(Choice("rack", of="oven"),),
        objects=(
            ObjectSpec(
                "obj", ("oven_ready",), on_counter("oven", (0.45, 0.3), try_to_place_in="plate"), graspable=True
            ),
            ObjectSpec(
                "oven_tray",
                ("oven_tray",),
                Placement(
                    "oven", region=SampleRegion(name="{rack}"), size=(1.0, 0.45), pos=(0.0, -1.0), rotation=(-0.1, 0.1)
                ),
            ),
        ),
        initial=(InitialOpenness("oven", 1.0, 1.0), PartAt("oven", "{rack}", (1.0, 1.0))),
        goal=AllOf(ObjectTouches("oven_tray", "oven", part="{rack}"), ObjectOn("obj", "oven_tray"), GripperFar("obj")),
        stages=place(target="oven_tray"),
        instruction="Take the {obj} off the plate and put it on the tray on the {rack} rack of the oven.",
        paraphrases=(
            "The {obj} should be baked: it goes onto the oven's tray.",
            "Bring the {obj} from the counter to the tray on the {rack} rack.",
            "Lay the {obj} on the tray of the open oven.",
            "Transfer the {obj} from its plate to the oven tray.",
        ),
        needs=("oven",),
    ),
    Task(
        name="PickPlaceCounterToToasterOven",
        summary="The object lies on the pulled-out rack, the gripper away.",
        fixtures=(FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven")),
        robot_start=RobotStart("toaster_oven"),
        choices=(Choice("rack", of="toaster_oven"),),
        objects=(
            ObjectSpec(
                "obj",
                ("bread_food",),
                on_counter("toaster_oven", (0.45, 0.3), loc="left_right", try_to_place_in="plate"),
                graspable=True,
                scale=0.8,
            ),
        ),
        initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "{rack}", (1.0, 1.0))),
        goal=AllOf(ObjectTouches("obj", "toaster_oven", part="{rack}"), GripperFar("obj")),
        stages=place(target="toaster_oven", part="{rack}"),
        instruction="Take the {obj} off the plate and put it on the {rack} of the toaster oven.",
        paraphrases=(
            "The {obj} should be toasted: it goes onto the toaster oven's {rack}.",
            "Bring the {obj} from the counter to the pulled-out {rack}.",
            "Lay the {obj} on the {rack} of the open toaster oven.",
            "Transfer the {obj} from its plate to the toaster oven.",
        ),
    ),
    Task(
        name="PickPlaceToasterOvenToCounter",
        summary="The object is on the plate, the plate on the counter, the gripper away.",
        fixtures=(FixtureSpec("toaster_oven", "toaster_oven"), counter_near("toaster_oven")),
        robot_start=RobotStart("toaster_oven"),
        choices=(Choice("rack", of="toaster_oven"),),
        objects=(
            ObjectSpec(
                "obj",
                ("bread_food",),
                Placement("toaster_oven", region=SampleRegion(name="{rack}"), size=(0.5, 0.4), pos=(0.0, -1.0)),
                graspable=True,
                scale=0.8,
            ),
            ObjectSpec("container", ("plate",), on_counter("toaster_oven", (0.3, 0.3), loc="left_right")),
        ),
        initial=(InitialOpenness("toaster_oven", 1.0, 1.0), PartAt("toaster_oven", "{rack}", (1.0, 1.0))),
        goal=AllOf(ObjectOn("obj", "container"), ObjectTouches("container", "counter"), GripperFar("obj")),
        stages=place(target="container"),
        instruction="Take the {obj} off the {rack} of the toaster oven and put it on the plate.",
        paraphrases=(
            "The {obj} is toasted; it goes onto the plate.",
            "Bring the {obj} from the toaster oven to the plate on the counter.",
            "Move the {obj} from the pulled-out {rack} to the plate.",
            "Serve the {obj} from the toaster oven on the plate.",
        ),
    ),
    Task(
        name="PickPlaceToasterToCounter",
        summary="The slice is on the plate, the gripper away.",
        fixtures=(FixtureSpec("toaster", "toaster"), counter_near("toaster")),
        robot_start=RobotStart("toaster"),
        choices=(Choice("slot", of="toaster"),),
        objects=(
            ObjectSpec(
                "obj",
                ("sandwich_bread",),
                Placement(
                    "toaster", region=SampleRegion(name="slot{slot}"), rotation=(0.0, 0.0), margin=0.0, slot=True
                ),
                upright=True,
            ),
            ObjectSpec("plate", ("plate",), on_counter("toaster", (0.8, 0.3))),
        ),
        goal=AllOf(ObjectOn("obj", "plate"), GripperFar("obj")),
        stages=place(target="plate"),
        instruction="Take the bread out of the toaster and put it on the plate.",
        paraphrases=(
            "The toast goes onto the plate.",
            "Bring the slice from the toaster to the plate.",
            "Serve the bread that is in the toaster on the plate.",
            "Lift the slice of bread from its slot and lay it on the plate.",
        ),
    ),
)

BLENDER_AND_MIXER = (
    Task(
        name="PickPlaceCounterToBlender",
        summary="The fruit is in the blender's jar, the gripper away.",
        fixtures=(FixtureSpec("blender", "blender"), counter_near("blender")),
        robot_start=RobotStart("blender"),
        objects=(
            ObjectSpec(
                "obj",
                ("fruit",),
                on_counter("blender", (0.5, 0.25), loc="left_right"),
                graspable=True,
                scale=0.8,
                max_size=(0.085, 0.085, None),
            ),
            ObjectSpec(
                "distr_counter",
                ("any",),
                on_counter("blender", (0.5, 0.3), pos=("ref", -0.5)),
                exclude=("fruit", "vegetable"),
            ),
        ),
        initial=(LidAside("blender", gone=True),),
        goal=AllOf(ObjectInside("obj", "blender"), GripperFar("obj")),
        stages=place(target="blender"),
        instruction="Take the {obj} off the counter and put it into the blender.",
        paraphrases=(
            "The {obj} should go into the blender jar.",
            "Fill the blender with the {obj} from the worktop.",
            "Let the {obj} drop into the open blender.",
            "Bring the {obj} from the counter into the blender.",
        ),
    ),
    Task(
        name="PickPlaceCounterToStandMixer",
        summary="The object is in the lower half of the mixer's bowl, the gripper away.",
        fixtures=(FixtureSpec("stand_mixer", "stand_mixer"), counter_near("stand_mixer")),
        robot_start=RobotStart("stand_mixer"),
        objects=(
            ObjectSpec(
                "obj",
                ("cheese", "bread", "cake"),
                on_counter("stand_mixer", (0.3, 0.3), loc="left_right"),
                graspable=True,
            ),
        ),
        initial=(PartAt("stand_mixer", "head", (1.0, 1.0)),),
        goal=AllOf(ObjectInside("obj", "stand_mixer", lower=0.5), GripperFar("obj")),
        stages=place(target="stand_mixer"),
        instruction="Take the {obj} off the counter and put it into the bowl of the stand mixer.",
        paraphrases=(
            "The {obj} should go into the mixer's bowl.",
            "Fill the mixing bowl with the {obj} from the worktop.",
            "Let the {obj} drop into the bowl under the mixer's head.",
            "Bring the {obj} from the counter into the stand mixer.",
        ),
    ),
    Task(
        name="OpenBlenderLid",
        summary="The lid lies on a counter, the gripper 15 cm away.",
        fixtures=(FixtureSpec("blender", "blender"), counter_near("blender")),
        robot_start=RobotStart("blender"),
        goal=AllOf(
            ObjectTouchesAnyCounter("{blender}_lid"),
            StateIs("blender", "lid", value=False),
            GripperFar("{blender}_lid", 0.15),
        ),
        stages=place("{blender}_lid", "blender", verb="uncover"),
        instruction="Take the lid off the blender and lay it on the counter.",
        paraphrases=(
            "Uncover the blender; its lid goes onto the worktop.",
            "The blender's lid should lie on the counter.",
            "Lift off the cover of the blender and put it aside.",
            "Open the blender jar and leave the lid beside it.",
        ),
    ),
    Task(
        name="CloseBlenderLid",
        summary="The lid sits on the jar, the gripper 15 cm away.",
        fixtures=(FixtureSpec("blender", "blender"), counter_near("blender")),
        robot_start=RobotStart("blender"),
        initial=(LidAside("blender"),),
        goal=AllOf(StateIs("blender", "lid"), GripperFar("{blender}_lid", 0.15)),
        stages=place("{blender}_lid", "blender", verb="cover"),
        instruction="Put the lid on the blender.",
        paraphrases=(
            "Cover the blender jar.",
            "The blender's lid belongs on top of the jar.",
            "Pick the blender lid up from the counter and close the jar with it.",
            "Get the blender closed.",
        ),
    ),
)

TASKS = (
    *OVENS,
    *BLENDER_AND_MIXER,
)
