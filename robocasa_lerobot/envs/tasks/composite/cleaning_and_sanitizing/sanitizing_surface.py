"""Get surfaces cleaned, and what it takes to where it is needed."""

from typing import Any

from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    NearFixture,
    Not,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnShelf,
    Strokes,
)
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
from robocasa_lerobot.envs.tasks.composite.common import both_together, fetch
from robocasa_lerobot.envs.tasks.task import Stage, Task

_CABINET_OPEN = InitialOpenness("cabinet", 0.9, 1.0)
_TOOLS = ("sponge", "dishbrush")


def _by_sink(name: str) -> AllOf:
    return AllOf(ObjectTouchesAnyCounter(name), NearFixture(name, "sink", 0.25), GripperFar(name))


def _bring_to_sink(name: str) -> tuple[Stage, ...]:
    return (
        Stage("pick_place", "pick", "cabinet", object=name),
        Stage("navigation", "drive", "sink", object=name),
        Stage(
            "pick_place",
            "place",
            "counter",
            object=name,
            until=_by_sink(name),
            text=f"put the {{{name}}} on the counter beside the sink",
        ),
    )


ARRANGE_SINK_SANITIZATION = Task(
    name="ArrangeSinkSanitization",
    summary="Sponge and dish brush are on the counter, 25 cm from the sink at most, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("sponge", ("sponge",), in_cabinet("cabinet", (0.8, 0.2)), graspable=True),
        ObjectSpec("dishbrush", ("dish_brush",), in_cabinet("cabinet", (0.8, 0.2)), graspable=True),
        ObjectSpec(
            "distr_cab",
            ("any",),
            in_cabinet("cabinet", (1.0, 0.5), pos=(0.0, -0.5)),
            exclude=("sponge", "dish_brush"),
        ),
    ),
    initial=(_CABINET_OPEN,),
    goal=AllOf(*_by_sink("sponge").parts, *_by_sink("dishbrush").parts),
    stages=(*_bring_to_sink("sponge"), Stage("navigation", "drive", "cabinet"), *_bring_to_sink("dishbrush")),
    instruction="Take the sponge and the dish brush out of the cabinet and put them on the counter beside the sink.",
    paraphrases=(
        "The sink is to be cleaned; sponge and dish brush from the cabinet should lie next to it.",
        "Bring the cabinet's sponge, then its dish brush, to the counter at the sink.",
        "What is needed at the sink is in the open cabinet: the sponge and the dish brush.",
        "Lay sponge and dish brush ready beside the sink; both are in the cabinet.",
    ),
)

_IN_MICROWAVE = AllOf(ObjectInside("obj", "microwave"), GripperFar("obj", 0.1))

CLEAN_MICROWAVE = Task(
    name="CleanMicrowave",
    summary="The sponge is in the microwave, the gripper 10 cm away from it.",
    fixtures=(
        FixtureSpec("microwave", "microwave"),
        counter_near("microwave"),
        counter_near("microwave", name="distr_counter"),
    ),
    robot_start=RobotStart("microwave"),
    objects=(
        ObjectSpec("obj", ("sponge",), on_counter("microwave", (0.25, 0.25)), graspable=True),
        ObjectSpec(
            "distr_counter",
            ("any",),
            on_counter("microwave", (0.3, 0.3), pos=("ref", 1.0), counter="distr_counter"),
        ),
    ),
    goal=_IN_MICROWAVE,
    stages=(
        Stage("doors", "open", "microwave"),
        Stage("navigation", "drive", "obj"),
        *fetch("obj", "counter", "microwave", until=_IN_MICROWAVE),
    ),
    instruction="Open the microwave and put the sponge from the counter inside.",
    paraphrases=(
        "The microwave needs cleaning: open its door and put the sponge in.",
        "With the microwave open, bring the sponge from the counter into it.",
        "Put the sponge into the closed microwave; its door may stay open.",
        "The sponge belongs in the microwave, so open that first.",
    ),
)


def _at_front(size: tuple[float, float], **more: object) -> Placement:
    return Placement(
        "counter",
        region=SampleRegion(ref="cabinet"),
        size=size,
        pos=(0.0, -1.0),
        rotation=(0.0, 0.0),
        reuse_region_from="food_bowl",
        **more,  # type: ignore[arg-type]
    )


def _food(name: str) -> ObjectSpec:
    return ObjectSpec(
        name,
        ("vegetable", "cooked_food", "meat"),
        Placement(object="food_bowl", heaped=True),
        graspable=True,
        properties=("fridgable",),
        exclude=("kebab_skewer",),
        repeats=True,
    )


_LARGEST = (0.25, 0.25, 0.15)  # metres
_PUT_AWAY = AllOf(ObjectInside("utensil", "drawer"), Not(ObjectTouchesAnyCounter("utensil")), GripperFar("utensil"))

COUNTERTOP_CLEANUP = Task(
    name="CountertopCleanup",
    summary=(
        "The utensil is in the drawer, the dish in the cabinet, the bowl with both kinds of food on a shelf of the "
        "fridge, the gripper away from all."
    ),
    fixtures=(
        FixtureSpec("cabinet", "cabinet_with_door"),
        counter_near("cabinet", size=(0.8, 0.5)),
        FixtureSpec("drawer", "drawer_top", near="cabinet"),
        FixtureSpec("fridge", "fridge"),
    ),
    robot_start=RobotStart("counter", at_object="utensil"),
    objects=(
        ObjectSpec("food_bowl", ("bowl",), on_counter("cabinet", (0.5, 0.35)), graspable=True),
        ObjectSpec(
            "receptacle",
            ("receptacle",),
            _at_front((1.0, 0.4)),
            graspable=True,
            exclude=("pitcher",),
            max_size=_LARGEST,
        ),
        ObjectSpec("utensil", ("spoon", "fork", "knife", "wooden_spoon"), _at_front((1.0, 0.4)), scale=(1.0, 1.0, 2.5)),
        _food("food1"),
        _food("food2"),
    ),
    # Published shares of the drawer are of the slide's range, of which full travel is 0.55.
    initial=(
        _CABINET_OPEN,
        InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        InitialOpenness("drawer", 0.49, 0.55),
    ),
    goal=AllOf(
        *_PUT_AWAY.parts,
        ObjectInside("receptacle", "cabinet"),
        *both_together("food1", "food2", "food_bowl"),
        OnShelf("food_bowl", "fridge"),
        GripperFar("receptacle"),
        GripperFar("food_bowl"),
    ),
    stages=(
        Stage("pick_place", "place", "drawer", object="utensil", until=_PUT_AWAY),
        Stage("pick_place", "place", "cabinet", object="receptacle"),
        *fetch("food_bowl", "counter", "fridge", part="fridge_shelf:any"),
    ),
    instruction=(
        "Put the {utensil} into the open drawer, the {receptacle} into the open cabinet, and the bowl with the food "
        "on a shelf of the fridge."
    ),
    paraphrases=(
        "Clear the counter: drawer for the {utensil}, cabinet for the {receptacle}, fridge for the bowl of food.",
        "Each has its place: {utensil} in the drawer, {receptacle} in the cabinet, filled bowl in the fridge.",
        "Tidy up the {utensil}, the {receptacle} and the bowl with {food1} and {food2}; all doors are open.",
        "The {utensil} goes into the drawer, the {receptacle} into the cabinet, the food in its bowl into the fridge.",
    ),
)

_CLEANERS = ("obj1", "obj2")

PREP_FOR_SANITIZING = Task(
    name="PrepForSanitizing",
    summary="Both cleaners stand on the counter, the gripper away from them.",
    fixtures=(FixtureSpec("cabinet", "cabinet_with_door"), counter_near("cabinet")),
    robot_start=RobotStart("cabinet"),
    objects=(
        *(
            ObjectSpec(
                name,
                ("cleaner",),
                in_cabinet("cabinet", (0.5, 0.2), pos=(across, -1.0)),
                graspable=True,
                repeats=True,
            )
            for name, across in zip(_CLEANERS, (-0.5, 0.5), strict=True)
        ),
        ObjectSpec("distr_counter", ("any",), on_counter("cabinet", (1.0, 0.3), pos=(0.0, 1.0), offset=(0.0, -0.05))),
        ObjectSpec("distr_cab", ("any",), in_cabinet("cabinet", (1.0, 0.2), pos=(0.0, 1.0))),
    ),
    goal=AllOf(*(ObjectTouches(name, "counter") for name in _CLEANERS), *map(GripperFar, _CLEANERS)),
    stages=(
        Stage("doors", "open", "cabinet"),
        *(Stage("pick_place", "place", "counter", object=name) for name in _CLEANERS),
    ),
    instruction="Open the cabinet and put {obj1+obj2} from it on the counter.",
    paraphrases=(
        "To clean the counter, {obj1+obj2} are needed: they are in the closed cabinet.",
        "Get {obj1+obj2} out of the cabinet and stand them on the counter below.",
        "The cleaning things, {obj1+obj2}, should be on the counter; open the cabinet for them.",
        "Take both cleaners out of the cabinet, onto the counter.",
    ),
)


def _wiping(surface: str, strokes: Strokes, start: Placement, text: str) -> dict[str, Any]:
    done = AllOf(strokes, GripperFar("sponge", 0.15))
    return {
        "objects": (ObjectSpec("sponge", ("sponge",), start, graspable=True),),
        "goal": done,
        "stages": (
            Stage("pick_place", "pick", "counter", object="sponge"),
            Stage("pick_place", "wipe", surface, object="sponge", until=done, text=text),
        ),
    }


SANITIZE_SINK = Task(
    name="SanitizeSink",
    summary="The held sponge has rubbed the sink at 5 places or more over 10 cm, and the gripper has let it go.",
    fixtures=(FixtureSpec("sink", "sink"), counter_near("sink")),
    robot_start=RobotStart("counter", at_object="sponge"),
    **_wiping(
        "sink",
        Strokes("sponge", "sink", apart_m=0.025),
        on_counter("sink", (0.2, 0.2), loc="left_right", pos=("ref", -0.8)),
        "scrub the sink with the sponge and let go of it",
    ),
    instruction="Pick up the sponge, rub the inside of the sink with it in several places and release the sponge.",
    paraphrases=(
        "Scrub the sink with the sponge that lies beside it, then let the sponge go.",
        "The sink is dirty; clean its basin with the sponge.",
        "Wipe over the bottom of the sink with the sponge from the counter, and leave the sponge.",
        "Use the sponge on the basin until it is clean, and put the sponge down.",
    ),
)

WIPE_TABLE = Task(
    name="WipeTable",
    summary="The held sponge has rubbed a counter at 5 places or more over 10 cm, and the gripper has let it go.",
    fixtures=(FixtureSpec("counter", "counter"),),
    robot_start=RobotStart("counter", at_object="sponge"),
    **_wiping(
        "counter",
        Strokes("sponge", ""),
        Placement("counter", size=(0.5, 0.2), pos=(1.0, -1.0)),
        "wipe the counter with the sponge and let go of it",
    ),
    instruction="Pick up the sponge, wipe the counter with it in several places and release the sponge.",
    paraphrases=(
        "Wipe the counter with the sponge that lies on it, then let the sponge go.",
        "The counter top is dirty; rub it with the sponge.",
        "Clean the counter: take the sponge, move it to and fro over the top, and leave it there.",
        "Use the sponge on the counter until that is clean, and put the sponge down.",
    ),
)

TASKS = (
    ARRANGE_SINK_SANITIZATION,
    CLEAN_MICROWAVE,
    COUNTERTOP_CLEANUP,
    PREP_FOR_SANITIZING,
    SANITIZE_SINK,
    WIPE_TABLE,
)
