"""Set the table."""

from robocasa_lerobot.envs.predicates import AllOf, GripperFar, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, in_cabinet, on_counter
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

TASKS = (ARRANGE_BREAD_BASKET,)
