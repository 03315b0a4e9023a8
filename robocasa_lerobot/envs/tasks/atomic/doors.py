"""Doors of cabinets and appliances, heads and lids that turn on a hinge: opened and closed."""

from robocasa_lerobot.envs.initial import PartAt
from robocasa_lerobot.envs.predicates import DoorsClosed, DoorsOpen, PartWithin
from robocasa_lerobot.envs.scene.wanted import FixtureWanted, InitialOpenness, ObjectWanted, Placement, RobotStart
from robocasa_lerobot.envs.task import Stage, Task
from robocasa_lerobot.envs.tasks.atomic.common import COMMON, SEEN, atomic, counter_near, distractors

# A door that folds down is lifted shut, that of a dishwasher from above; the doors of a fridge are too large to reach
# round.
_CLOSING = dict.fromkeys(("oven", "toaster_oven"), "lift_shut") | {"fridge": "close_large", "dishwasher": "lift_low"}
AJAR_AT_MOST, OPEN = (0.0, 0.0), (0.90, 1.0)


def _inside(size: tuple[float, float] = (0.3, 0.3), **more: object) -> ObjectWanted:
    return ObjectWanted("door_obj", ("any",), Placement("fxtr", size=size, pos=(None, -1.0)), graspable=True, **more)  # type: ignore[arg-type]


def _door(
    name: str,
    kind: str,
    horizon: int,
    *,
    inside: ObjectWanted | None = None,
    clutter: bool = True,
    beside: bool = False,
    setback: float = 0.0,
    opened: tuple[float, float] = OPEN,
    sets: tuple[str, ...] = COMMON,
    needs: tuple[str, ...] = (),
) -> Task:
    opens = name.startswith("Open")
    return atomic(
        name,
        horizon,
        "Every door is open by at least 90 % of its range."
        if opens
        else "Every door is within 0.5 % of its range of being shut.",
        fixtures=(FixtureWanted("fxtr", kind), *([counter_near("fxtr")] if clutter else [])),
        start=RobotStart("fxtr", beside=beside, setback=setback),
        objects=(*([inside] if inside else []), *([distractors("fxtr")] if clutter else [])),
        initial=(InitialOpenness("fxtr", *((0.0, 0.0) if opens else opened)),),
        goal=DoorsOpen("fxtr") if opens else DoorsClosed("fxtr"),
        stages=(Stage("doors", "open" if opens else _CLOSING.get(kind, "close"), "fxtr"),),
        sets=sets,
        needs=needs,
    )


_OVEN_DISH = ObjectWanted(
    "door_obj",
    ("oven_ready",),
    Placement("fxtr", size=(1.0, 0.45), pos=(None, -1.0), try_to_place_in="oven_tray"),
    graspable=True,
)

TASKS = (
    _door("OpenCabinet", "cabinet_with_door", 1050, inside=_inside(), sets=SEEN),
    _door("CloseCabinet", "cabinet_with_door", 750, inside=_inside()),
    _door("OpenFridge", "fridge", 900, inside=_inside(properties=("fridgable",)), setback=0.3),
    _door("CloseFridge", "fridge", 900, inside=_inside(properties=("fridgable",)), setback=0.3, sets=SEEN),
    _door("OpenMicrowave", "microwave", 600, inside=_inside(properties=("microwavable",))),
    _door("CloseMicrowave", "microwave", 450, inside=_inside(properties=("microwavable",))),
    _door("OpenOven", "oven", 300, inside=_OVEN_DISH, beside=True, needs=("oven",)),
    _door("CloseOven", "oven", 450, inside=_OVEN_DISH, beside=True, opened=(1.0, 1.0), needs=("oven",)),
    _door("OpenDishwasher", "dishwasher", 450, beside=True),
    _door("CloseDishwasher", "dishwasher", 300, beside=True),
    _door("OpenToasterOvenDoor", "toaster_oven", 450, clutter=False),
    _door("CloseToasterOvenDoor", "toaster_oven", 450, clutter=False, opened=(1.0, 1.0), sets=SEEN),
    atomic(
        "OpenStandMixerHead",
        450,
        "The head is up by more than 99 % of its range.",
        fixtures=(FixtureWanted("stand_mixer", "stand_mixer"),),
        start=RobotStart("stand_mixer"),
        initial=(PartAt("stand_mixer", "head", (0.0, 0.0)),),
        goal=PartWithin("stand_mixer", "head", low=0.99, label="up"),
        stages=(Stage("doors", "raise_head", "stand_mixer"),),
        sets=SEEN,
    ),
    atomic(
        "CloseStandMixerHead",
        450,
        "The head is down to less than 1 % of its range.",
        fixtures=(FixtureWanted("stand_mixer", "stand_mixer"),),
        start=RobotStart("stand_mixer"),
        initial=(PartAt("stand_mixer", "head", (1.0, 1.0)),),
        goal=PartWithin("stand_mixer", "head", high=0.01, label="down"),
        stages=(Stage("doors", "lower_head", "stand_mixer"),),
    ),
    atomic(
        "OpenElectricKettleLid",
        300,
        "The lid is open by at least 95 % of its range; its button makes it spring open.",
        fixtures=(FixtureWanted("electric_kettle", "electric_kettle"),),
        start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (0.0, 0.0)),),
        goal=PartWithin("electric_kettle", "lid", low=0.95, label="open"),
        stages=(Stage("buttons", "press", "electric_kettle", part="lid_button"),),
    ),
    atomic(
        "CloseElectricKettleLid",
        300,
        "The lid is shut to at most 1 % of its range.",
        fixtures=(FixtureWanted("electric_kettle", "electric_kettle"),),
        start=RobotStart("electric_kettle"),
        initial=(PartAt("electric_kettle", "lid", (1.0, 1.0)),),
        goal=PartWithin("electric_kettle", "lid", high=0.01, label="closed"),
        stages=(Stage("doors", "push_lid", "electric_kettle", part="lid"),),
    ),
)
