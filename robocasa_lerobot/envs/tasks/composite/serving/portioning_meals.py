"""Share meals out at the dining counter."""

import numpy as np

from robocasa_lerobot.envs.predicates import AllOf, Exactly, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, on_burner
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BUNS, _SAUSAGES = ("hotdog_bun1", "hotdog_bun2"), ("sausage1", "sausage2")


def _plate(name: str, stool: str, rotation: tuple[float, float] = Placement().rotation) -> ObjectSpec:
    start = Placement(
        "dining_counter", region=SampleRegion(ref=stool), size=(0.4, 0.4), pos=("ref", "ref"), rotation=rotation
    )
    return ObjectSpec(name, ("plate",), start, repeats=True)


def _in_bowl(name: str, group: str) -> ObjectSpec:
    return ObjectSpec(name, (group,), Placement(object="bowl", heaped=True), graspable=True, repeats=True)


def _one_on(plate: str, names: tuple[str, ...]) -> Exactly:
    return Exactly(1, *(ObjectOn(name, plate) for name in names))


PORTION_HOT_DOGS = Task(
    name="PortionHotDogs",
    summary="On each of the two plates lie exactly one bun and one sausage, the gripper away from all four.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="bowl"),
    objects=(
        _plate("plate1", "stool1", (0.0, 0.0)),
        _plate("plate2", "stool2"),
        ObjectSpec(
            "bowl", ("bowl",), Placement("dining_counter", size=(1.0, 0.6), pos=(0.0, 1.0)), scale=(1.5, 1.5, 1.0)
        ),
        *(_in_bowl(name, "hotdog_bun") for name in _BUNS),
        *(_in_bowl(name, "sausage") for name in _SAUSAGES),
    ),
    goal=AllOf(
        *(_one_on(plate, names) for plate in ("plate1", "plate2") for names in (_BUNS, _SAUSAGES)),
        *(GripperFar(name) for name in (*_BUNS, *_SAUSAGES)),
    ),
    stages=(
        Stage("pick_place", "place", "plate1", object="hotdog_bun1"),
        Stage("pick_place", "place", "plate1", object="sausage1"),
        Stage("pick_place", "place", "plate2", object="hotdog_bun2"),
        Stage("pick_place", "place", "plate2", object="sausage2"),
    ),
    instruction="Put one bun and one sausage from the bowl on each of the two plates.",
    paraphrases=(
        "Portion the hot dogs: every plate gets a bun and a sausage.",
        "Share the buns and sausages in the bowl out between the plates, one of each per plate.",
        "Lay a sausage and a bun on either plate at the dining counter.",
        "Serve two hot dogs, a bun and a sausage on each plate, out of the bowl.",
    ),
)

_FRUITS = ("fruit1", "fruit2", "fruit3", "fruit4")
_BOWLS = ("bowl1", "bowl2")


def _bowl(name: str, stool: str) -> ObjectSpec:
    return ObjectSpec(name, ("bowl",), before_stool((1.0, 0.4), stool=stool), repeats=True)


PORTION_FRUIT_BOWL = Task(
    name="PortionFruitBowl",
    summary="Each of the two bowls has exactly two of the fruits, the gripper away from all four.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="plate"),
    objects=(
        ObjectSpec("plate", ("plate",), before_stool((1.0, 0.35), stool="stool1", pos=(0.0, -1.0)), scale=1.25),
        _bowl("bowl1", "stool1"),
        _bowl("bowl2", "stool2"),
        *(
            ObjectSpec(name, ("fruit",), Placement(object="plate", heaped=True), graspable=True, repeats=True)
            for name in _FRUITS
        ),
    ),
    goal=AllOf(
        *(Exactly(2, *(ObjectOn(name, bowl) for name in _FRUITS)) for bowl in _BOWLS), *map(GripperFar, _FRUITS)
    ),
    stages=tuple(
        Stage("pick_place", "place", bowl, object=name)
        for bowl, names in zip(_BOWLS, (_FRUITS[:2], _FRUITS[2:]), strict=True)
        for name in names
    ),
    instruction="Put two of the four fruits on the plate into one bowl and two into the other.",
    paraphrases=(
        "Share the plate's fruit equally between the two bowls.",
        "Either bowl gets two fruits from the plate.",
        "Divide {fruit1+fruit2+fruit3+fruit4}: two into each bowl.",
        "Fill both bowls with fruit, the same number in each, until the plate is empty.",
    ),
)

_YOGURTS = {
    "yogurt1": ("stool1", 0.25),
    "yogurt2": ("stool1", -0.25),
    "yogurt3": ("stool2", -0.25),
    "yogurt4": ("stool2", 0.25),
}
_PLATES = ("plate1", "plate2")

PORTION_YOGURT = Task(
    name="PortionYogurt",
    summary="On each of the two plates stand exactly two of the yogurts, the gripper away from all four.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="plate1"),
    objects=(
        *(
            ObjectSpec(f"plate{number}", ("plate",), before_stool((0.5, 0.35), stool=f"stool{number}"), repeats=True)
            for number in (1, 2)
        ),
        *(
            ObjectSpec(
                name, ("yogurt",), before_stool((0.5, 0.4), stool=stool, pos=(x, -1.0)), graspable=True, repeats=True
            )
            for name, (stool, x) in _YOGURTS.items()
        ),
    ),
    goal=AllOf(
        *(Exactly(2, *(ObjectOn(name, plate) for name in _YOGURTS)) for plate in _PLATES), *map(GripperFar, _YOGURTS)
    ),
    stages=tuple(
        Stage("pick_place", "place", stool.replace("stool", "plate"), object=name)
        for name, (stool, _) in _YOGURTS.items()
    ),
    instruction="Put two of the four yogurts on one plate and two on the other.",
    paraphrases=(
        "Share the yogurts equally between the two plates.",
        "Either plate on the dining counter gets two yogurts.",
        "Portion the four yogurts: two for each plate.",
        "Serve yogurt on both plates, the same number on each, until none is left beside them.",
    ),
)


_DRUMSTICKS = ("chicken_drumstick1", "chicken_drumstick2")

DISTRIBUTE_CHICKEN = Task(
    name="DistributeChicken",
    summary="On each of the two plates lies exactly one of the drumsticks, the gripper away from both.",
    fixtures=(
        FixtureSpec("stove", "stove"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("stove", at_object="pan"),
    choices=(Choice("knob", of="stove"),),
    objects=(
        ObjectSpec(
            "pan",
            ("pan",),
            on_burner(size_m=0.05, rotation=HANDLE_TO_FRONT),
            scale=1.25,
        ),
        *(
            ObjectSpec(f"plate{number}", ("plate",), before_stool((0.35, 0.35), stool=f"stool{number}"), repeats=True)
            for number in (1, 2)
        ),
        *(
            ObjectSpec(name, ("chicken_drumstick",), Placement(object="pan", heaped=True), graspable=True, repeats=True)
            for name in _DRUMSTICKS
        ),
    ),
    goal=AllOf(
        *(Exactly(1, *(ObjectOn(name, plate) for name in _DRUMSTICKS)) for plate in _PLATES),
        *map(GripperFar, _DRUMSTICKS),
    ),
    stages=(
        *fetch("chicken_drumstick1", "stove", "plate1"),
        Stage("navigation", "drive", "stove"),
        *fetch("chicken_drumstick2", "stove", "plate2"),
    ),
    instruction="Put one of the two drumsticks in the pan on each of the plates on the dining counter.",
    paraphrases=(
        "Share the drumsticks out: one for either plate on the dining counter.",
        "Carry the drumsticks from the stove to the dining counter, one to each plate.",
        "Each plate gets a drumstick from the pan on the stove.",
        "Serve the chicken: a drumstick on this plate, a drumstick on that one.",
    ),
)

_COOKED, _VEGETABLES = ("cooked_food1", "cooked_food2"), ("vegetable1", "vegetable2")
_BOXES = ("tupperware1", "tupperware2")


def _portion(name: str) -> ObjectSpec:
    group = name.rstrip("12")
    return ObjectSpec(
        name,
        (group,),
        Placement(object="plate", heaped=True),
        graspable=True,
        exclude=("kebab_skewer",) if group == "cooked_food" else (),
        repeats=True,
    )


PORTION_IN_TUPPERWARE = Task(
    name="PortionInTupperware",
    summary="Each of the two boxes has exactly one cooked food and one vegetable, the gripper away from all four.",
    fixtures=(
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("dining_counter", at_object="plate"),
    objects=(
        *(
            ObjectSpec(
                name,
                ("tupperware",),
                before_stool(
                    (1.0, 0.5),
                    stool=name.replace("tupperware", "stool"),
                    pos=("ref", -1.0),
                    rotation=(np.pi / 2, np.pi / 2),
                ),
                scale=(1.75, 1.75, 1.0),
                repeats=True,
            )
            for name in _BOXES
        ),
        ObjectSpec("plate", ("plate",), before_stool((1.0, 0.45), stool="stool1", pos=(0.0, -1.0)), scale=1.5),
        *map(_portion, (*_COOKED, *_VEGETABLES)),
    ),
    goal=AllOf(
        *(Exactly(1, *(ObjectOn(name, box) for name in names)) for box in _BOXES for names in (_COOKED, _VEGETABLES)),
        *map(GripperFar, (*_COOKED, *_VEGETABLES)),
    ),
    stages=tuple(
        Stage("pick_place", "place", box, object=name)
        for box, names in zip(_BOXES, zip(_COOKED, _VEGETABLES, strict=True), strict=True)
        for name in names
    ),
    instruction="Put one cooked food and one vegetable from the plate into each of the two boxes.",
    paraphrases=(
        "Portion the plate's food: either box gets a cooked thing and a vegetable.",
        "Fill both boxes on the dining counter alike, with one cooked food and one vegetable each.",
        "Share out {cooked_food1}, {cooked_food2}, {vegetable1} and {vegetable2}: a vegetable in every box, and a "
        "cooked food too.",
        "Two boxes, two cooked foods, two vegetables: one of each kind goes into each box.",
    ),
)

TASKS = (DISTRIBUTE_CHICKEN, PORTION_FRUIT_BOWL, PORTION_HOT_DOGS, PORTION_IN_TUPPERWARE, PORTION_YOGURT)
