"""Saute vegetables on the stove."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Grasped,
    MovedSince,
    ObjectOn,
    ObjectTouches,
    OnBurner,
    StepsWhile,
)
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_STIRRED = StepsWhile(
    AllOf(
        Grasped("spatula"),
        OnBurner("pot", "stove", burner="{knob}", lit=True),
        ObjectOn("veg1", "pot"),
        ObjectOn("veg2", "pot"),
        MovedSince("veg1", "step", by_m=0.0005, across=True),
        MovedSince("veg2", "step", by_m=0.0005, across=True),
        ObjectTouches("spatula", "veg1"),
    ),
    5,
    label="vegetables_stirred",
)

STIR_VEGETABLES = Task(
    name="StirVegetables",
    summary="With both in the pot over the lit burner, the held spatula has moved the vegetables in 5 steps in total.",
    fixtures=(FixtureSpec("stove", "stove"), counter_near("stove")),
    robot_start=RobotStart("stove"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec("spatula", ("spatula",), on_counter("stove", (0.5, 0.5)), scale=(1.0, 1.0, 2.0)),
        ObjectSpec(
            "pot",
            ("pot",),
            Placement(
                "stove",
                region=SampleRegion(name="{knob}"),
                size=(0.05, 0.05),
                pos=(0.0, 0.0),
                ensure_inside=False,
            ),
        ),
        ObjectSpec(
            "veg1",
            ("vegetable",),
            Placement(
                "counter",
                region=SampleRegion(ref="stove", loc="left_right", top_size=(0.3, 0.3)),
                size=(0.3, 0.3),
                pos=("ref", -1.0),
            ),
            graspable=True,
        ),
        ObjectSpec(
            "veg2",
            ("vegetable",),
            Placement(
                "counter",
                region=SampleRegion(ref="stove", loc="left_right", top_size=(0.3, 0.3)),
                size=(0.3, 0.3),
                pos=("ref", -0.7),
            ),
            graspable=True,
        ),
    ),
    initial=(BurnerAt("stove", "{knob}", "on"),),
    goal=_STIRRED,
    stages=(
        Stage("pick_place", "place", "pot", object="veg1"),
        Stage("pick_place", "place", "pot", object="veg2"),
        Stage("pick_place", "pick", "counter", object="spatula"),
        Stage("pick_place", "stir", "pot", object="spatula", until=_STIRRED, text="stir in the pot with the spatula"),
    ),
    instruction="Put the {veg1} and the {veg2} into the pot on the stove, then stir them with the spatula.",
    paraphrases=(
        "Saute the {veg1} and the {veg2} in the hot pot, and stir with the spatula.",
        "Both the {veg1} and the {veg2} go into the pot on the lit burner; use the spatula to stir.",
        "Cook the {veg1} with the {veg2}: into the pot with them, then move them about with the spatula.",
        "Take the spatula and stir, once the {veg1} and the {veg2} are in the pot.",
    ),
)

TASKS = (STIR_VEGETABLES,)
