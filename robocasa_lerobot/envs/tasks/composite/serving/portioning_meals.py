"""Share meals out at the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, Exactly, GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
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

TASKS = (PORTION_HOT_DOGS,)
