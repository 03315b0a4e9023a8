"""Chop vegetables."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, Not, ObjectOn
from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.spec import FixtureSpec, InitialOpenness, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter
from robocasa_lerobot.envs.tasks.task import Stage, Task

_TOOLS = {
    "garlic": "knife",
    "eggplant": "peeler",
    "broccoli": "knife",
    "carrot": "peeler",
    "cucumber": "peeler",
    "potato": "peeler",
    "avocado": "knife",
}
_HIGHER = (1.0, 1.0, 1.75)  # flat tools, so that they can be held
_IN_DRAWER = Placement("drawer", size=(0.3, 0.3), pos=(0.0, -1.0))
_BOARD = "food_container"


def _tools(scene: Drawn) -> tuple[str, str]:
    """What the food needs, and the other one."""
    tool = _TOOLS[scene.objects["food"].item.category.name]
    return tool, "knife" if tool == "peeler" else "peeler"


def _goal(scene: Drawn) -> AllOf:
    tool, other = _tools(scene)
    return AllOf(ObjectOn(tool, _BOARD), Not(ObjectOn(other, _BOARD)), GripperFar(_BOARD))


def _stages(scene: Drawn) -> tuple[Stage, ...]:
    tool, _ = _tools(scene)
    return (
        Stage("pick_place", "pick", "drawer", object=tool),
        Stage("pick_place", "place", _BOARD, object=tool),
    )


CUTTING_TOOL_SELECTION = Task(
    name="CuttingToolSelection",
    summary="The tool for the food's skin is on the cutting board, the other one is not, the gripper away.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer", size=(0.5, 0.5))),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec("peeler", ("peeler",), _IN_DRAWER, scale=_HIGHER, graspable=True),
        ObjectSpec("knife", ("knife",), _IN_DRAWER, scale=_HIGHER),
        ObjectSpec("distr", ("any",), on_counter("drawer", (0.6, 0.2), pos=("ref", 1.0)), exclude=("food",)),
        ObjectSpec("food", tuple(_TOOLS), on_counter("drawer", (0.5, 0.5), try_to_place_in="cutting_board")),
    ),
    initial=(InitialOpenness("drawer", 0.9, 1.0),),
    goal=_goal,
    stages=_stages,
    instruction=(
        "Of knife and peeler in the drawer, put the one that the skin of the {food} asks for on the cutting board."
    ),
    paraphrases=(
        "Lay the tool that takes off the outside of the {food} beside it on the cutting board.",
        "The {food} is to be prepared: bring knife or peeler, whichever suits it, from the drawer to the board.",
        "Decide between knife and peeler for the {food}, and lay that one on the board.",
        "Fetch the right tool for the outside of the {food} from the drawer and leave it on the cutting board.",
    ),
)


_BOTH = ("peeler", "knife")

GATHER_CUTTING_TOOLS = Task(
    name="GatherCuttingTools",
    summary="Peeler and knife lie on the cutting board, the gripper away from it.",
    fixtures=(FixtureSpec("drawer", "drawer_top"), counter_near("drawer", size=(0.5, 0.5))),
    robot_start=RobotStart("drawer", beside=True),
    objects=(
        ObjectSpec("peeler", ("peeler",), _IN_DRAWER, scale=_HIGHER, graspable=True),
        ObjectSpec("knife", ("knife",), _IN_DRAWER, scale=_HIGHER),
        ObjectSpec("distr", ("any",), on_counter("drawer", (0.6, 0.2), pos=("ref", 1.0))),
        ObjectSpec("cutting_board", ("cutting_board",), on_counter("drawer", (0.5, 0.5))),
    ),
    goal=AllOf(GripperFar("cutting_board"), *(ObjectOn(name, "cutting_board") for name in _BOTH)),
    stages=(
        Stage("drawers", "open", "drawer"),
        *(
            Stage(
                "pick_place",
                "place",
                "cutting_board",
                object=name,
                until=AllOf(ObjectOn(name, "cutting_board"), GripperFar("cutting_board")),
            )
            for name in _BOTH
        ),
    ),
    instruction="Open the drawer to the {side} and put the peeler and the knife from it on the cutting board.",
    paraphrases=(
        "Peeler and knife are in the closed drawer to your {side}; lay both on the cutting board.",
        "Gather what cuts: knife and peeler of the {side} drawer belong on the board.",
        "Pull the {side} drawer out, and move the peeler, then the knife, to the cutting board on the counter.",
        "The cutting board should have the peeler and the knife that the drawer to the {side} holds.",
    ),
)

TASKS = (CUTTING_TOOL_SELECTION, GATHER_CUTTING_TOOLS)
