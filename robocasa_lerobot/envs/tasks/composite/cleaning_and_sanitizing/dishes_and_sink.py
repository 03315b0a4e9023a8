"""Wash dishes: what goes into the sink, what comes out of it, and what is washed in it."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    MovedSince,
    Not,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT, counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch, together
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SINK = (FixtureSpec("sink", "sink"), counter_near("sink"))
_DRY = (Water("sink", on=False),)


def _beside(size: tuple[float, float], **more: object) -> Placement:
    return on_counter("sink", size, loc="left_right", **more)  # type: ignore[arg-type]


def _inside(name: str) -> AllOf:
    return AllOf(ObjectInside(name, "sink"), GripperFar(name))


def _into_sink(name: str) -> Stage:
    return Stage("pick_place", "place", "sink", object=name, until=_inside(name))


def _out_of_sink(name: str) -> Stage:
    return Stage("pick_place", "place", "counter", object=name)


def _food(name: str, across: float) -> ObjectSpec:
    start = Placement("sink", size=(0.5, 0.2), pos=(across, 1.0))
    return ObjectSpec(name, ("fruit", "vegetable"), start, graspable=True)


_FOODS, _DISHES = ("food0", "food1"), ("dish0", "dish1")

CLEAR_SINK = Task(
    name="ClearSink",
    summary="Both pieces of food are out of the sink, bowl and cup in it, the gripper away from all.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    objects=(
        _food("food0", 0.5),
        _food("food1", 0.3),
        ObjectSpec("dish0", ("bowl",), _beside((0.5, 0.4)), graspable=True),
        ObjectSpec("dish1", ("cup",), _beside((0.5, 0.3)), graspable=True),
    ),
    initial=_DRY,
    goal=AllOf(
        *(Not(ObjectInside(name, "sink")) for name in _FOODS),
        *(ObjectInside(name, "sink") for name in _DISHES),
        *map(GripperFar, (*_FOODS, *_DISHES)),
    ),
    stages=(*map(_out_of_sink, _FOODS), *map(_into_sink, _DISHES)),
    instruction="Take {food0+food1} out of the sink, then put the {dish0} and the {dish1} into it.",
    paraphrases=(
        "The sink is for dishes: food out onto the counter, {dish0} and {dish1} in.",
        "First {food0+food1} must leave the basin; after that the {dish0} and the {dish1} go in.",
        "Swap what is in the sink: {food0+food1} for {dish0+dish1}.",
        "Clear the basin of {food0+food1} and fill it with the {dish0} and the {dish1}.",
    ),
)

DRY_DISHES = Task(
    name="DryDishes",
    summary="Cup and bowl stand on the counter, the gripper away from them.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    choices=(Choice("cup_corner", {"left": {}, "right": {}}),),
    objects=(
        ObjectSpec(
            "obj1",
            ("cup",),
            Placement("sink", size=(0.1, 0.1), pos=("{cup_corner}", 1.0), margin=0.0),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec(
            "obj2",
            ("bowl",),
            Placement("sink", size=(0.05, 0.05), pos=(0.0, 0.0), margin=0.0, ensure_inside=False),
            graspable=True,
            properties=("washable",),
        ),
        ObjectSpec("distr_counter", ("any",), _beside((0.3, 0.3), offset=(0.0, 0.3))),
    ),
    initial=_DRY,
    goal=AllOf(
        ObjectTouches("obj1", "counter"), ObjectTouches("obj2", "counter"), GripperFar("obj1"), GripperFar("obj2")
    ),
    stages=(_out_of_sink("obj1"), _out_of_sink("obj2")),
    instruction="Take the cup and the bowl out of the sink and stand them on the counter.",
    paraphrases=(
        "Cup and bowl are washed; let them dry on the counter.",
        "The counter should get the cup, then the bowl, out of the basin.",
        "Empty the sink of its dishes, the cup and the bowl, onto the counter.",
        "Set the cup and the bowl down beside the sink, where they can dry.",
    ),
)

_NESTED = AllOf(ObjectOn("receptacle2", "receptacle1"), ObjectInside("receptacle2", "sink"), GripperFar("receptacle2"))


def _bowl_to_stack(name: str) -> ObjectSpec:
    start = _beside((0.4, 0.65))
    return ObjectSpec(name, ("bowl",), start, graspable=True, properties=("washable",), repeats=True)


STACK_BOWLS_IN_SINK = Task(
    name="StackBowlsInSink",
    summary="Both bowls are in the sink, one in the other, the gripper away from them.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    objects=(_bowl_to_stack("receptacle1"), _bowl_to_stack("receptacle2")),
    initial=_DRY,
    goal=AllOf(
        ObjectInside("receptacle1", "sink"),
        ObjectInside("receptacle2", "sink"),
        AnyOf(ObjectOn("receptacle2", "receptacle1"), ObjectOn("receptacle1", "receptacle2")),
        GripperFar("receptacle1"),
        GripperFar("receptacle2"),
    ),
    stages=(
        _into_sink("receptacle1"),
        Stage("pick_place", "place", "receptacle1", object="receptacle2", until=_NESTED, text="stack the bowls"),
    ),
    instruction="Put both bowls into the sink, one inside the other.",
    paraphrases=(
        "Stack the two bowls in the sink.",
        "The basin should hold a stack of both bowls.",
        "Set one bowl down in the sink and the second one in that.",
        "Move the bowls from the counter into the sink and nest them there.",
    ),
)


def _rinsed(name: str, *, on_end: bool) -> StepsWhile:
    return StepsWhile(UnderWater(name, "sink"), 25, consecutive=on_end, label=f"{name}_rinsed")


def _rinse(name: str, rinsed: Goal, there: Goal) -> Stage:
    """Under the stream, and then down in the sink."""
    until = AllOf(rinsed, there, GripperFar(name))
    return Stage("pick_place", "rinse", "sink", object=name, until=until)


RINSE_BOWLS = Task(
    name="RinseBowls",
    summary="Either bowl was under running water for 25 steps on end, the gripper is away from both.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    objects=tuple(
        ObjectSpec(name, ("bowl",), _beside((0.5, 0.5)), graspable=True, scale=0.75, repeats=True) for name in _DISHES
    ),
    goal=AllOf(*(_rinsed(name, on_end=True) for name in _DISHES), *map(GripperFar, _DISHES)),
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        *(_rinse(name, _rinsed(name, on_end=True), ObjectInBasin(name, "sink")) for name in _DISHES),
    ),
    instruction="Turn on the water and hold each of the two bowls under it, then put it down.",
    paraphrases=(
        "Rinse both bowls under the faucet.",
        "Open the faucet and rinse the first and then the second bowl.",
        "Running water should wash over one bowl after the other.",
        "The two bowls beside the sink need a rinse under running water; set them down afterwards.",
    ),
)

_SOAKED = _rinsed("obj", on_end=False)

SOAK_SPONGE = Task(
    name="SoakSponge",
    summary="The sponge was under running water for 25 steps and lies in the sink, the gripper away from it.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    objects=(ObjectSpec("obj", ("sponge",), _beside((0.3, 0.3)), graspable=True),),
    goal=AllOf(_SOAKED, GripperFar("obj"), ObjectInside("obj", "sink")),
    stages=(
        Stage("levers", "on", "sink", part="handle"),
        _rinse("obj", _SOAKED, ObjectInside("obj", "sink")),
    ),
    instruction="Turn on the water, hold the sponge under it and leave the sponge in the sink.",
    paraphrases=(
        "Soak the sponge under the faucet; it stays in the basin.",
        "The sponge should be wet: water on, sponge below it, then drop it into the sink.",
        "Open the faucet, let the sponge soak in the stream, and put it down in the sink.",
        "Let water run over the sponge for a moment and lay it in the basin.",
    ),
)

_SCRUBBED = StepsWhile(
    AllOf(ObjectOn("sponge", "bowl"), MovedSince("sponge", since="step", by_m=0.001)), 15, label="bowl_scrubbed"
)

SCRUB_BOWL = Task(
    name="ScrubBowl",
    summary="The sponge has moved in the bowl for 15 steps, the gripper is away from the bowl.",
    fixtures=_SINK,
    robot_start=RobotStart("sink"),
    objects=(
        ObjectSpec("bowl", ("bowl",), Placement("sink", size=(0.5, 0.3), pos=(0.0, 1.0)), graspable=True),
        ObjectSpec("sponge", ("sponge",), _beside((0.25, 0.3)), graspable=True),
    ),
    initial=_DRY,
    goal=AllOf(_SCRUBBED, GripperFar("bowl")),
    stages=(
        Stage("pick_place", "pick", "counter", object="sponge"),
        Stage(
            "pick_place",
            "wipe",
            "bowl",
            object="sponge",
            until=AllOf(_SCRUBBED, GripperFar("bowl")),
            text="scrub the bowl with the sponge and take the hand away",
        ),
    ),
    instruction="Scrub the bowl in the sink with the sponge, then let go.",
    paraphrases=(
        "Clean the bowl in the basin with the sponge from the counter.",
        "Pick up the sponge and rub the inside of the bowl in the sink with it.",
        "The bowl in the sink is dirty: scrub it with the sponge.",
        "Wipe the bowl out with the sponge and take the hand away from it.",
    ),
)

# Not in the oven below, which is a region of a range as well.
_ANY_BURNER = Placement(
    "stove", region=SampleRegion(name="any", height=(0.7, 1.2)), size=(0.2, 0.2), ensure_inside=False
)
_WASHED_UP = ("pot", "pan")

TRANSPORT_COOKWARE = Task(
    name="TransportCookware",
    summary="Pot and pan are in the sink, the gripper away from both.",
    fixtures=(FixtureSpec("stove", "stove"), FixtureSpec("sink", "sink")),
    robot_start=RobotStart("stove"),
    objects=(
        ObjectSpec("pot", ("pot",), _ANY_BURNER, graspable=True),
        ObjectSpec(
            "pan",
            ("pan",),
            replace(_ANY_BURNER, rotation=HANDLE_TO_FRONT),
            graspable=True,
        ),
    ),
    goal=AllOf(*(ObjectInBasin(name, "sink") for name in _WASHED_UP), *map(GripperFar, _WASHED_UP)),
    stages=(
        *fetch("pot", "stove", "sink"),
        Stage("navigation", "drive", "stove"),
        *fetch("pan", "stove", "sink"),
    ),
    instruction="Bring the pot and the pan from the stove to the sink and put both in.",
    paraphrases=(
        "Pot and pan on the stove are for the sink.",
        "Carry the pot, then the pan, over to the sink and set them down in it.",
        "Cooking is done: the stove's pot and pan go into the basin.",
        "Clear the stove of pot and pan, into the sink.",
    ),
)

# What lies on the other one in the bowl is in it, too.
_TIPPED_OUT = AllOf(Not(together("leftover1", "leftover2", "bowl")), Not(together("leftover2", "leftover1", "bowl")))


def _leftover(name: str) -> ObjectSpec:
    start = Placement(object="bowl", heaped=True)
    return ObjectSpec(name, ("fruit", "vegetable", "cooked_food"), start, graspable=True, repeats=True)


DUMP_LEFTOVERS = Task(
    name="DumpLeftovers",
    summary="Both leftovers are out of the bowl, which is in the sink, the gripper away from it.",
    fixtures=_SINK,
    robot_start=RobotStart("counter", at_object="bowl"),
    objects=(
        ObjectSpec("bowl", ("bowl",), _beside((0.5, 0.35)), graspable=True, scale=(1.0, 1.0, 0.75)),
        _leftover("leftover1"),
        _leftover("leftover2"),
    ),
    goal=AllOf(*_TIPPED_OUT.parts, ObjectInside("bowl", "sink"), GripperFar("bowl")),
    stages=(
        Stage("pick_place", "pick", "counter", object="bowl"),
        Stage(
            "pick_place",
            "pour",
            "sink",
            object="bowl",
            until=_TIPPED_OUT,
            text="empty the bowl over the sink",
        ),
        _into_sink("bowl"),
    ),
    instruction="Empty the bowl of {leftover1+leftover2} and put it into the sink.",
    paraphrases=(
        "Tip {leftover1+leftover2} out of the bowl; the bowl itself belongs in the sink.",
        "Get rid of the leftovers in the bowl, then set the bowl down in the basin.",
        "The bowl is to be washed: pour out {leftover1+leftover2} and place it in the sink.",
        "Dump {leftover1+leftover2}, and let the empty bowl go into the sink.",
    ),
)

TASKS = (
    CLEAR_SINK,
    DRY_DISHES,
    DUMP_LEFTOVERS,
    RINSE_BOWLS,
    SCRUB_BOWL,
    SOAK_SPONGE,
    STACK_BOWLS_IN_SINK,
    TRANSPORT_COOKWARE,
)
