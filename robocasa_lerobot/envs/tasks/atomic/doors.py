"""Doors of cabinets and appliances, heads and lids that turn on a hinge: opened and closed."""

from robocasa_lerobot.envs.predicates import DoorsClosed, DoorsOpen, PartWithin
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, distractors
from robocasa_lerobot.envs.tasks.task import Stage, Task

# A door that folds down is lifted shut, that of a dishwasher from above; the doors of a fridge are too large to reach
# round.
_CLOSING = dict.fromkeys(("oven", "toaster_oven"), "lift_shut") | {"fridge": "close_large", "dishwasher": "lift_low"}
# Of a fixture with several compartments, the one that is meant: a fridge's freezer stays shut.
_PART = {"fridge": "fridge"}
AJAR_AT_MOST, OPEN = (0.0, 0.0), (0.90, 1.0)


def _inside(region: str = "", **more: object) -> ObjectSpec:
    start = Placement("fxtr", region=SampleRegion(name=region), size=(0.3, 0.3), pos=(None, -1.0))
    return ObjectSpec("door_obj", ("any",), start, graspable=True, **more)  # type: ignore[arg-type]


def _door(
    name: str,
    kind: str,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
    inside: ObjectSpec | None = None,
    clutter: bool = True,
    beside: bool = False,
    setback: float = 0.0,
    opened: tuple[float, float] = OPEN,
    needs: tuple[str, ...] = (),
) -> Task:
    opens, part = name.startswith("Open"), _PART.get(kind, "")
    which = f"Every door of the {part} compartment" if part else "Every door"
    return Task(
        name=name,
        summary=f"{which} is open by at least 90 % of its range."
        if opens
        else f"{which} is within 0.5 % of its range of being shut.",
        fixtures=(FixtureSpec("fxtr", kind), *([counter_near("fxtr")] if clutter else [])),
        robot_start=RobotStart("fxtr", beside=beside, setback=setback),
        objects=(*([inside] if inside else []), *([distractors("fxtr")] if clutter else [])),
        initial=(InitialOpenness("fxtr", *((0.0, 0.0) if opens else opened), part=part),),
        goal=DoorsOpen("fxtr", part=part) if opens else DoorsClosed("fxtr", part=part),
        stages=(Stage("doors", "open" if opens else _CLOSING.get(kind, "close"), "fxtr", part=part),),
        instruction=instruction,
        paraphrases=paraphrases,
        needs=needs,
    )


_OVEN_DISH = ObjectSpec(
    "door_obj",
    ("oven_ready",),
    Placement(
        "fxtr", region=SampleRegion(name="rack"), size=(1.0, 0.45), pos=(None, -1.0), try_to_place_in="oven_tray"
    ),
    graspable=True,
)

TASKS = (
    _door(
        "OpenCabinet",
        "cabinet_with_door",
        inside=_inside(),
        instruction="Open the cabinet {doors}.",
        paraphrases=(
            "The cabinet in front of you should stand wide open.",
            "Swing the cabinet {doors} out as far as possible.",
            "Give me access to the inside of the cabinet.",
            "Take hold of the cabinet and open it up.",
        ),
    ),
    _door(
        "CloseCabinet",
        "cabinet_with_door",
        inside=_inside(),
        instruction="Close the cabinet {doors}.",
        paraphrases=(
            "The cabinet should be shut again.",
            "Swing the cabinet {doors} back until nothing is left open.",
            "Hide what is in the cabinet by shutting it.",
            "Leave no gap at the cabinet.",
        ),
    ),
    _door(
        "OpenFridge",
        "fridge",
        inside=_inside("fridge_shelf:any", properties=("fridgable",)),
        setback=0.3,
        instruction="Open the fridge {fridge_doors}.",
        paraphrases=(
            "I need to see into the fridge.",
            "Swing the {fridge_doors} of the refrigerator out as far as possible.",
            "The fridge should stand wide open.",
            "Get the refrigerator open.",
        ),
    ),
    _door(
        "CloseFridge",
        "fridge",
        inside=_inside("fridge_shelf:any", properties=("fridgable",)),
        setback=0.3,
        instruction="Close the fridge {fridge_doors}.",
        paraphrases=(
            "The fridge is losing its cold; shut it.",
            "Swing the {fridge_doors} of the refrigerator back until shut.",
            "No door of the fridge should be left open.",
            "Get the refrigerator closed.",
        ),
    ),
    _door(
        "OpenMicrowave",
        "microwave",
        inside=_inside(properties=("microwavable",)),
        instruction="Open the door of the microwave.",
        paraphrases=(
            "The microwave should stand wide open.",
            "Swing out the door on the microwave.",
            "I want to put something into the microwave; open it.",
            "Make the inside of the microwave reachable.",
        ),
    ),
    _door(
        "CloseMicrowave",
        "microwave",
        inside=_inside(properties=("microwavable",)),
        instruction="Close the door of the microwave.",
        paraphrases=(
            "The microwave door should be shut.",
            "Swing the microwave door back to the case.",
            "Get the microwave ready by shutting its door.",
            "Leave the microwave closed.",
        ),
    ),
    _door(
        "OpenOven",
        "oven",
        inside=_OVEN_DISH,
        beside=True,
        needs=("oven",),
        instruction="Open the oven door.",
        paraphrases=(
            "Fold the front of the oven down.",
            "The oven should stand open.",
            "Lower the door of the oven all the way.",
            "Get the oven open so that a tray fits in.",
        ),
    ),
    _door(
        "CloseOven",
        "oven",
        inside=_OVEN_DISH,
        beside=True,
        opened=(1.0, 1.0),
        needs=("oven",),
        instruction="Close the oven door.",
        paraphrases=(
            "Fold the front of the oven up.",
            "The oven should be shut.",
            "Raise the door of the oven until it meets the frame.",
            "Keep the heat in by shutting the oven.",
        ),
    ),
    _door(
        "OpenDishwasher",
        "dishwasher",
        beside=True,
        instruction="Open the dishwasher door.",
        paraphrases=(
            "Fold the dishwasher's front down.",
            "The dishwasher should stand open for loading.",
            "Lower the door of the dishwasher all the way.",
            "Get the dishwasher open.",
        ),
    ),
    _door(
        "CloseDishwasher",
        "dishwasher",
        beside=True,
        instruction="Close the dishwasher door.",
        paraphrases=(
            "Fold the dishwasher's front up.",
            "The dishwasher should be shut.",
            "Raise the door of the dishwasher until it is flush.",
            "Get the dishwasher closed.",
        ),
    ),
    _door(
        "OpenToasterOvenDoor",
        "toaster_oven",
        clutter=False,
        instruction="Open the toaster oven.",
        paraphrases=(
            "Fold down the door of the toaster oven.",
            "The toaster oven should stand open.",
            "Lower the glass door of the toaster oven all the way.",
            "Get the toaster oven ready to be filled by opening it.",
        ),
    ),
    _door(
        "CloseToasterOvenDoor",
        "toaster_oven",
        clutter=False,
        opened=(1.0, 1.0),
        instruction="Close the toaster oven.",
        paraphrases=(
            "Fold up the door of the toaster oven.",
            "The toaster oven should be shut.",
            "Raise the glass door of the toaster oven until it snaps to.",
            "Leave the toaster oven closed.",
        ),
    ),
    Task(
        name="OpenStandMixerHead",
        summary="The head is up by more than 99 % of its range.",
        fixtures=(FixtureSpec("stand_mixer", "stand_mixer"),),
        robot_start=RobotStart("stand_mixer"),
        initial=(PartAt("stand_mixer", "head", (0.0, 0.0)),),
        goal=PartWithin("stand_mixer", "head", low=0.99, label="up"),
        stages=(Stage("doors", "raise_head", "stand_mixer"),),
        instruction="Raise the head of the stand mixer.",
        paraphrases=(
            "Tip the mixer's head back.",
            "The bowl of the stand mixer should be free from above.",
            "Unlock the stand mixer and lift its head.",
            "Get the top part of the mixer up.",
        ),
    ),
    Task(
        name="CloseStandMixerHead",
        summary="The head is down to less than 1 % of its range.",
        fixtures=(FixtureSpec("stand_mixer", "stand_mixer"),),
        robot_start=RobotStart("stand_mixer"),
        initial=(PartAt("stand_mixer", "head", (1.0, 1.0)),),
        goal=PartWithin("stand_mixer", "head", high=0.01, label="down"),
        stages=(Stage("doors", "lower_head", "stand_mixer"),),
        instruction="Bring the head of the stand mixer down.",
        paraphrases=(
            "Tip the mixer's head forward until it is level.",
            "The stand mixer should be ready to stir: put its head down.",
            "Press the raised head of the mixer down.",
            "Get the top part of the mixer back over the bowl.",
        ),
    ),
    Task(
        name="OpenElectricKettleLid",
        summary="The lid is open by at least 95 % of its range; its button makes it spring open.",
        fixtures=(FixtureSpec("electric_kettle", "electric_kettle"),),
        robot_start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (0.0, 0.0)),),
        goal=PartWithin("electric_kettle", "lid", low=0.95, label="open"),
        stages=(Stage("buttons", "press", "electric_kettle", part="lid_button"),),
        instruction="Open the lid of the electric kettle with its button.",
        paraphrases=(
            "Make the kettle's lid pop up.",
            "The electric kettle needs filling; open it.",
            "Use the release of the kettle lid.",
            "Get the top of the electric kettle open.",
        ),
    ),
    Task(
        name="CloseElectricKettleLid",
        summary="The lid is shut to at most 1 % of its range.",
        fixtures=(FixtureSpec("electric_kettle", "electric_kettle"),),
        robot_start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (1.0, 1.0)),),
        goal=PartWithin("electric_kettle", "lid", high=0.01, label="closed"),
        stages=(Stage("doors", "push_lid", "electric_kettle", part="lid"),),
        instruction="Close the lid of the electric kettle.",
        paraphrases=(
            "Push the kettle's lid back down.",
            "The electric kettle should be covered.",
            "Snap the lid of the kettle shut.",
            "Get the top of the electric kettle closed.",
        ),
    ),
)
