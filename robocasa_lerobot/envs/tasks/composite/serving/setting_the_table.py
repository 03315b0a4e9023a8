"""Set the table."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Beside, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.spec import Choice, FixtureSpec, ObjectSpec, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, on_shelf
from robocasa_lerobot.envs.tasks.task import Stage, Task

_CENTRE = Placement("dining_table", size=(1.0, 0.3), pos=(0.0, 0.0))

ARRANGE_BREAD_BASKET = Task(
    name="ArrangeBreadBasket",
    summary="The bread lies in the basket, the basket stands on the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_table", "counter", near="stool", size=(0.75, 0.2)),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("bread", ("bread",), in_cabinet("cabinet", (0.5, 0.4)), graspable=True),
        ObjectSpec("basket", ("basket",), on_counter("cabinet", (0.5, 0.5))),
        ObjectSpec("dstr_dining", ("any",), _CENTRE),
        ObjectSpec("dstr_dining2", ("any",), _CENTRE),
    ),
    goal=AllOf(ObjectOn("bread", "basket"), ObjectTouches("basket", "dining_table"), GripperFar("basket")),
    stages=(
        Stage("doors", "open", "cabinet"),
        Stage("pick_place", "place", "basket", object="bread"),
        Stage("pick_place", "pick", "counter", object="basket"),
        Stage("navigation", "drive", "dining_table", object="basket"),
        Stage("pick_place", "place", "dining_table", object="basket"),
    ),
    instruction="Put the bread from the cabinet into the basket and take the basket to the dining counter.",
    paraphrases=(
        "Set the table with the bread: into the basket with it, and the basket onto the dining counter.",
        "The bread in the cabinet goes into the basket, and the basket to where people eat.",
        "Open the cabinet, lay the bread in the basket, and carry that over to the dining counter.",
        "Bring the basket to the dining counter with the cabinet's bread in it.",
    ),
)

DATE_NIGHT = Task(
    name="DateNight",
    summary="Candle and bottle stand on the dining counter, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), FixtureSpec("dining_table", "dining_counter", size=(0.5, 0.2))),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("decoration", ("candle",), in_cabinet("cabinet", (0.5, 0.2), pos=(1.0, -1.0)), graspable=True),
        ObjectSpec("alcohol", ("alcohol",), in_cabinet("cabinet", (0.5, 0.2), pos=(-1.0, -1.0)), graspable=True),
    ),
    goal=AllOf(
        ObjectTouches("decoration", "dining_table"),
        ObjectTouches("alcohol", "dining_table"),
        GripperFar("decoration"),
        GripperFar("alcohol"),
    ),
    stages=(
        Stage("doors", "open", "cabinet"),
        *fetch("decoration", "cabinet", "dining_table"),
        Stage("navigation", "drive", "cabinet"),
        *fetch("alcohol", "cabinet", "dining_table"),
    ),
    instruction="Bring the {decoration} and the {alcohol} from the cabinet to the dining counter.",
    paraphrases=(
        "Set the table for two: the cabinet's {decoration} and {alcohol} belong on the dining counter.",
        "Tonight is a date: put {decoration} and {alcohol} out on the dining counter.",
        "Open the cabinet, and carry the {decoration} and then the {alcohol} to the dining counter.",
        "The dining counter should have the {decoration} and the {alcohol} that are in the cabinet.",
    ),
)


def _nested(names: tuple[str, ...], inner: int) -> ObjectOn:
    return ObjectOn(names[inner], names[inner - 1])


def _nested_goal(scene: Drawn) -> AllOf:
    names = scene.named("obj")
    return AllOf(AllOf(*(_nested(names, inner) for inner in range(1, len(names)))), GripperFar(names[0]))


def _nesting(scene: Drawn) -> tuple[Stage, ...]:
    names = scene.named("obj")
    return tuple(
        Stage(
            "pick_place",
            "place",
            names[inner - 1],
            object=names[inner],
            text="put the next smaller {kind} into the larger one",
        )
        for inner in range(1, len(names))
    )


SIZE_SORTING = Task(
    name="SizeSorting",
    summary="Every cup or bowl is in the one that is next larger, the gripper away from the largest.",
    fixtures=(FixtureSpec("counter", "counter", size=(0.9, 0.4)),),
    robot_start=RobotStart("counter", at_object="obj_0"),
    choices=(Choice("kind", {"cup": {}, "bowl": {}}),),
    objects=(
        ObjectSpec(
            "obj",
            ("{kind}",),
            Placement(
                "counter",
                region=SampleRegion(top_size=(0.9, 0.4)),
                size=(0.6, 0.4),
                pos=(None, -1.0),
                reuse_region_from="obj",
            ),
            count=(2, 3),
            scale_step=0.8,
            same_category_as="obj",
            same_model=True,
            graspable=True,
        ),
    ),
    goal=_nested_goal,
    stages=_nesting,
    instruction="Stack the {kind}s into each other, the largest at the bottom and the smallest at the top.",
    paraphrases=(
        "Nest the {kind}s by their size, each in the next larger one.",
        "Make one stack of the {kind}s: smaller ones go into larger ones.",
        "Every {kind} but the largest belongs in the one that is just larger.",
        "Sort the {kind}s by size into a single stack that stands on the largest.",
    ),
)


def _each_on(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn("bowl1", first), ObjectOn("bowl2", second))


SET_BOWLS_FOR_SOUP = Task(
    name="SetBowlsForSoup",
    summary="Each of the bowls stands on a plate of its own, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_double_door"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_table", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("plate1", ("plate",), before_stool((0.35, 0.35), counter="dining_table", stool="stool1")),
        ObjectSpec(
            "plate2", ("plate",), before_stool((0.35, 0.35), counter="dining_table", stool="stool2"), repeats=True
        ),
        ObjectSpec("bowl1", ("bowl",), in_cabinet("cabinet", (0.5, 0.5), pos=(-1.0, -1.0)), graspable=True),
        ObjectSpec(
            "bowl2", ("bowl",), in_cabinet("cabinet", (0.5, 0.5), pos=(1.0, -1.0)), graspable=True, repeats=True
        ),
    ),
    goal=AllOf(
        AnyOf(_each_on("plate1", "plate2"), _each_on("plate2", "plate1")), GripperFar("bowl1"), GripperFar("bowl2")
    ),
    stages=(
        Stage("doors", "open", "cabinet"),
        *fetch("bowl1", "cabinet", "plate1"),
        Stage("navigation", "drive", "cabinet"),
        *fetch("bowl2", "cabinet", "plate2"),
    ),
    instruction="Take both bowls out of the cabinet and set one on each plate at the dining counter.",
    paraphrases=(
        "There will be soup: every plate on the dining counter gets a bowl from the cabinet.",
        "Open the cabinet and carry its two bowls to the plates, one for each.",
        "Put a bowl on either plate at the dining counter; the bowls are in the cabinet.",
        "Set the table for soup with the cabinet's bowls on the two plates.",
    ),
)


def _spice(name: str, x: float) -> ObjectSpec:
    return ObjectSpec(
        name, ("condiment",), in_cabinet("cabinet", (0.4, 0.2), pos=(x, -1.0)), graspable=True, repeats=True
    )


_IN_THE_MIDDLE = Placement("dining_table", size=(1.0, 0.4), pos=(0.0, 0.0))

SEASONING_SPICE_SETUP = Task(
    name="SeasoningSpiceSetup",
    summary="Both condiments stand on the dining counter, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet"), FixtureSpec("dining_table", "dining_counter", size=(0.75, 0.2))),
    robot_start=RobotStart("cabinet"),
    objects=(
        _spice("condiment1", -0.5),
        _spice("condiment2", 0.5),
        ObjectSpec("dstr_dining", ("any",), _IN_THE_MIDDLE),
        ObjectSpec("dstr_dining2", ("any",), replace(_IN_THE_MIDDLE, reuse_region_from="dstr_dining")),
    ),
    goal=AllOf(
        ObjectTouches("condiment1", "dining_table"),
        ObjectTouches("condiment2", "dining_table"),
        GripperFar("condiment1"),
        GripperFar("condiment2"),
    ),
    stages=(
        Stage("doors", "open", "cabinet"),
        *fetch("condiment1", "cabinet", "dining_table"),
        Stage("navigation", "drive", "cabinet"),
        *fetch("condiment2", "cabinet", "dining_table"),
    ),
    instruction="Bring the {condiment1} and the {condiment2} from the cabinet to the dining counter.",
    paraphrases=(
        "The dining counter needs something to season with: {condiment1} and {condiment2} are in the cabinet.",
        "Open the cabinet and carry the {condiment1}, then the {condiment2}, to the dining counter.",
        "Set {condiment1} and {condiment2} on the dining counter; both are in the closed cabinet.",
        "Whoever eats wants the {condiment1} and the {condiment2} on the dining counter.",
    ),
)


def _in_fruit_bowl(name: str) -> AllOf:
    return AllOf(ObjectOn(name, "bowl"), GripperFar("bowl"))


SETUP_FRUIT_BOWL = Task(
    name="SetupFruitBowl",
    summary="Both fruits are in the bowl on the dining counter, the gripper away from it.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec("fruit1", ("fruit",), on_shelf("highest", (0.4, 0.2)), graspable=True),
        ObjectSpec("fruit2", ("fruit",), on_shelf("second_highest", (0.4, 0.2)), graspable=True),
        ObjectSpec("bowl", ("bowl",), before_stool((0.4, 0.35), pos=(0.0, -0.9))),
    ),
    goal=AllOf(
        ObjectOn("fruit1", "bowl"),
        ObjectOn("fruit2", "bowl"),
        ObjectTouches("bowl", "dining_counter"),
        GripperFar("bowl"),
    ),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("fruit1", "fridge", "bowl", until=_in_fruit_bowl("fruit1")),
        Stage("navigation", "drive", "fridge"),
        *fetch("fruit2", "fridge", "bowl", until=_in_fruit_bowl("fruit2")),
    ),
    instruction="Put the {fruit1} and the {fruit2} from the fridge into the bowl on the dining counter.",
    paraphrases=(
        "Fill the dining counter's bowl with the {fruit1} and the {fruit2} that are in the fridge.",
        "The fruit bowl on the dining counter is empty: fetch {fruit1} and {fruit2} from the fridge.",
        "Open the fridge and bring its {fruit1} and its {fruit2} to the bowl at the dining counter.",
        "Both fruits in the fridge, {fruit1} and {fruit2}, belong in the bowl.",
    ),
)

_HIGHER = (1.15, 1.15, 2.15)  # flat cutlery, so that it can be held


def _beside_plate(name: str, side: str) -> AllOf:
    return AllOf(
        Beside(name, "plate", "stool", across=0.25, along=0.1, side=side),
        ObjectTouches(name, "dining_counter"),
        GripperFar(name),
    )


def _cutlery(name: str, again: str = "") -> ObjectSpec:
    start = on_counter("cabinet", (1.0, 0.35), pos=(0.0, -1.0), rotation=(0.0, 0.0), reuse_region_from=again)
    return ObjectSpec(name, (name,), start, scale=_HIGHER)


def _align(name: str, side: str) -> tuple[Stage, ...]:
    *carried, put = fetch(name, "counter", "dining_counter", until=_beside_plate(name, side))
    return *carried, replace(put, text=f"put the {name} on the dining counter to the {side} of the plate")


ALIGN_SILVERWARE = Task(
    name="AlignSilverware",
    summary="On the dining counter, the fork is at the left of the plate and the spoon at its right, the gripper away.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("counter", at_object="fork"),
    objects=(
        ObjectSpec("plate", ("plate",), before_stool((0.3, 0.3)), scale=1.15),
        _cutlery("fork"),
        _cutlery("spoon", again="fork"),
    ),
    goal=AllOf(*_beside_plate("fork", "left").parts, *_beside_plate("spoon", "right").parts, GripperFar("plate")),
    stages=(*_align("fork", "left"), Stage("navigation", "drive", "spoon"), *_align("spoon", "right")),
    instruction=(
        "Lay the fork at the left and the spoon at the right of the plate on the dining counter, close to it, as seen "
        "from the stool."
    ),
    paraphrases=(
        "Whoever sits before the plate should find the fork at the left hand and the spoon at the right.",
        "Set the place: fork to the left of the plate, spoon to its right, both from the counter by the cabinet.",
        "Bring fork and spoon to the plate on the dining counter, the fork to its left and the spoon to its right.",
        "Align the silverware with the plate: spoon right, fork left, for somebody on the stool.",
    ),
)

TASKS = (
    ALIGN_SILVERWARE,
    ARRANGE_BREAD_BASKET,
    DATE_NIGHT,
    SEASONING_SPICE_SETUP,
    SET_BOWLS_FOR_SOUP,
    SETUP_FRUIT_BOWL,
    SIZE_SORTING,
)
