"""Buttons: microwave, coffee machine, blender."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFarFromPart,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import SwitchedOn
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import MUG_UNDER_SPOUT, counter_near
from robocasa_lerobot.envs.tasks.task import Stage, Task

_HEATED = (
    ObjectSpec(
        "obj",
        ("any",),
        Placement("microwave", size=(0.05, 0.05), pos=(0.0, 0.0), ensure_inside=False, try_to_place_in="plate"),
        properties=("microwavable",),
    ),
)

_MUG_UNDER_SPOUT = ObjectSpec(
    "obj", ("mug",), Placement("coffee_machine", region=SampleRegion(name="cup"), rotation=MUG_UNDER_SPOUT)
)


def _button(
    name: str,
    kind: str,
    summary: str,
    part: str,
    goal: AllOf | StateIs,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
    objects: tuple[ObjectSpec, ...] = (),
    initial: tuple[SwitchedOn | InitialOpenness, ...] = (),
    counter: bool = False,
) -> Task:
    return Task(
        name=name,
        summary=summary,
        fixtures=(FixtureSpec(kind, kind), *([counter_near(kind)] if counter else [])),
        robot_start=RobotStart(kind),
        objects=objects,
        initial=initial,
        goal=goal,
        stages=(Stage("buttons", "press", kind, part=part),),
        instruction=instruction,
        paraphrases=paraphrases,
    )


BUTTONS = (
    _button(
        "TurnOnMicrowave",
        "microwave",
        "The microwave runs, and the gripper is 15 cm away from the button.",
        "start_button",
        AllOf(StateIs("microwave", "on"), GripperFarFromPart("microwave", "start_button")),
        objects=_HEATED,
        instruction="Press the start button of the microwave.",
        paraphrases=(
            "Start the microwave.",
            "The microwave should run.",
            "Push the button that sets the microwave going.",
            "Heat what is in the microwave.",
        ),
    ),
    _button(
        "TurnOffMicrowave",
        "microwave",
        "The microwave is off, and the gripper is 15 cm away from the button.",
        "stop_button",
        AllOf(StateIs("microwave", "on", value=False), GripperFarFromPart("microwave", "stop_button")),
        objects=_HEATED,
        initial=(SwitchedOn("microwave"),),
        instruction="Press the stop button of the microwave.",
        paraphrases=(
            "Stop the microwave.",
            "The microwave should no longer run.",
            "Push the button that ends the microwave's program.",
            "Interrupt the heating in the microwave.",
        ),
    ),
    _button(
        "StartCoffeeMachine",
        "coffee_machine",
        "The machine brews, and the gripper is 15 cm away from the button.",
        "start_button",
        AllOf(StateIs("coffee_machine", "on"), GripperFarFromPart("coffee_machine", "start_button")),
        objects=(_MUG_UNDER_SPOUT,),
        counter=True,
        instruction="Press the button of the coffee machine.",
        paraphrases=(
            "Make coffee into the mug under the machine.",
            "The coffee machine should start to brew.",
            "Begin brewing with the button on the coffee machine.",
            "Get some coffee going.",
        ),
    ),
    _button(
        "TurnOnBlender",
        "blender",
        "The blender runs, with its lid on.",
        "button",
        StateIs("blender", "on"),
        objects=(ObjectSpec("obj", ("fruit",), Placement("blender", size=(0.4, 0.4), margin=0.0), scale=0.8),),
        instruction="Press the power button of the blender.",
        paraphrases=(
            "Blend what is in the jar.",
            "The blender should run.",
            "Switch the blender on by its button.",
            "Get the blender going.",
        ),
    ),
)

TASKS = BUTTONS
