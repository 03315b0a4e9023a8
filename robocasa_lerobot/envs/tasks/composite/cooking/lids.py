"""What tasks with the lid of a saucepan share."""

from __future__ import annotations

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches, ObjectUpright, OnBurner
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_burner
from robocasa_lerobot.envs.tasks.task import Stage, Task

TASKS: tuple[Task, ...] = ()
PAN, LID = "saucepan", "saucepan_auxiliary"
ON_ITS_PAN = Placement(object=PAN)
ON_THE_PAN_M = 0.02  # of the lid's middle from the saucepan's
FRONT_BURNER = Choice("knob", of="stove", beginning="front")
STOVE_AND_COUNTER = (FixtureSpec("stove", "stove"), counter_near("stove"))
ON_LIT_BURNER = OnBurner(PAN, "stove", burner="{knob}", lit=True, within=0.08)
# It lies level: one that leans in the saucepan covers nothing.
COVERED = AllOf(ObjectOn(LID, PAN, within=ON_THE_PAN_M), ObjectUpright(LID), GripperFar(LID))
COVERS = Stage("pick_place", "place", PAN, object=LID, until=COVERED)
UNCOVERS = Stage(
    "pick_place",
    "place",
    "counter",
    object=LID,
    until=AllOf(ObjectTouches(LID, "counter"), GripperFar(LID)),
    text="take the saucepan lid off its pan and lay it on the counter",
)


def saucepan(
    filled: str, *, rotation: tuple[float, float] | None = None, scale: float = 1.0, graspable: bool = False
) -> ObjectSpec:
    """The saucepan with a lid, on the burner that was drawn; by default its handle is left or right of the front."""
    start = on_burner(size_m=0.05, rotation=rotation)
    return ObjectSpec(PAN, ("saucepan_with_lid",), start, graspable=graspable, scale=scale, filled=filled)


def lid(start: Placement, *, scale: float = 1.0) -> ObjectSpec:
    """The lid of that saucepan, which has its scale."""
    return ObjectSpec(LID, ("saucepan_lid",), start, graspable=True, scale=scale, part_of=PAN)


def on_plate(plate: str) -> Placement:
    """On a plate beside what lies there, or on that where there is no room beside it: our plates are small for two."""
    return Placement(object=plate, ensure_inside=False, heaped=True)
