"""Sort utensils."""

import numpy as np

from robocasa_lerobot.envs.predicates import (
    AllOf,
    Beside,
    GripperFar,
    Not,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
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

_LENGTHWISE = (np.pi / 2, np.pi / 2)  # our cutlery lies along x, a drawer's strip for it is as narrow as a hand
_TWINS = {"counter_fork": "drawer_fork", "counter_spoon": "drawer_spoon"}
_FORK_AT_ITS_SIDE = Beside("counter_fork", "counter_spoon", "drawer", across=np.inf, along=np.inf, side="{fork_side}")


def _with_twin(name: str) -> AllOf:
    return AllOf(
        ObjectInside(name, "drawer"),
        Not(ObjectTouchesAnyCounter(name)),
        Beside(name, _TWINS[name], "drawer", across=0.1, along=np.inf),
        GripperFar(name),
    )


def _in_drawer(name: str, kind: str, side: str) -> ObjectSpec:
    start = Placement("drawer", size=(0.1, 0.3), pos=(side, -0.25), rotation=_LENGTHWISE)
    return ObjectSpec(name, (kind,), start, repeats=True)


def _on_top(name: str, kind: str) -> ObjectSpec:
    start = on_counter("drawer", (0.3, 0.3), rotation=_LENGTHWISE)
    return ObjectSpec(name, (kind,), start, scale=(1.0, 1.0, 2.5), repeats=True)


def _to_twin(name: str, kind: str) -> Stage:
    text = f"put the {kind} to the other {kind} in the drawer"
    return Stage("pick_place", "place", "drawer", object=name, until=_with_twin(name), text=text)


CLUSTER_UTENSILS_IN_DRAWER = Task(
    name="ClusterUtensilsInDrawer",
    summary="All four are in the drawer, fork by fork and spoon by spoon, either kind at its side; gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top", size=(0.5, 0.5)), counter_near("drawer")),
    robot_start=RobotStart("counter", at_object="counter_fork"),
    choices=(Choice("fork_side", {"left": {"spoon_side": "right"}, "right": {"spoon_side": "left"}}),),
    objects=(
        _in_drawer("drawer_fork", "fork", "{fork_side}"),
        _in_drawer("drawer_spoon", "spoon", "-{fork_side}"),
        _on_top("counter_fork", "fork"),
        _on_top("counter_spoon", "spoon"),
    ),
    # Published shares are of the slide's range, of which full travel is 0.55.
    initial=(InitialOpenness("drawer", 0.49, 0.55),),
    goal=AllOf(
        AllOf(*(ObjectInside(name, "drawer") for name in (*_TWINS.values(), *_TWINS))),
        AllOf(*(Not(ObjectTouchesAnyCounter(name)) for name in (*_TWINS.values(), *_TWINS))),
        *(Beside(name, twin, "drawer", across=0.1, along=np.inf) for name, twin in _TWINS.items()),
        _FORK_AT_ITS_SIDE,
        *map(GripperFar, _TWINS),
    ),
    stages=(_to_twin("counter_fork", "fork"), _to_twin("counter_spoon", "spoon")),
    instruction=(
        "Put the fork from the counter to the fork on the {fork_side} of the open drawer, and the spoon to the spoon "
        "on its {spoon_side}."
    ),
    paraphrases=(
        "Forks belong on the {fork_side} of the drawer, spoons on the {spoon_side}: put both from the counter there.",
        "Sort the cutlery that lies on the counter into the drawer, with its like.",
        "The drawer has a fork on its {fork_side} and a spoon on its {spoon_side}. Add the other fork and spoon there.",
        "Lay the fork beside the fork and the spoon beside the spoon, all in the drawer.",
    ),
)

TASKS = (ARRANGE_UTENSILS_BY_TYPE, CLUSTER_UTENSILS_IN_DRAWER)
