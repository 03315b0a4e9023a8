"""Clear the dining counter."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectInBasin, ObjectInside, ObjectOn, StateIs
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

_LARGEST = (0.25, 0.25, 0.15)  # metres: two of them fit into a basin
_DISHES = ("receptacle1", "receptacle2")


def _dish(name: str) -> ObjectSpec:
    start = Placement("dining_table", region=SampleRegion(ref="sink"), size=(0.8, 0.4), pos=("ref", -1.0))
    return ObjectSpec(
        name, ("receptacle",), start, graspable=True, properties=("washable",), max_size=_LARGEST, repeats=True
    )


def _into_sink(name: str) -> tuple[Stage, ...]:
    return fetch(name, "dining_table", "sink")


CLEAR_RECEPTACLES_FOR_CLEANING = Task(
    name="ClearReceptaclesForCleaning",
    summary="Both dishes are in the sink, let go, and water runs.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "dining_counter", near="stool", size=(0.8, 0.3)),
    ),
    robot_start=RobotStart("dining_table", at_object="receptacle1"),
    objects=(
        *map(_dish, _DISHES),
        ObjectSpec(
            "distr_sink", ("any",), Placement("sink", size=(0.4, 0.25), pos=(0.0, 1.0)), properties=("washable",)
        ),
    ),
    initial=(Water("sink", on=False),),
    goal=AllOf(
        *(ObjectInBasin(name, "sink") for name in _DISHES), *map(GripperFar, _DISHES), StateIs("sink", "water_on")
    ),
    stages=(
        *_into_sink("receptacle1"),
        Stage("navigation", "drive", "receptacle2"),
        *_into_sink("receptacle2"),
        Stage("levers", "on", "sink", part="handle"),
    ),
    instruction="Carry {receptacle1+receptacle2} from the dining counter to the sink and turn on the water.",
    paraphrases=(
        "Clear the dining counter: {receptacle1} and {receptacle2} into the sink, then open the faucet.",
        "The dishes on the dining counter are dirty; bring both to the sink and let the water run.",
        "Put the {receptacle1} and then the {receptacle2} into the basin, and start the water.",
        "Sink and running water are for {receptacle1+receptacle2}, now on the dining counter.",
    ),
)

_CONDIMENTS = ("condiment1", "condiment2")


def _condiment(name: str, aside: float, again: str = "") -> ObjectSpec:
    start = on_counter("cabinet", (0.3, 0.3), pos=(0.0, -1.0), offset=(aside, 0.0), reuse_region_from=again)
    return ObjectSpec(name, ("condiment",), start, graspable=True, repeats=True)


CONDIMENT_COLLECTION = Task(
    name="CondimentCollection",
    summary="Both condiments are in the cabinet, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        _condiment("condiment1", 0.05),
        _condiment("condiment2", -0.05, again="condiment1"),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (1.0, 0.3), pos=(0.0, -1.0), offset=(0.0, 0.3))),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*(ObjectInside(name, "cabinet") for name in _CONDIMENTS), *map(GripperFar, _CONDIMENTS)),
    stages=tuple(Stage("pick_place", "place", "cabinet", object=name) for name in _CONDIMENTS),
    instruction="Put the {condiment1} and the {condiment2} from the counter into the cabinet.",
    paraphrases=(
        "Clear away {condiment1} and {condiment2}: they belong in the open cabinet.",
        "After the meal, the {condiment1} and the {condiment2} go back into the cabinet.",
        "Collect both condiments on the counter and store them in the cabinet.",
        "The cabinet should have the {condiment1} and the {condiment2} that stand below it.",
    ),
)


def _at_front(depth: float, again: str = "") -> Placement:
    region = SampleRegion(top_size=(1.0, 0.4))
    return Placement("counter", region=region, size=(1.0, depth), pos=(0.0, -1.0), reuse_region_from=again)


DESSERT_ASSEMBLY = Task(
    name="DessertAssembly",
    summary="The bowl with its dessert and the cupcake are on the tray, the gripper away from it.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.5)),),
    robot_start=RobotStart("counter"),
    objects=(
        ObjectSpec("receptacle", ("tray",), _at_front(0.5)),
        ObjectSpec("dessert1_container", ("bowl",), _at_front(0.4, again="receptacle"), graspable=True),
        ObjectSpec("dessert1", ("donut", "cake"), Placement(object="dessert1_container"), graspable=True),
        ObjectSpec("dessert2", ("cupcake",), _at_front(0.4, again="receptacle"), graspable=True),
    ),
    goal=AllOf(
        ObjectOn("dessert1", "dessert1_container"),
        ObjectOn("dessert1_container", "receptacle"),
        ObjectOn("dessert2", "receptacle"),
        GripperFar("receptacle"),
    ),
    stages=(
        Stage("pick_place", "place", "receptacle", object="dessert1_container"),
        Stage("pick_place", "place", "receptacle", object="dessert2"),
    ),
    instruction="Put the bowl with the {dessert1} and the cupcake on the tray.",
    paraphrases=(
        "Assemble the desserts on the tray: the {dessert1} in its bowl, and the cupcake.",
        "The tray should carry the cupcake and the bowl that holds the {dessert1}.",
        "Move the bowl onto the tray without taking the {dessert1} out, then add the cupcake.",
        "Bowl, {dessert1} and cupcake all belong on the tray.",
    ),
)

TASKS = (CLEAR_RECEPTACLES_FOR_CLEANING, CONDIMENT_COLLECTION, DESSERT_ASSEMBLY)
