"""Wash fruits and vegetables that are stored in fridges and cabinets."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    ObjectInside,
    ObjectOn,
    StateIs,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_SHELVES_M = (1.0, 1.5)
_FRIDGE_OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")
_PRODUCE = ("vegetable", "fruit")
_SIDEWAYS = (3.141592653589793, 3.141592653589793)  # radians: to the right, along the counter
_STRAIGHT = (0.0, 0.0)


def _in_fridge(size: tuple[float, float], along: float) -> Placement:
    return Placement("fridge", region=SampleRegion(name="fridge_shelf", height=_SHELVES_M), size=size, pos=(0.0, along))


def _stored(name: str, groups: tuple[str, ...]) -> ObjectSpec:
    return ObjectSpec(
        name, groups, _in_fridge((0.3, 0.2), -1.0), graspable=True, properties=("washable",), repeats=True
    )


def _beside_food(name: str, exclude: tuple[str, ...], size: tuple[float, float] = (0.3, 0.3)) -> ObjectSpec:
    start = Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=size, pos=(0.0, 0.0))
    return ObjectSpec(name, ("any",), start, properties=("fridgable",), exclude=exclude)


def _fetch_both(first: str, second: str, source: str, target: str) -> tuple[Stage, ...]:
    """One after the other."""
    return (*fetch(first, source, target), Stage("navigation", "drive", source), *fetch(second, source, target))


GATHER_PRODUCE_WASHING = Task(
    name="GatherProduceWashing",
    summary="Both things from the fridge are in the bowl by the sink, the gripper away from them.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        _stored("food0", _PRODUCE),
        _stored("food1", _PRODUCE),
        _beside_food("distr1", ("fruit", "vegetable")),
        ObjectSpec("bowl", ("bowl",), on_counter("sink", (0.4, 0.4), loc="left_right"), graspable=True),
    ),
    initial=(_FRIDGE_OPEN,),
    goal=AllOf(ObjectOn("food0", "bowl"), ObjectOn("food1", "bowl"), GripperFar("food0"), GripperFar("food1")),
    stages=_fetch_both("food0", "food1", "fridge", "bowl"),
    instruction="Bring {food0+food1} out of the fridge to the bowl beside the sink.",
    paraphrases=(
        "Gather what is to be washed: {food0+food1} go from the fridge into the bowl.",
        "The bowl by the sink is for {food0+food1}, which are in the open fridge.",
        "Collect the fridge's produce, {food0+food1}, in the bowl next to the sink.",
        "Fetch {food0+food1} and put them into the bowl at the sink.",
    ),
)

WASH_IN_SAUCEPAN = Task(
    name="WashInSaucepan",
    summary="Both vegetables are in the saucepan of water, the gripper away from them.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink"), FixtureSpec("fridge", "fridge")),
    robot_start=RobotStart("fridge"),
    objects=(
        _stored("vegetable0", ("vegetable",)),
        _stored("vegetable1", ("vegetable",)),
        _beside_food("distr", ("fruit", "vegetable")),
        ObjectSpec(
            "saucepan",
            ("saucepan",),
            on_counter("sink", (0.55, 0.35), loc="left_right", rotation=_SIDEWAYS),
            scale=(1.2, 1.2, 1.0),
            filled="water",
        ),
    ),
    initial=(_FRIDGE_OPEN,),
    goal=AllOf(
        ObjectOn("vegetable0", "saucepan"),
        ObjectOn("vegetable1", "saucepan"),
        GripperFar("vegetable0"),
        GripperFar("vegetable1"),
    ),
    stages=_fetch_both("vegetable0", "vegetable1", "fridge", "saucepan"),
    instruction="Put {vegetable0+vegetable1} from the fridge into the saucepan of water by the sink.",
    paraphrases=(
        "Let {vegetable0+vegetable1} soak in the saucepan; they are in the fridge.",
        "The water in the saucepan is for the fridge's {vegetable0+vegetable1}.",
        "Wash {vegetable0+vegetable1}: out of the fridge, into the saucepan that is full of water.",
        "Carry both vegetables over from the fridge and drop them into the saucepan.",
    ),
)

_WASHED = StepsWhile(UnderWater("vegetable", "sink"), 11, consecutive=True, label="vegetable_washed")

PREPARE_VEGETABLE_ROASTING = Task(
    name="PrepareVegetableRoasting",
    summary="The vegetable was under running water for 11 steps on end and lies on the oven tray, the gripper away.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink", size=(0.6, 0.6)),
        FixtureSpec("fridge", "fridge"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        _stored("vegetable", ("vegetable",)),
        ObjectSpec("tray", ("oven_tray",), on_counter("sink", (0.7, 0.4), loc="left_right", rotation=_STRAIGHT)),
        ObjectSpec(
            "existing_vegetable",
            ("vegetable",),
            Placement(object="tray"),
            graspable=True,
            properties=("washable",),
        ),
        _beside_food("distr1", ("vegetable", "fruit"), (0.5, 0.3)),
        _beside_food("distr2", ("vegetable", "fruit"), (0.5, 0.3)),
    ),
    initial=(_FRIDGE_OPEN, Water("sink", on=True)),
    goal=AllOf(_WASHED, ObjectOn("vegetable", "tray"), GripperFar("vegetable")),
    stages=(
        Stage("pick_place", "pick", "fridge", object="vegetable"),
        Stage("navigation", "drive", "sink", object="vegetable"),
        Stage("pick_place", "hold", "sink", object="vegetable", until=_WASHED),
        Stage("pick_place", "place", "tray", object="vegetable"),
    ),
    instruction="Hold the {vegetable} from the fridge under the running water and lay it on the oven tray.",
    paraphrases=(
        "The {vegetable} is to be roasted: take it from the fridge, rinse it, and add it to the oven tray.",
        "Rinse the fridge's {vegetable} under the faucet, then put it on the tray beside the sink.",
        "Get the {vegetable} out of the fridge, through the running water, and onto the oven tray.",
        "Prepare the oven tray: the {vegetable} in the fridge belongs on it, after a rinse at the sink.",
    ),
)

PREWASH_FOOD_ASSEMBLY = Task(
    name="PrewashFoodAssembly",
    summary="The bowl with the food is in the sink, water runs, the gripper away from the bowl.",
    fixtures=(
        FixtureSpec("cab", "cabinet"),
        FixtureSpec("sink", "sink"),
        counter_near("cab", name="counter_cab"),
        counter_near("sink", name="counter_sink"),
    ),
    robot_start=RobotStart("cab"),
    objects=(
        ObjectSpec("food", _PRODUCE, in_cabinet("cab", (0.5, 0.2)), graspable=True),
        ObjectSpec("bowl", ("bowl",), on_counter("cab", (0.5, 0.4), counter="counter_cab"), graspable=True),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cab", (0.5, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cab", 0.9, 1.0), Water("sink", on=False)),
    goal=AllOf(GripperFar("bowl"), ObjectOn("food", "bowl"), ObjectInside("bowl", "sink"), StateIs("sink", "water_on")),
    stages=(
        Stage("pick_place", "place", "bowl", object="food"),
        *fetch("bowl", "counter_cab", "sink", until=AllOf(ObjectInside("bowl", "sink"), GripperFar("bowl"))),
        Stage("levers", "on", "sink", part="handle"),
    ),
    instruction="Put the {food} from the cabinet into the bowl, carry the bowl into the sink and turn on the water.",
    paraphrases=(
        "Wash the {food} in the bowl: fill the bowl from the cabinet, set it in the sink, open the faucet.",
        "The cabinet's {food} goes into the bowl, the bowl into the sink, and then water should run.",
        "With the {food} in it the bowl belongs under the faucet; let the water run there.",
        "Assemble the wash: {food} into bowl, bowl into basin, faucet on.",
    ),
)


def _sorted_into(first: str, second: str) -> Goal:
    return AllOf(ObjectOn("food1", first), ObjectOn("food2", first), ObjectOn("food3", second))


PREWASH_FOOD_SORTING = Task(
    name="PrewashFoodSorting",
    summary="The two alike from the cabinet are in one bowl, the thing from the sink is in the other.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("cabinet", "cabinet", near="sink"),
        counter_near("sink"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("food1", _PRODUCE, in_cabinet("cabinet", (0.5, 0.3)), graspable=True, properties=("washable",)),
        ObjectSpec(
            "food2",
            _PRODUCE,
            in_cabinet("cabinet", (0.5, 0.3)),
            graspable=True,
            properties=("washable",),
            same_category_as="food1",
            repeats=True,
        ),
        ObjectSpec(
            "food3",
            _PRODUCE,
            Placement("sink", size=(0.35, 0.25), pos=(None, 1.0)),
            graspable=True,
            properties=("washable",),
        ),
        *(
            ObjectSpec(name, ("bowl",), on_counter("sink", (0.5, 0.5), loc="left_right"), repeats=True)
            for name in ("bowl1", "bowl2")
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AnyOf(_sorted_into("bowl1", "bowl2"), _sorted_into("bowl2", "bowl1")),
    stages=(
        *_fetch_both("food1", "food2", "cabinet", "bowl1"),
        Stage("pick_place", "place", "bowl2", object="food3"),
    ),
    instruction="Put {food1+food2} from the cabinet into one bowl, and the {food3} from the sink into the other.",
    paraphrases=(
        "Sort before washing: {food1+food2} into one bowl, the {food3} into the other bowl.",
        "One bowl is for {food1+food2} out of the cabinet, the other one for the sink's {food3}.",
        "The {food3} in the basin gets a bowl of its own; {food1+food2} in the cabinet share the other.",
        "Fill the two bowls by the sink, one with {food1+food2}, one with the {food3}.",
    ),
)

TASKS = (
    GATHER_PRODUCE_WASHING,
    PREPARE_VEGETABLE_ROASTING,
    PREWASH_FOOD_ASSEMBLY,
    PREWASH_FOOD_SORTING,
    WASH_IN_SAUCEPAN,
)
