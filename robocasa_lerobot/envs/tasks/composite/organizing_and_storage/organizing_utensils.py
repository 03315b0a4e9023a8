"""Sort utensils."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Not, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.task import Stage, Task

_WOODEN, _METALLIC = ("wooden_spoon", "wooden_spoon_2"), ("metallic_utensil", "metallic_utensil_2")
_HIGHER = (1.0, 1.0, 2.0)  # flat things, so that they can be held


def _utensil(name: str, groups: tuple[str, ...]) -> ObjectSpec:
    start = Placement(
        "counter",
        region=SampleRegion(top_size=(0.8, 0.5)),
        size=(1.0, 0.5),
        pos=(0.0, -1.0),
        rotation=(0.0, 0.0),
        reuse_region_from="" if name == "wooden_spoon" else "wooden_spoon",
    )
    return ObjectSpec(name, groups, start, scale=_HIGHER, repeats=True)


def _sorted(name: str, fixture: str) -> AllOf:
    return AllOf(ObjectInside(name, fixture), Not(ObjectTouches(name, "counter")), GripperFar(name))


def _sort(name: str, fixture: str) -> Stage:
    return Stage("pick_place", "place", fixture, object=name, until=_sorted(name, fixture))


ARRANGE_UTENSILS_BY_TYPE = Task(
    name="ArrangeUtensilsByType",
    summary="The wooden spoons are in the cabinet, the metallic utensils in the drawer, the gripper away from all.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_with_door"),
        FixtureSpec("drawer", "drawer_top"),
        FixtureSpec("counter", "counter", size=(0.8, 0.5)),
    ),
    robot_start=RobotStart("counter", at_object="wooden_spoon"),
    objects=(
        *(_utensil(name, ("wooden_spoon",)) for name in _WOODEN),
        *(_utensil(name, ("spoon", "fork")) for name in _METALLIC),
    ),
    # Published shares are of the slide's range, of which full travel is 0.55.
    initial=(InitialOpenness("cabinet", 0.9, 1.0), InitialOpenness("drawer", 0.49, 0.55)),
    goal=AllOf(
        *(part for name in _WOODEN for part in _sorted(name, "cabinet").parts),
        *(part for name in _METALLIC for part in _sorted(name, "drawer").parts),
    ),
    stages=(
        *(_sort(name, "cabinet") for name in _WOODEN),
        *(_sort(name, "drawer") for name in _METALLIC),
    ),
    instruction=(
        "Put the wooden spoons from the counter into the open cabinet, and {metallic_utensil+metallic_utensil_2} into "
        "the open drawer."
    ),
    paraphrases=(
        "Sort the utensils by what they are made of: wood into the cabinet, metal into the drawer.",
        "The drawer is for {metallic_utensil+metallic_utensil_2}, the cabinet for both wooden spoons.",
        "Clear the counter of utensils: the cabinet takes the wooden ones, the drawer the metallic ones.",
        "Both wooden spoons belong in the cabinet and both metallic utensils in the drawer.",
    ),
)

TASKS = (ARRANGE_UTENSILS_BY_TYPE,)
