"""Drawers inside a fridge, and racks of dishwasher, oven and toaster oven."""

from robocasa_lerobot.envs.initial import PartAt
from robocasa_lerobot.envs.predicates import PartWithin, When
from robocasa_lerobot.envs.scene.wanted import (
    Choice,
    FixtureWanted,
    InitialOpenness,
    ObjectWanted,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.task import Stage, Task
from robocasa_lerobot.envs.tasks.atomic.common import COMMON, SEEN, atomic

# Which way a rack is to go, with the words for it; one that is to come out starts half out, one to go in all the way.
DIRECTION = Choice("direction", {"out": {"verb": "Pull"}, "in": {"verb": "Push"}})
STARTS = {"out": (0.5, 0.5), "in": (1.0, 1.0)}
_OUT_FROM, _IN_UP_TO = 0.95, 0.05
FRIDGE_DRAWER = "{drawer}"  # all are at one height
DRAWER = Choice("drawer", of="fridge")

_FRIDGE_OBJECTS = (
    ObjectWanted(
        "distr_drawer",
        ("vegetable", "fruit"),
        Placement("fridge", region=SampleRegion(name=FRIDGE_DRAWER), size=(0.4, 0.2), pos=(0.0, 0.5)),
        graspable=True,
        properties=("fridgable",),
    ),
    ObjectWanted(
        "distr_shelf",
        ("any",),
        Placement("fridge", region=SampleRegion(name="fridge_shelf"), size=(0.4, 0.2), pos=(0.0, 0.0)),
        graspable=True,
        properties=("fridgable",),
    ),
)


def _fridge_drawer(name: str, summary: str, at: tuple[float, float], goal: PartWithin, verb: str) -> Task:
    return atomic(
        name,
        450,
        summary,
        fixtures=(FixtureWanted("fridge", "fridge_with_drawer"),),
        # A drawer that is out would meet a robot at the usual distance.
        start=RobotStart("fridge", setback=0.3),
        choices=(DRAWER,),
        objects=_FRIDGE_OBJECTS,
        initial=(InitialOpenness("fridge", 1.0, 1.0), PartAt("fridge", FRIDGE_DRAWER, at)),
        goal=goal,
        stages=(Stage("racks", verb, "fridge", part=FRIDGE_DRAWER),),
    )


def _rack(
    name: str,
    kind: str,
    horizon: int,
    part: str,
    *,
    choices: tuple[Choice, ...] = (),
    door: tuple[float, float] = (1.0, 1.0),
    sets: tuple[str, ...] = COMMON,
    needs: tuple[str, ...] = (),
) -> Task:
    return atomic(
        name,
        horizon,
        "The rack is out by at least 95 % of its range, or in to at most 5 %, as the instruction says.",
        fixtures=(FixtureWanted(kind, kind),),
        # The open door of a dishwasher, and its rack, take the place in front of it; that of an oven, the nearer part.
        start=RobotStart(kind, beside=kind == "dishwasher", setback=0.35 if kind == "oven" else 0.0),
        choices=(DIRECTION, *choices),
        initial=(InitialOpenness(kind, *door), PartAt(kind, part, STARTS, "direction")),
        goal=When(
            "direction",
            {
                "out": PartWithin(kind, part, low=_OUT_FROM, label="out"),
                "in": PartWithin(kind, part, high=_IN_UP_TO, label="in"),
            },
        ),
        stages=(Stage("racks", "slide", kind, part=part),),
        sets=sets,
        needs=needs,
    )


TASKS = (
    _fridge_drawer(
        "OpenFridgeDrawer",
        "The highest drawer in the fridge is out by at least 70 % of its range.",
        (0.1, 0.3),
        PartWithin("fridge", FRIDGE_DRAWER, low=0.70, label="open"),
        "pull",
    ),
    _fridge_drawer(
        "CloseFridgeDrawer",
        "The highest drawer in the fridge is in to at most 5 % of its range.",
        (0.8, 1.0),
        PartWithin("fridge", FRIDGE_DRAWER, high=0.05, label="closed"),
        "push",
    ),
    _rack("SlideDishwasherRack", "dishwasher", 450, "rack1", door=(0.90, 1.0), sets=SEEN),
    _rack("SlideOvenRack", "oven", 450, "{rack}", choices=(Choice("rack", of="oven"),), needs=("oven",)),
    _rack("SlideToasterOvenRack", "toaster_oven", 300, "{rack}", choices=(Choice("rack", of="toaster_oven"),)),
)
