"""Make smoothies."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    ForEach,
    Goal,
    GripperFar,
    GripperFarFromPart,
    ObjectInside,
    ObjectOn,
    ObjectTouchesAnyCounter,
    StateIs,
)
from robocasa_lerobot.envs.scene.initial_states import LidAside
from robocasa_lerobot.envs.scene.spec import (
    FixtureSpec,
    InitialOpenness,
    ObjectSpec,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.composite.common import fetch
from robocasa_lerobot.envs.tasks.task import EachStage, Stage, Task

_BLENDER = (FixtureSpec("blender", "blender"), counter_near("blender"))
_OPEN = (LidAside("blender", gone=True),)
_THROUGH_THE_JUG = (0.085, 0.085, None)  # metres


def _beside(size: tuple[float, float]) -> Placement:
    return on_counter("blender", size, loc="left_right")


def _in_blender(name: str) -> Goal:
    return ObjectInside(name, "blender")


def _drop(name: str) -> tuple[Stage, ...]:
    return (Stage("pick_place", "place", "blender", object=name),)


ADD_ICE_CUBES = Task(
    name="AddIceCubes",
    summary="All the ice cubes are in the jug of the blender, the gripper away from each.",
    fixtures=_BLENDER,
    robot_start=RobotStart("counter", at_object="bowl"),
    objects=(
        ObjectSpec("bowl", ("bowl",), _beside((0.5, 0.35)), graspable=True, scale=(1.0, 1.0, 0.75)),
        ObjectSpec(
            "ice_cube",
            ("ice_cube",),
            Placement(object="bowl", heaped=True),
            count=(2, 3),
            graspable=True,
            scale=0.8,
            repeats=True,
        ),
    ),
    initial=_OPEN,
    goal=AllOf(ForEach("ice_cube", _in_blender), ForEach("ice_cube", GripperFar)),
    stages=(EachStage("ice_cube", _drop),),
    instruction="Put {ice_cube_all} ice cubes from the bowl into the blender.",
    paraphrases=(
        "The blender needs the bowl's ice, {ice_cube_all} cubes of it.",
        "Drop {ice_cube_all} ice cubes into the open blender.",
        "Ice for the smoothie: {ice_cube_all} cubes out of the bowl, into the blender's jug.",
        "Move the ice cubes into the blender, one after the other, until the bowl is empty.",
    ),
)

ADD_SWEETENER = Task(
    name="AddSweetener",
    summary="All the sugar cubes are in the jug of the blender, the gripper away from each.",
    fixtures=_BLENDER,
    robot_start=RobotStart("counter", at_object="plate"),
    objects=(
        ObjectSpec("obj", ("fruit",), Placement("blender", size=(0.4, 0.4), pos=(0.0, 0.0), margin=0.0), scale=0.8),
        ObjectSpec("plate", ("plate",), _beside((0.5, 0.35))),
        ObjectSpec(
            "sugar_cube",
            ("sugar_cube",),
            Placement(object="plate"),
            count=(2, 3),
            graspable=True,
            scale=1.25,
            repeats=True,
        ),
    ),
    initial=_OPEN,
    goal=AllOf(ForEach("sugar_cube", _in_blender), ForEach("sugar_cube", GripperFar)),
    stages=(EachStage("sugar_cube", _drop),),
    instruction="Put {sugar_cube_all} sugar cubes from the plate into the blender.",
    paraphrases=(
        "Sweeten the smoothie with {sugar_cube_all} sugar cubes on the plate.",
        "The fruit in the blender is not sweet enough: add {sugar_cube_all} cubes of sugar.",
        "Let {sugar_cube_all} sugar cubes drop from above into the blender.",
        "Clear the plate of sugar cubes, into the jug of the blender.",
    ),
)

_LID = "{blender}_lid"
_UNCOVERED = AllOf(ObjectTouchesAnyCounter(_LID), StateIs("blender", "lid", value=False), GripperFar(_LID, 0.15))
_RUNS = AllOf(StateIs("blender", "on"), GripperFarFromPart("blender", "button"))

BLEND_INGREDIENTS = Task(
    name="BlendIngredients",
    summary="The blender runs, with the fruit in its jug and its lid on, the gripper away from the button.",
    fixtures=_BLENDER,
    robot_start=RobotStart("blender"),
    objects=(ObjectSpec("fruit", ("fruit",), _beside((0.2, 0.2)), graspable=True, max_size=_THROUGH_THE_JUG),),
    goal=AllOf(_in_blender("fruit"), *_RUNS.parts),
    stages=(
        Stage("pick_place", "uncover", "blender", object=_LID, until=_UNCOVERED),
        *_drop("fruit"),
        Stage(
            "pick_place",
            "cover",
            "blender",
            object=_LID,
            until=AllOf(StateIs("blender", "lid"), GripperFar(_LID, 0.15)),
        ),
        Stage("buttons", "press", "blender", part="button", until=_RUNS),
    ),
    instruction="Open the blender, put the {fruit} into it, close it with its lid and switch it on.",
    paraphrases=(
        "Blend the {fruit}: lid off, fruit in, lid on, and press the button.",
        "The {fruit} should be blended, so fill it into the jug, cover that and start the blender.",
        "Uncover the blender for the {fruit}; cover it again before you turn it on.",
        "Make the blender run with the {fruit} inside and the lid in its place.",
    ),
)

_FOODS = ("smoothie_food1", "smoothie_food2")


def _in_fridge(size: tuple[float, float], along: float, **more: object) -> Placement:
    region = SampleRegion(name="fridge_shelf", **more)  # type: ignore[arg-type]
    return Placement("fridge", region=region, size=size, pos=(0.0, along))


PREPARE_SMOOTHIE = Task(
    name="PrepareSmoothie",
    summary="Both fruits lie on the plate by the blender, the gripper away; the other thing is still in the fridge.",
    fixtures=(FixtureSpec("fridge", "fridge"), *_BLENDER),
    robot_start=RobotStart("fridge"),
    objects=(
        *(
            ObjectSpec(
                name,
                ("fruit",),
                _in_fridge((0.4, 0.3), -1.0, height=(1.0, 1.5)),
                graspable=True,
                properties=("fridgable",),
                repeats=True,
            )
            for name in _FOODS
        ),
        ObjectSpec(
            "distr_item",
            ("any",),
            _in_fridge((0.2, 0.2), 1.0),
            properties=("fridgable",),
            exclude=("fruit", "vegetable"),
        ),
        ObjectSpec("plate", ("plate",), _beside((0.4, 0.35))),
    ),
    initial=(InitialOpenness("fridge", 0.9, 1.0, part="fridge"),),
    goal=AllOf(
        *(ObjectOn(name, "plate") for name in _FOODS), *map(GripperFar, _FOODS), ObjectInside("distr_item", "fridge")
    ),
    stages=(
        *fetch("smoothie_food1", "fridge", "plate"),
        Stage("navigation", "drive", "fridge"),
        *fetch("smoothie_food2", "fridge", "plate"),
    ),
    instruction="Put {smoothie_food1+smoothie_food2} from the fridge on the plate beside the blender.",
    paraphrases=(
        "For a smoothie {smoothie_food1+smoothie_food2} are needed at the blender: lay them on the plate there.",
        "Get the fruit out of the open fridge, {smoothie_food1+smoothie_food2}, and onto the blender's plate.",
        "The plate at the blender is for {smoothie_food1+smoothie_food2}. The rest of the fridge stays as it is.",
        "Bring {smoothie_food1+smoothie_food2} to the plate by the blender, and nothing else of the fridge.",
    ),
)

_IN_CUP = AllOf(ObjectOn("straw", "cup", within=0.06), GripperFar("cup"))

PLACE_STRAW = Task(
    name="PlaceStraw",
    summary="The straw is in the cup: it touches it, 6 cm from its middle at most; the gripper away from the cup.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer")),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec(
            "straw",
            ("straw",),
            Placement("drawer", size=(0.2, 0.2), pos=(None, 0.0)),
            graspable=True,
            scale=(1.75, 1.0, 1.75),
        ),
        ObjectSpec("cup", ("cup",), on_counter("drawer", (0.15, 0.15)), graspable=True, filled="smoothie"),
    ),
    # Published shares are of the slide's range, of which full travel is 0.55.
    initial=(InitialOpenness("drawer", 0.49, 0.55),),
    goal=_IN_CUP,
    stages=(
        Stage("pick_place", "pick", "drawer", object="straw"),
        Stage("pick_place", "place", "cup", object="straw", until=_IN_CUP),
    ),
    instruction="Take the straw out of the open drawer to the {side} and put it into the cup of smoothie.",
    paraphrases=(
        "The smoothie lacks its straw, which is in the drawer to your {side}.",
        "Put the straw of the {side} drawer into the cup on the counter.",
        "A straw belongs in the cup: there is one in the open drawer on the {side}.",
        "Pick the straw up in the {side} drawer and let it slip into the smoothie.",
    ),
)

TASKS = (ADD_ICE_CUBES, ADD_SWEETENER, BLEND_INGREDIENTS, PLACE_STRAW, PREPARE_SMOOTHIE)
