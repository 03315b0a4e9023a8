"""Share meals out: by the size of plates, and by weight."""

from robocasa_lerobot.envs.predicates import AllOf, Beside, GripperFar, ObjectOn, ObjectTouchesAnyCounter, StepsWhile
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
from robocasa_lerobot.envs.tasks.task import Task

_SIZES = {"small": ("stool1", 0.3, 0.05), "large": ("stool2", 0.4, 0.1)}


def _by_its_plate(bowl: str) -> AllOf:
    size = bowl.removeprefix("bowl_")
    stool, across, along = _SIZES[size]
    beside = Beside(bowl, f"plate_{size}", stool, across=across, along=along)
    return AllOf(beside, ObjectTouchesAnyCounter(bowl), GripperFar(bowl))


PORTION_ON_SIZE = Task(
    name="PortionOnSize",
    summary="The small bowl is beside the small plate, the large one beside the large plate, the gripper away.",
    fixtures=(
        FixtureSpec("cabinet", "cabinet_double_door"),
        FixtureSpec("stool1", "stool"),
        FixtureSpec("stool2", "stool", other_than=("stool1",)),
        FixtureSpec("dining_counter", "dining_counter", near="stool1"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("cabinet"),
    choices=(Choice("small_side", {"left": {}, "right": {}}),),
    objects=(
        ObjectSpec("plate_small", ("plate",), before_stool((0.3, 0.3), stool="stool1"), scale=0.75),
        ObjectSpec("plate_large", ("plate",), before_stool((0.4, 0.4), stool="stool2"), scale=1.25, repeats=True),
        ObjectSpec("appetizer", ("cheese", "fruit", "bread", "croissant"), Placement(object="plate_small")),
        ObjectSpec(
            "cooked_food",
            ("cooked_food",),
            Placement(object="plate_large", heaped=True),
            exclude=("kebab_skewer", "pizza"),
        ),
        ObjectSpec("meat", ("meat",), Placement(object="plate_large", heaped=True), graspable=True),
        ObjectSpec(
            "bowl_small",
            ("bowl",),
            in_cabinet("cabinet", (0.35, 0.4), pos=("{small_side}", -1.0)),
            graspable=True,
            scale=0.75,
        ),
        ObjectSpec(
            "bowl_large",
            ("bowl",),
            in_cabinet("cabinet", (0.6, 0.4), pos=("-{small_side}", -1.0)),
            graspable=True,
            scale=1.1,
            repeats=True,
        ),
    ),
    initial=(InitialOpenness("cabinet", 0.9, 1.0),),
    goal=AllOf(*_by_its_plate("bowl_small").parts, *_by_its_plate("bowl_large").parts),
    stages=fetch_in_turn(("bowl_small", "bowl_large"), "cabinet", "dining_counter", until=_by_its_plate),
    instruction=(
        "Set the small bowl from the cabinet beside the small plate on the dining counter, and the large bowl beside "
        "the large plate."
    ),
    paraphrases=(
        "The {appetizer} needs a small bowl at its side, the {cooked_food} a large one; both are in the cabinet.",
        "Match bowls and plates on the dining counter by size: small to small, large to large.",
        "Bring the cabinet's bowls to the dining counter, the smaller one next to the smaller plate.",
        "Beside the large plate goes the large bowl, beside the small plate the small one.",
    ),
)

_WEIGHED = StepsWhile(
    AllOf(ObjectOn("meat", "digital_scale"), GripperFar("meat", 0.1)), 50, label="meat_weighed_for_50_steps"
)

SCALE_PORTIONING = Task(
    name="ScalePortioning",
    summary="The meat was on the scale for 50 steps, let go, and is on the plate now, the gripper away.",
    fixtures=(
        FixtureSpec("stool", "stool"),
        FixtureSpec("dining_counter", "dining_counter", near="stool"),
        FixtureSpec("fridge", "fridge"),
        counter_near("fridge"),
    ),
    needs=("dining_counter",),
    robot_start=RobotStart("fridge"),
    objects=(
        ObjectSpec(
            "meat",
            ("meat",),
            Placement(
                "fridge",
                region=SampleRegion(name="fridge_shelf", height=(1.0, 1.5)),
                size=(0.3, 0.25),
                pos=(0.0, -1.0),
            ),
            graspable=True,
            exclude=("shrimp",),
            properties=("fridgable",),
        ),
        ObjectSpec(
            "digital_scale", ("digital_scale",), on_counter("fridge", (0.4, 0.5), pos=(0.0, -1.0), rotation=(0.0, 0.0))
        ),
        ObjectSpec("plate", ("plate",), before_stool((0.5, 0.5))),
        ObjectSpec(
            "distr",
            ("any",),
            Placement(
                "fridge", region=SampleRegion(name="fridge_shelf", height=(0.5, 1.5)), size=(0.6, 0.3), pos=(0.0, 1.0)
            ),
            exclude=("meat",),
            properties=("fridgable",),
        ),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(ObjectOn("meat", "plate"), _WEIGHED, GripperFar("meat")),
    stages=(
        *fetch("meat", "fridge", "digital_scale", until=_WEIGHED),
        *fetch("meat", "counter", "plate"),
    ),
    instruction=(
        "Lay the {meat} from the fridge on the scale, let it be weighed for a few seconds, and take it to the plate on "
        "the dining counter."
    ),
    paraphrases=(
        "Weigh the fridge's {meat} on the counter's scale before you put it on the plate at the dining counter.",
        "The {meat} belongs on the plate, but first on the scale, for a moment without a hand on it.",
        "Fridge, scale, plate: that is the way of the {meat}. Wait while it is weighed.",
        "Portion the {meat}: weigh it beside the fridge, then serve it on the dining counter's plate.",
    ),
)

TASKS = (PORTION_ON_SIZE, SCALE_PORTIONING)
