"""Sort what is recycled."""

from robocasa_lerobot.envs.predicates import AllOf, Goal, GripperFar, Near, ObjectOn, ObjectTouches, RestsOn, When
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near
from robocasa_lerobot.envs.tasks.composite.common import before_stool
from robocasa_lerobot.envs.tasks.task import Stage, Task

_PLASTIC, _GLASS = ("bottle_plastic1", "bottle_plastic2"), ("bottle_glass1", "bottle_glass2")
_GROUPS = {"plastic": _PLASTIC, "glass": _GLASS}
_MIDDLE = ("bottle_plastic_middle", "bottle_glass_middle", "mystery_middle")
_BOTTLES = (*_PLASTIC, *_GLASS, *_MIDDLE)
_WITHIN_M = 0.3
_BESIDE_M = 0.15  # of the second bottle of a group from the first one's place, farther to the right


def _before(stool: str, shift_m: float = 0.0) -> Placement:
    region = SampleRegion(ref=stool)
    return Placement("dining_counter", region=region, size=(0.3, 0.3), pos=("ref", -0.95), offset=(shift_m, 0.0))


def _bottle(name: str, group: str, start: Placement) -> ObjectSpec:
    return ObjectSpec(name, (group,), start, graspable=True, repeats=True)


def _group(names: tuple[str, ...], group: str, stool: str) -> tuple[ObjectSpec, ...]:
    starts = (_before(stool), _before(stool, _BESIDE_M))
    return tuple(_bottle(name, group, start) for name, start in zip(names, starts, strict=True))


def _sort(name: str, near: Goal, kind: str) -> Stage:
    until = AllOf(near, ObjectTouches(name, "dining_counter"), GripperFar(name))
    return Stage(
        "pick_place",
        "place",
        "dining_counter",
        object=name,
        until=until,
        text=f"put the {{{name}}} with the {kind} bottles",
    )


_PLASTIC_SORTED = Near("bottle_plastic_middle", _PLASTIC, _WITHIN_M)
_GLASS_SORTED = Near("bottle_glass_middle", _GLASS, _WITHIN_M)
_MYSTERY_SORTED = When("mystery", {kind: Near("mystery_middle", names, _WITHIN_M) for kind, names in _GROUPS.items()})

# Which stool is at which end of the row is drawn; the groups stand before its ends.
RECYCLE_BOTTLES_BY_TYPE = Task(
    name="RecycleBottlesByType",
    summary="All bottles stand on the dining counter, those amid it within 30 cm of their kind; the gripper away.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink"),
        FixtureSpec("dining_counter", "dining_counter"),
        FixtureSpec("stool1", "stool_at_end_of_three"),
        FixtureSpec("stool2", "stool_amid_three"),
        FixtureSpec("stool3", "stool_at_end_of_three", other_than=("stool1",)),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("stool2"),
    choices=(
        Choice("plastic_end", {"stool1": {"_glass_end": "stool3"}, "stool3": {"_glass_end": "stool1"}}),
        Choice("mystery", {"plastic": {"_category": "bottled_water"}, "glass": {"_category": "alcohol"}}),
    ),
    objects=(
        *_group(_PLASTIC, "bottled_water", "{plastic_end}"),
        *_group(_GLASS, "alcohol", "{_glass_end}"),
        _bottle("bottle_plastic_middle", "bottled_water", _before("stool2")),
        _bottle("bottle_glass_middle", "alcohol", _before("stool2")),
        _bottle("mystery_middle", "{_category}", _before("stool2")),
    ),
    goal=AllOf(
        _PLASTIC_SORTED,
        _GLASS_SORTED,
        _MYSTERY_SORTED,
        AllOf(*(ObjectTouches(name, "dining_counter") for name in _BOTTLES)),
        AllOf(*(GripperFar(name) for name in _BOTTLES)),
    ),
    stages=(
        _sort("bottle_plastic_middle", _PLASTIC_SORTED, "plastic"),
        _sort("bottle_glass_middle", _GLASS_SORTED, "glass"),
        _sort("mystery_middle", _MYSTERY_SORTED, "{mystery}"),
    ),
    instruction=(
        "Sort the three bottles in the middle of the dining counter: plastic ones to the water bottles at one end, "
        "glass ones to the bottles of alcohol at the other."
    ),
    paraphrases=(
        "The bottles in the middle belong to the two groups at the ends: plastic to plastic, glass to glass.",
        "Move every bottle of the middle next to those of its kind, either plastic or glass.",
        "Separate the middle bottles for recycling, the water bottles to one end and the glass ones to the other.",
        "Put plastic with plastic and glass with glass, until no bottle is left in the middle of the counter.",
    ),
)

_HIGHER_M = 0.04
# The gripper opens by 8 cm, less than the published scale of the second, 1.3, would make ours wide.
_YOGURTS = {"yogurt_container1": 2.0, "yogurt_container2": 1.1, "yogurt_container3": 0.8}


def _on_next(name: str, other: str) -> AllOf:
    return AllOf(ObjectOn(name, other), RestsOn(name, other, higher=_HIGHER_M))


def _stack(name: str, other: str) -> Stage:
    until = AllOf(*_on_next(name, other).parts, GripperFar(name))
    return Stage("pick_place", "place", other, object=name, until=until, text=f"put the next smaller {{{name}}} on top")


RECYCLE_STACKED_YOGURT = Task(
    name="RecycleStackedYogurt",
    summary="The yogurts are one stack, the largest below and the smallest on top, the gripper away from all three.",
    fixtures=(FixtureSpec("stool", "stool"), FixtureSpec("counter", "dining_counter", near="stool")),
    robot_start=RobotStart("stool"),
    objects=tuple(
        ObjectSpec(
            name,
            ("yogurt",),
            before_stool((0.7, 0.3), counter="counter", pos=(0.0, "ref")),
            graspable=name != "yogurt_container1",
            scale=scale,
            repeats=True,
        )
        for name, scale in _YOGURTS.items()
    ),
    goal=AllOf(
        *_on_next("yogurt_container2", "yogurt_container1").parts,
        *_on_next("yogurt_container3", "yogurt_container2").parts,
        *map(GripperFar, _YOGURTS),
    ),
    stages=(_stack("yogurt_container2", "yogurt_container1"), _stack("yogurt_container3", "yogurt_container2")),
    instruction="Stack the three yogurts by size, the largest at the bottom and the smallest at the top.",
    paraphrases=(
        "Recycle the yogurts as one stack that gets smaller upwards.",
        "Build a tower of the yogurts on the largest of them.",
        "Put the middle yogurt on the large one, and the small one on that.",
        "The yogurts should stand on each other, ordered by their size.",
    ),
)

TASKS = (RECYCLE_BOTTLES_BY_TYPE, RECYCLE_STACKED_YOGURT)
