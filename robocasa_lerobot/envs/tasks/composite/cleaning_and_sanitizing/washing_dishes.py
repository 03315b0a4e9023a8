"""Wash dishes in the sink."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInside, StateIs
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task


def _soaks(name: str) -> Stage:
    there = AllOf(ObjectInside(name, "sink"), GripperFar(name))
    return Stage("pick_place", "place", "sink", object=name, until=there)


PRE_SOAK_PAN = Task(
    name="PreSoakPan",
    summary="Pan and sponge are in the basin, water runs, the gripper away from both.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink", size=(0.6, 0.4))),
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec(
            "obj1",
            ("pan",),
            Placement(
                "counter",
                region=SampleRegion(ref="sink", loc="left_right", top_size=(0.6, 0.4)),
                size=(0.35, 0.55),
                pos=("ref", -1.0),
                rotation=HANDLE_TO_FRONT,
            ),
            graspable=True,
            properties=("washable",),
            max_size=(0.45, 0.35, None),  # our pans lie along x
        ),
        ObjectSpec(
            "obj2",
            ("sponge",),
            on_counter("sink", (0.2, 0.3), loc="left_right", offset=(0.0, 0.05)),
            graspable=True,
        ),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(
        StateIs("sink", "water_on"),
        ObjectInside("obj1", "sink"),
        ObjectInside("obj2", "sink"),
        GripperFar("obj1"),
        GripperFar("obj2"),
    ),
    stages=(_soaks("obj1"), _soaks("obj2"), Stage("levers", "on", "sink", part="handle")),
    instruction="Put the pan and the sponge into the sink, then open the faucet to soak them.",
    paraphrases=(
        "Let the pan soak in the sink together with the sponge under running water.",
        "Pan and sponge belong in the basin; turn the water on after that.",
        "Bring the pan beside the sink, and the sponge too, into the basin and run the water.",
        "Soak the dirty pan: into the sink with it and the sponge, then water.",
    ),
)

TASKS = (PRE_SOAK_PAN,)
