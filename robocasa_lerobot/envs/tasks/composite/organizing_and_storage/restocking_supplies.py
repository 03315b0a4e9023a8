"""Restock cabinets."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    NearerThan,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnShelf,
    When,
)
from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_BELOW = Placement(
    "counter", region=SampleRegion(ref="cabinet", top_size=(0.5, 0.4)), size=(0.75, 0.5), pos=(0.0, -1.0)
)

RESTOCK_BOWLS = Task(
    name="RestockBowls",
    summary="Both bowls are in the cabinet, which is shut.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_double_door"),
        FixtureSpec("counter", "counter", near="cabinet", size=(0.5, 0.4)),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("obj1", ("bowl",), _BELOW, graspable=True),
        ObjectSpec("obj2", ("bowl",), _BELOW, graspable=True, repeats=True),
    ),
    goal=AllOf(ObjectInside("obj1", "cabinet"), ObjectInside("obj2", "cabinet"), DoorsClosed("cabinet")),
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "cabinet", object="obj1"),
        Stage("pick_place", "place", "cabinet", object="obj2"),
        Stage("doors", "close", "cabinet"),
    ),
    instruction="Open the cabinet, move both bowls from the counter into it and close it.",
    paraphrases=(
        "Both bowls belong in the cabinet; leave it shut.",
        "Clear the two bowls off the worktop into the cabinet and close its doors.",
        "Restock the cabinet with the bowls from the counter, then shut the doors.",
        "Put the bowls on the counter away behind the doors of the cabinet.",
    ),
)

RESTOCK_CANNED_FOOD = Task(
    name="RestockCannedFood",
    summary="The new can is in the cabinet, the old one on a counter, the gripper away from both.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("canned_food_new", ("canned_food",), on_counter("cabinet", (0.5, 0.2)), graspable=True),
        ObjectSpec(
            "distr_counter",
            ("any",),
            on_counter("cabinet", (1.0, 0.3), pos=(0.0, 0.0), reuse_region_from="canned_food_new"),
            exclude=("canned_food",),
        ),
        ObjectSpec(
            "canned_food_old", ("canned_food",), in_cabinet("cabinet", (0.5, 0.2)), graspable=True, repeats=True
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        ObjectInside("canned_food_new", "cabinet"),
        ObjectTouchesAnyCounter("canned_food_old"),
        GripperFar("canned_food_old"),
        GripperFar("canned_food_new"),
    ),
    stages=(
        Stage(
            "pick_place",
            "place",
            "cabinet",
            object="canned_food_new",
            text="put the new {canned_food_new} into the cabinet",
        ),
        Stage(
            "pick_place",
            "place",
            "counter",
            object="canned_food_old",
            text="put the old {canned_food_old} on the counter",
        ),
    ),
    instruction="Put the can from the counter into the cabinet, and the old can from the cabinet on the counter.",
    paraphrases=(
        "Exchange the two cans: the one in the cabinet comes out, the one on the counter goes in.",
        "The can on the counter is fresh; store it in the cabinet and take out the one that was there.",
        "Restock the cabinet with the counter's can and leave its old can on the counter.",
        "Swap cans between counter and cabinet.",
    ),
)


def _can(name: str) -> ObjectSpec:
    return ObjectSpec(name, ("canned_food",), on_counter("cabinet", (0.5, 0.3)), graspable=True, repeats=True)


def _with_its_like(name: str) -> AllOf:
    return AllOf(ObjectInside(name, "cabinet"), NearerThan(name, "cab_obj1", "cab_obj2", factor=2.0), GripperFar(name))


def _shelve(name: str) -> Stage:
    text = f"put the {{{name}}} into the cabinet beside the {{cab_obj1}}"
    return Stage("pick_place", "place", "cabinet", object=name, until=_with_its_like(name), text=text)


RESTOCK_PANTRY = Task(
    name="RestockPantry",
    summary=("Both cans are in the cabinet, twice as near to the can there as to the other thing, the gripper away."),
    fixtures=(FixtureSpec("cabinet", "cabinet_double_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    choices=(Choice("can_side", {"left": {}, "right": {}}),),
    objects=(
        _can("obj1"),
        _can("obj2"),
        ObjectSpec(
            "cab_obj1",
            ("canned_food",),
            in_cabinet("cabinet", (0.2, 0.3), pos=("{can_side}", -0.3)),
            graspable=True,
            repeats=True,
        ),
        ObjectSpec(
            "cab_obj2",
            ("any",),
            in_cabinet("cabinet", (0.2, 0.3), pos=("-{can_side}", 0.3)),
            graspable=True,
            exclude=("canned_food",),
        ),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (1.0, 0.3), pos=(0.0, 1.0), offset=(0.0, -0.05))),
    ),
    initial=(InitialOpenness("cabinet", 1.0, 1.0),),
    goal=AllOf(*_with_its_like("obj1").parts, *_with_its_like("obj2").parts),
    stages=(_shelve("obj1"), _shelve("obj2")),
    instruction="Put both cans from the counter into the cabinet, at the side where the other can stands.",
    paraphrases=(
        "Cans belong with cans: move the two from the counter next to the one in the cabinet.",
        "Restock the cabinet with both cans, beside the can and away from the {cab_obj2}.",
        "One side of the cabinet is for cans; put the counter's two there.",
        "Store the two cans where the cabinet already has one.",
    ),
)

REFILL_CONDIMENT_STATION = Task(
    name="RefillCondimentStation",
    summary="The condiment stands on the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_with_door"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("condiment", ("condiment",), in_cabinet("cabinet", (0.5, 0.2)), graspable=True),
        ObjectSpec("distr", ("any",), in_cabinet("cabinet", (0.6, 0.3), pos=(0.0, 1.0)), exclude=("condiment",)),
        ObjectSpec(
            "dining_table_condiment",
            ("condiment",),
            before_stool((0.6, 0.4)),
            same_category_as="condiment",
            repeats=True,
        ),
    ),
    goal=AllOf(ObjectTouches("condiment", "dining_counter"), GripperFar("condiment")),
    stages=(Stage("doors", "open", "cabinet"), *fetch("condiment", "cabinet", "dining_counter")),
    instruction="Open the cabinet and bring a second {condiment} from it to the dining counter.",
    paraphrases=(
        "The dining counter should get another {condiment}; there is one in the cabinet.",
        "Refill the condiments at the dining counter with the cabinet's {condiment}.",
        "Take the {condiment} out of the closed cabinet and set it down on the dining counter.",
        "One {condiment} on the dining counter is not enough: add the one in the cabinet.",
    ),
)

_ALCOHOL, _SOFT = ("alcohol1", "alcohol2"), ("non_alcohol1", "non_alcohol2")


def _drinks(names: tuple[str, ...], group: str, exclude: str) -> tuple[ObjectSpec, ...]:
    start = on_counter("cabinet1", (0.5, 0.4), pos=(0.0, -1.0))
    return tuple(ObjectSpec(name, (group,), start, graspable=True, exclude=(exclude,), repeats=True) for name in names)


def _apart(first: str, second: str) -> AllOf:
    stored = [*(ObjectInside(name, first) for name in _ALCOHOL), *(ObjectInside(name, second) for name in _SOFT)]
    return AllOf(*stored)


def _take_away(name: str) -> tuple[Stage, ...]:
    return fetch(name, "counter", "cabinet2")


BEVERAGE_SORTING = Task(
    name="BeverageSorting",
    summary="Drinks with alcohol are in one cabinet, those without in the other, the gripper away from all four.",
    fixtures=(
        FixtureSpec("cabinet1", "cabinet_with_door"),
        FixtureSpec("cabinet2", "cabinet_with_door", other_than=("cabinet1",)),
        counter_near("cabinet1", size=(0.5, 0.5)),
    ),
    robot_start=RobotStart("counter", at_object="alcohol1"),
    objects=(*_drinks(_ALCOHOL, "alcohol", "wine"), *_drinks(_SOFT, "drink", "alcohol")),
    initial=(InitialOpenness("cabinet1", 0.9, 1.0), InitialOpenness("cabinet2", 0.9, 1.0)),
    goal=AllOf(
        AnyOf(_apart("cabinet1", "cabinet2"), _apart("cabinet2", "cabinet1")),
        *map(GripperFar, (*_ALCOHOL, *_SOFT)),
    ),
    stages=(
        Stage("pick_place", "place", "cabinet1", object="alcohol1"),
        Stage("pick_place", "place", "cabinet1", object="alcohol2"),
        *_take_away("non_alcohol1"),
        Stage("navigation", "drive", "non_alcohol2"),
        *_take_away("non_alcohol2"),
    ),
    instruction=(
        "Store the drinks with alcohol in one of the open cabinets and those without in the other: on the counter are "
        "{alcohol1+alcohol2+non_alcohol1+non_alcohol2}."
    ),
    paraphrases=(
        "Sort the drinks into the two open cabinets, one for alcohol, one for the rest.",
        "{alcohol1+alcohol2} go into one cabinet, {non_alcohol1+non_alcohol2} into the other.",
        "No cabinet should hold both alcohol and soft drinks: put the four drinks away like that.",
        "Keep alcohol and soft drinks apart, each kind in an open cabinet of its own.",
    ),
)


_SHELF_OF = {"fruit": "{fruit_shelf}", "vegetable": "{_vegetable_shelf}"}


def _shelve_food(scene: Drawn) -> tuple[Stage, ...]:
    shelf = scene.fill(_SHELF_OF[scene.choices["kind"]])
    return (
        *fetch("food", "counter", "fridge", part=f"fridge_shelf:{shelf}"),
        Stage("doors", "close_large", "fridge", part="fridge"),
    )


FRESH_PRODUCE_ORGANIZATION = Task(
    name="FreshProduceOrganization",
    summary="Fruit is on one shelf of the fridge, vegetables on another, the fridge is shut, the gripper away.",
    fixtures=(FixtureSpec("fridge", "fridge"), counter_near("fridge")),
    robot_start=RobotStart("counter", at_object="food"),
    choices=(
        Choice("kind", {"fruit": {}, "vegetable": {}}),
        Choice(
            "fruit_shelf",
            {
                "highest": {"_vegetable_shelf": "second_highest"},
                "second_highest": {"_vegetable_shelf": "highest"},
            },
        ),
    ),
    objects=(
        ObjectSpec(
            "food",
            ("{kind}",),
            on_counter("fridge", (1.0, 0.4), pos=(-0.25, -1.0)),
            graspable=True,
            properties=("graspable", "fridgable"),
        ),
        *(
            ObjectSpec(
                f"{kind}_fridge",
                (kind,),
                on_shelf(shelf, (0.4, 0.2), (None, None)),
                properties=("fridgable",),
                max_height=0.2,
            )
            for kind, shelf in reversed(_SHELF_OF.items())
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        When("kind", {kind: OnShelf("food", "fridge", shelf) for kind, shelf in _SHELF_OF.items()}),
        *(OnShelf(f"{kind}_fridge", "fridge", shelf) for kind, shelf in _SHELF_OF.items()),
        DoorsClosed("fridge", part="fridge"),
        *map(GripperFar, ("vegetable_fridge", "fruit_fridge", "food")),
    ),
    stages=_shelve_food,
    instruction="Put the {food} on the shelf of the fridge where another {kind} is, and close the fridge.",
    paraphrases=(
        "Fruit with fruit, vegetables with vegetables: that tells the shelf for the {food}. Shut the fridge then.",
        "The fridge has a shelf for each kind of produce; put the {food} on the right one and close the doors.",
        "Carry the {food} to the fridge, to the shelf that holds a {kind} already, and shut the fridge.",
        "Restock the fridge with the {food}, sorted, and leave it closed.",
    ),
)


def _breakfast(number: int) -> tuple[ObjectSpec, ...]:
    cabinet, counter = f"cabinet{number}", "counter" if number == 1 else "counter2"
    return (
        ObjectSpec(
            f"obj{number}",
            ("packaged_food",),
            on_counter(cabinet, (0.4, 0.2), counter=counter),
            graspable=True,
        ),
        ObjectSpec(
            f"distr_counter{number}",
            ("any",),
            on_counter(cabinet, (1.0, 0.3), pos=(0.0, 1.0), offset=(0.0, -0.05), counter=counter),
        ),
        ObjectSpec(f"distr_cab{number}", ("any",), in_cabinet(cabinet, (1.0, 0.2), pos=(0.0, 1.0))),
    )


STOCKING_BREAKFAST_FOODS = Task(
    name="StockingBreakfastFoods",
    summary="Each of the two packages is in the cabinet above it, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet1", "cabinet"),
        FixtureSpec("cabinet2", "cabinet", other_than=("cabinet1",)),
        counter_near("cabinet1"),
        counter_near("cabinet2", name="counter2"),
    ),
    robot_start=RobotStart("cabinet1"),
    objects=(*_breakfast(1), *_breakfast(2)),
    initial=(InitialOpenness("cabinet1", 0.9, 1.0), InitialOpenness("cabinet2", 0.9, 1.0)),
    goal=AllOf(
        ObjectInside("obj1", "cabinet1"), ObjectInside("obj2", "cabinet2"), GripperFar("obj1"), GripperFar("obj2")
    ),
    stages=(
        Stage("pick_place", "place", "cabinet1", object="obj1"),
        Stage("navigation", "drive", "cabinet2"),
        Stage("pick_place", "place", "cabinet2", object="obj2"),
    ),
    instruction="Put the {obj1} into the open cabinet above it, and the {obj2} into the other open cabinet, above it.",
    paraphrases=(
        "Stock both open cabinets, each with the package that stands below it.",
        "The {obj1} and the {obj2} belong in the cabinets over them.",
        "Store the {obj1} here, go to the other open cabinet, and store the {obj2} there.",
        "Two packages of breakfast food, two open cabinets: put each into the nearest one.",
    ),
)

TASKS = (
    BEVERAGE_SORTING,
    FRESH_PRODUCE_ORGANIZATION,
    REFILL_CONDIMENT_STATION,
    RESTOCK_BOWLS,
    RESTOCK_CANNED_FOOD,
    RESTOCK_PANTRY,
    STOCKING_BREAKFAST_FOODS,
)
