"""Set the table: drinkware, butter, bread, and places before stools."""

from dataclasses import replace

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    BeforeStools,
    Beside,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
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
from robocasa_lerobot.envs.tasks.composite.common import before_stool, fetch, fetch_in_turn
from robocasa_lerobot.envs.tasks.task import Stage, Task

_DRINKWARE = ("pitcher", "cup")

ARRANGE_DRINKWARE = Task(
    name="ArrangeDrinkware",
    summary="Pitcher and cup stand on the dining counter, the gripper away from them.",
    fixtures=(
        FixtureSpec("sink", "sink"),
        counter_near("sink", name="sink_counter"),
        FixtureSpec("dining_counter", "dining_counter"),
    ),
    robot_start=RobotStart("sink_counter", at_object="pitcher"),
    objects=(
        ObjectSpec(
            "pitcher",
            ("pitcher",),
            on_counter("sink", (0.5, 0.3), loc="left_right", counter="sink_counter"),
            graspable=True,
        ),
        ObjectSpec(
            "cup",
            ("cup",),
            Placement(
                "sink_counter",
                region=SampleRegion(ref="sink"),
                size=(0.5, 0.3),
                pos=(0.0, -1.0),
                reuse_region_from="pitcher",
            ),
            graspable=True,
        ),
    ),
    goal=AllOf(*(ObjectTouches(name, "dining_counter") for name in _DRINKWARE), *map(GripperFar, _DRINKWARE)),
    stages=fetch_in_turn(_DRINKWARE, "sink_counter", "dining_counter", along=True),
    instruction="Bring the pitcher and the cup from the counter beside the sink to the dining counter.",
    paraphrases=(
        "Guests are thirsty: the pitcher and the cup by the sink belong on the dining counter.",
        "Carry the pitcher to the dining counter, then the cup; both stand next to the sink.",
        "Move pitcher and cup from beside the sink over to where people eat.",
        "Set the dining counter with the drinkware that stands at the sink.",
    ),
)


def _all_there(scene: Drawn) -> AllOf:
    drinks = scene.named("obj")
    return AllOf(AllOf(*(ObjectTouches(name, "dining_table") for name in drinks)), GripperFar(drinks[0]))


def _carried(scene: Drawn) -> tuple[Stage, ...]:
    return fetch_in_turn(scene.named("obj"), "counter", "dining_table", along=True)


BEVERAGE_ORGANIZATION = Task(
    name="BeverageOrganization",
    summary="All the drinks stand on the dining counter, the gripper away from the first.",
    fixtures=(
        FixtureSpec("dining_table", "dining_counter", size=(0.75, 0.2)),
        FixtureSpec("counter", "counter", other_than=("dining_table",)),
    ),
    robot_start=RobotStart("counter", at_object="obj_0"),
    objects=(
        ObjectSpec(
            "obj",
            ("drink",),
            Placement("counter", region=SampleRegion(top_size=(0.6, 0.4)), size=(0.6, 0.4), pos=(0.0, -1.0)),
            count=(2, 4),
            graspable=True,
        ),
    ),
    goal=_all_there,
    stages=_carried,
    instruction="Carry {obj} from this counter to the dining counter.",
    paraphrases=(
        "All the drinks on this counter belong on the dining counter.",
        "Bring {obj} over to the dining counter, one after the other.",
        "Clear this counter of its drinks: they go to where people eat.",
        "Set the table with drinks: {obj}, all of them from the counter ahead.",
    ),
)

_KNIFE_BY_PLATE = AllOf(
    Near("butter_knife", "plate", 0.3), ObjectTouchesAnyCounter("butter_knife"), GripperFar("butter_knife")
)
*_KNIFE_CARRIED, _KNIFE_PUT = fetch("butter_knife", "counter", "dining_counter", until=_KNIFE_BY_PLATE)

SETUP_BUTTER_PLATE = Task(
    name="SetupButterPlate",
    summary="The butter is on the plate, the knife on a counter, 30 cm from the plate at most, the gripper away.",
    fixtures=(
        FixtureSpec("fridge", "fridge"),
        counter_near("fridge"),
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
    ),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "butter",
            ("butter_stick",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.2, 0.2),
                pos=(0.0, -0.9),
            ),
            graspable=True,
            scale=1.15,
        ),
        ObjectSpec(
            "fridge_distractor",
            ("any",),
            Placement("fridge", region=SampleRegion(name="fridge_shelf:any"), size=(0.35, 0.35), pos=(0.0, 1.0)),
            exclude=("butter_stick",),
            properties=("fridgable",),
        ),
        ObjectSpec("plate", ("plate",), before_stool((0.4, 0.4), pos=("ref", -0.9)), scale=1.15),
        ObjectSpec("butter_knife", ("knife",), on_counter("fridge", (0.3, 0.35)), scale=(1.1, 1.1, 1.75)),
    ),
    goal=AllOf(ObjectOn("butter", "plate"), *_KNIFE_BY_PLATE.parts, GripperFar("butter")),
    stages=(
        Stage("doors", "open", "fridge", part="fridge"),
        *fetch("butter", "fridge", "plate"),
        Stage("navigation", "drive", "butter_knife"),
        *_KNIFE_CARRIED,
        replace(_KNIFE_PUT, text="put the knife on the dining counter beside the plate"),
    ),
    instruction=(
        "Put the butter from the fridge on the plate on the dining counter, and lay the knife from the counter by the "
        "fridge beside the plate."
    ),
    paraphrases=(
        "The dining counter's plate gets the fridge's butter, and the knife by the fridge goes next to it.",
        "Serve butter: open the fridge, carry the butter to the plate, then fetch the knife to its side.",
        "Bring butter and knife to the dining counter: butter onto the plate, knife beside the plate.",
        "Set the plate on the dining counter up with butter, and lay the knife close to it.",
    ),
)

_GLASSES, _PLATES = ("wine_glass1", "wine_glass2"), ("plate1", "plate2")


def _at_plate(glass: str, plate: str) -> Beside:
    return Beside(glass, plate, "stool1", across=0.25, along=0.1)


def _glass_set(name: str) -> AllOf:
    plate = name.replace("wine_glass", "plate")
    return AllOf(_at_plate(name, plate), ObjectTouches(name, "dining_counter"), GripperFar(name))


SETUP_WINE_GLASSES = Task(
    name="SetupWineGlasses",
    summary="Each plate on the dining counter has a wine glass of its own beside it, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet"),
        counter_near("cabinet"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("counter", at_object="wine_glass1"),
    objects=(
        *(
            ObjectSpec(name, ("plate",), before_stool((0.3, 0.3), stool=name.replace("plate", "stool")), repeats=True)
            for name in _PLATES
        ),
        *(
            ObjectSpec(
                name,
                ("wine_glass",),
                on_counter(
                    "cabinet",
                    (0.5, 0.3),
                    pos=(0.0, -1.0),
                    reuse_region_from="" if name == "wine_glass1" else "wine_glass1",
                ),
                graspable=True,
                repeats=True,
            )
            for name in _GLASSES
        ),
    ),
    goal=AllOf(
        AnyOf(
            *(
                AllOf(*(_at_plate(*pair) for pair in zip(_GLASSES, plates, strict=True)))
                for plates in (_PLATES, _PLATES[::-1])
            )
        ),
        *(ObjectTouches(name, "dining_counter") for name in _GLASSES),
        *map(GripperFar, _GLASSES),
    ),
    stages=fetch_in_turn(_GLASSES, "counter", "dining_counter", until=_glass_set, along=True),
    instruction="Bring both wine glasses from the counter to the dining counter, one to the side of each plate.",
    paraphrases=(
        "Every plate on the dining counter should have a wine glass beside it; the two glasses are on the counter.",
        "Set the table for wine: a glass next to either plate.",
        "Carry one wine glass to the side of one plate, and the other glass to the other plate.",
        "Lay out the wine glasses at the dining counter so that each plate gets its own.",
    ),
)

_BOWLS = ("bowl1", "bowl2")


def _before_stools(*names: str) -> BeforeStools:
    return BeforeStools(names, across=0.15, along=0.3)


def _bowl_set(name: str) -> AllOf:
    """Before a stool, the second one before another than the first."""
    before = _before_stools(*_BOWLS[: _BOWLS.index(name) + 1])
    return AllOf(before, ObjectTouches(name, "dining_counter"), GripperFar(name))


SETUP_BOWLS = Task(
    name="SetupBowls",
    summary="Each of the bowls stands on the dining counter before a stool of its own, the gripper away from both.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_double_door"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    robot_start=RobotStart("cabinet"),
    objects=(
        ObjectSpec("bowl1", ("bowl",), in_cabinet("cabinet", (1.0, 0.3), pos=(-1.0, -1.0)), graspable=True),
        ObjectSpec(
            "bowl2", ("bowl",), in_cabinet("cabinet", (1.0, 0.3), pos=(1.0, -1.0)), graspable=True, repeats=True
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(
        _before_stools(*_BOWLS),
        *(ObjectTouches(name, "dining_counter") for name in _BOWLS),
        *map(GripperFar, _BOWLS),
    ),
    stages=fetch_in_turn(_BOWLS, "cabinet", "dining_counter", until=_bowl_set),
    instruction="Take both bowls from the cabinet to the dining counter and put each before another stool.",
    paraphrases=(
        "Two people will eat: the cabinet's bowls go to the dining counter, one before the stool of each.",
        "Lay two places at the dining counter with the bowls from the open cabinet, no two at one stool.",
        "Carry one bowl after the other from the cabinet to the dining counter; every bowl gets a stool of its own.",
        "A stool and a bowl before it, twice: the bowls stand in the open cabinet.",
    ),
)

_WARM, _OLD = "toaster_oven_bread", "bowl_bread"

ARRANGE_BREAD_BOWL = Task(
    name="ArrangeBreadBowl",
    summary="Both kinds of bread lie in the bowl, or one on the other; it stands on the dining counter, let go.",
    fixtures=(
        FixtureSpec("toaster_oven", "toaster_oven"),
        counter_near("toaster_oven"),
        FixtureSpec("dining_counter", "dining_counter"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("toaster_oven"),
    choices=(Choice("rack", of="toaster_oven", last=True),),
    objects=(
        ObjectSpec(
            _WARM,
            ("bread_food",),
            Placement("toaster_oven", region=SampleRegion(name="{rack}"), size=(0.5, 0.3), pos=(0.0, -1.0)),
            graspable=True,
            exclude=("hotdog_bun", "baguette"),
        ),
        ObjectSpec(
            "bowl",
            ("bowl",),
            on_counter("toaster_oven", (0.5, 0.3), loc="left_right"),
            graspable=True,
            scale=(1.25, 1.25, 1.25),
        ),
        ObjectSpec(_OLD, ("bread_food",), Placement(object="bowl"), exclude=("hotdog_bun",)),
    ),
    initial=(InitialOpenness("toaster_oven", 1.0, 1.0),),
    goal=AllOf(
        AnyOf(ObjectOn(_WARM, "bowl"), ObjectOn(_OLD, "bowl")),
        AnyOf(AllOf(ObjectOn(_WARM, "bowl"), ObjectOn(_OLD, "bowl")), ObjectTouches(_WARM, _OLD)),
        ObjectTouches("bowl", "dining_counter"),
        GripperFar("bowl"),
    ),
    stages=(
        Stage("racks", "pull", "toaster_oven", part="{rack}"),
        Stage(
            "pick_place",
            "place",
            "bowl",
            object=_WARM,
            until=AllOf(AnyOf(ObjectOn(_WARM, "bowl"), ObjectTouches(_WARM, _OLD)), GripperFar(_WARM)),
        ),
        *fetch("bowl", "counter", "dining_counter"),
    ),
    instruction="Put the {toaster_oven_bread} from the toaster oven into the bowl, and the bowl on the dining counter.",
    paraphrases=(
        "The bread bowl takes the warm {toaster_oven_bread} from the toaster oven; then serve it where people eat.",
        "Pull out the rack, lay the {toaster_oven_bread} in the bowl beside, carry all to the dining counter.",
        "On the dining counter should stand the bowl with both the {toaster_oven_bread} and the {bowl_bread}.",
        "Fill up the bowl with the toaster oven's {toaster_oven_bread} and bring it to the dining counter.",
    ),
)

TASKS = (
    ARRANGE_BREAD_BOWL,
    ARRANGE_DRINKWARE,
    BEVERAGE_ORGANIZATION,
    SETUP_BOWLS,
    SETUP_BUTTER_PLATE,
    SETUP_WINE_GLASSES,
)
