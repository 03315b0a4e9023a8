"""Drawers inside a fridge, and racks of dishwasher, oven and toaster oven."""

from robocasa_lerobot.envs.predicates import PartWithin, When
from robocasa_lerobot.envs.scene.initial_states import PartAt
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.conditions import IN_UP_TO, OUT_FROM
from robocasa_lerobot.envs.tasks.task import Stage, Task

# In which direction a rack slides, with the words for it; one to be pulled starts half out, one to be pushed fully out.
DIRECTION = Choice("direction", {"out": {"verb": "Pull"}, "in": {"verb": "Push"}})
STARTS = {"out": (0.5, 0.5), "in": (1.0, 1.0)}
FRIDGE_DRAWER = "{drawer}"  # all are at one height
DRAWER = Choice("drawer", of="fridge")

_FRIDGE_OBJECTS = (
    ObjectSpec(
        "distr_drawer",
        ("vegetable", "fruit"),
        Placement("fridge", region=SampleRegion(name=FRIDGE_DRAWER), size=(0.4, 0.2), pos=(0.0, 0.5)),
        graspable=True,
        properties=("fridgable",),
    ),
    ObjectSpec(
        "distr_shelf",
        ("any",),
        Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.4, 0.2), pos=(0.0, 0.0)),
        graspable=True,
        properties=("fridgable",),
    ),
)


def _fridge_drawer(
    name: str,
    summary: str,
    at: tuple[float, float],
    goal: PartWithin,
    verb: str,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
) -> Task:
    return Task(
        name=name,
        summary=summary,
        fixtures=(FixtureSpec("fridge", "fridge_with_drawer"),),
        robot_start=RobotStart("fridge", setback=0.3),
        choices=(DRAWER,),
        objects=_FRIDGE_OBJECTS,
        initial=(InitialOpenness("fridge", 1.0, 1.0, part="fridge"), PartAt("fridge", FRIDGE_DRAWER, at)),
        goal=goal,
        stages=(Stage("racks", verb, "fridge", part=FRIDGE_DRAWER),),
        instruction=instruction,
        paraphrases=paraphrases,
    )


def _rack(
    name: str,
    kind: str,
    part: str,
    *,
    instruction: str,
    paraphrases: tuple[str, ...],
    choices: tuple[Choice, ...] = (),
    door: tuple[float, float] = (1.0, 1.0),
    needs: tuple[str, ...] = (),
) -> Task:
    return Task(
        name=name,
        summary="The rack is out by at least 95 % of its range, or in to at most 5 %, as the instruction says.",
        fixtures=(FixtureSpec(kind, kind),),
        robot_start=RobotStart(kind, beside=kind == "dishwasher", setback=0.35 if kind == "oven" else 0.0),
        choices=(DIRECTION, *choices),
        initial=(InitialOpenness(kind, *door), PartAt(kind, part, STARTS, "direction")),
        goal=When(
            "direction",
            {
                "out": PartWithin(kind, part, low=OUT_FROM, label="out"),
                "in": PartWithin(kind, part, high=IN_UP_TO, label="in"),
            },
        ),
        stages=(Stage("racks", "slide", kind, part=part, to="{direction}"),),
        instruction=instruction,
        paraphrases=paraphrases,
        needs=needs,
    )


TASKS = (
    _fridge_drawer(
        "OpenFridgeDrawer",
        "The highest drawer in the fridge is out by at least 70 % of its range.",
        (0.1, 0.3),
        PartWithin("fridge", FRIDGE_DRAWER, low=0.70, label="open"),
        "pull",
        instruction="Pull the fridge drawer out all the way.",
        paraphrases=(
            "The half-open drawer in the fridge should be fully out.",
            "Slide the drawer of the refrigerator further open.",
            "Draw the vegetable drawer in the fridge towards you.",
            "Get the fridge drawer completely open.",
        ),
    ),
    _fridge_drawer(
        "CloseFridgeDrawer",
        "The highest drawer in the fridge is in to at most 5 % of its range.",
        (0.8, 1.0),
        PartWithin("fridge", FRIDGE_DRAWER, high=0.05, label="closed"),
        "push",
        instruction="Push the drawer in the fridge shut.",
        paraphrases=(
            "Slide the refrigerator's drawer back.",
            "The drawer inside the fridge should be closed.",
            "Put the fridge drawer back to where it belongs.",
            "No part of the fridge drawer should stick out.",
        ),
    ),
    _rack(
        "SlideDishwasherRack",
        "dishwasher",
        "rack1",
        door=(0.90, 1.0),
        instruction="{verb} the top rack of the dishwasher all the way {direction}.",
        paraphrases=(
            "Make the upper dishwasher rack go {direction} completely.",
            "The dishwasher's top rack should be all the way {direction}.",
            "Slide the upper basket of the dishwasher {direction} until it stops.",
            "Move the dishwasher's upper rack {direction}.",
        ),
    ),
    _rack(
        "SlideOvenRack",
        "oven",
        "{rack}",
        choices=(Choice("rack", of="oven"),),
        needs=("oven",),
        instruction="{verb} the {rack} rack of the oven all the way {direction}.",
        paraphrases=(
            "Make the oven's {rack} rack go {direction} completely.",
            "The {rack} rack in the oven should be all the way {direction}.",
            "Slide the {rack} grid of the oven {direction} until it stops.",
            "Move the oven's {rack} rack {direction}.",
        ),
    ),
    _rack(
        "SlideToasterOvenRack",
        "toaster_oven",
        "{rack}",
        choices=(Choice("rack", of="toaster_oven"),),
        instruction="{verb} the {rack} of the toaster oven all the way {direction}.",
        paraphrases=(
            "Make the toaster oven's {rack} go {direction} completely.",
            "The {rack} in the toaster oven should be all the way {direction}.",
            "Slide the {rack} of the toaster oven {direction} until it stops.",
            "Move the toaster oven's {rack} {direction}.",
        ),
    ),
)
