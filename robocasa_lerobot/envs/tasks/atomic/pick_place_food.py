"""Pick and place of food on a counter: onto bread, into a glass, into a box."""

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    GripperFar,
    ObjectOn,
    ObjectTouches,
)
from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, RobotStart
from robocasa_lerobot.envs.tasks.atomic.common import counter_near, on_counter, place
from robocasa_lerobot.envs.tasks.task import Task

COUNTER = (
    Task(
        name="CheesyBread",
        summary="The bread is on the board, the cheese on the bread, the gripper away.",
        fixtures=(FixtureSpec("counter", "counter", size=(0.6, 0.6)),),
        robot_start=RobotStart("counter", at_object="cheese"),
        objects=(
            ObjectSpec("bread_container", ("cutting_board",), Placement("counter", size=(0.5, 0.7), pos=(0.0, -1.0))),
            ObjectSpec("bread", ("bread_flat",), Placement(object="bread_container"), scale=1.5),
            ObjectSpec(
                "cheese",
                ("cheese",),
                Placement("counter", reuse_region_from="bread_container", size=(1.0, 0.3), pos=(0.0, -1.0)),
                graspable=True,
            ),
            ObjectSpec(
                "distr_counter",
                ("any",),
                Placement("counter", reuse_region_from="bread_container", size=(1.0, 0.2), pos=(0.0, 1.0)),
            ),
        ),
        goal=AllOf(ObjectOn("bread", "bread_container"), ObjectTouches("cheese", "bread"), GripperFar("cheese")),
        stages=place("cheese", "bread"),
        instruction="Put the cheese on the bread on the cutting board.",
        paraphrases=(
            "Make cheese bread: the cheese goes on top of the bread.",
            "Lay the piece of cheese onto the bread.",
            "The bread on the board should be covered with the cheese.",
            "Pick up the cheese and place it on the slice of bread.",
        ),
    ),
    Task(
        name="MakeIcedCoffee",
        summary="One of the ice cubes is inside the glass, the gripper 15 cm away from both.",
        fixtures=(FixtureSpec("cabinet", "cabinet"), counter_near("cabinet")),
        robot_start=RobotStart("counter", at_object="ice_bowl"),
        objects=(
            ObjectSpec(
                "ice_bowl", ("bowl",), on_counter("cabinet", (1.0, 0.4), pos=(0.0, -1.0)), scale=(1.0, 1.0, 0.75)
            ),
            ObjectSpec("ice_cube1", ("ice_cube",), Placement(object="ice_bowl"), graspable=True, scale=0.8),
            ObjectSpec(
                "ice_cube2", ("ice_cube",), Placement(object="ice_bowl"), graspable=True, scale=0.8, repeats=True
            ),
            ObjectSpec(
                "cup",
                ("glass_cup",),
                Placement("counter", reuse_region_from="ice_bowl", size=(0.5, 0.25), pos=(0.0, -1.0)),
                scale=(1.25, 1.25, 1.0),
                filled="coffee",
            ),
        ),
        goal=AllOf(
            AnyOf(ObjectOn("ice_cube1", "cup", within=0.06), ObjectOn("ice_cube2", "cup", within=0.06)),
            GripperFar("ice_cube1", 0.15),
            GripperFar("ice_cube2", 0.15),
        ),
        stages=place("ice_cube1", "cup"),
        instruction="Put an ice cube from the bowl into the glass of coffee.",
        paraphrases=(
            "The coffee should be cold: add one ice cube.",
            "Drop one cube of ice into the glass.",
            "Bring an ice cube from the bowl to the coffee.",
            "Make an iced coffee with ice from the bowl.",
        ),
    ),
    Task(
        name="PackDessert",
        summary="Both foods are in the box, the gripper away.",
        fixtures=(FixtureSpec("counter", "counter"),),
        robot_start=RobotStart("counter", at_object="cooked_food_container"),
        objects=(
            ObjectSpec(
                "cooked_food_container",
                ("tupperware",),
                Placement("counter", size=(0.5, 0.5), pos=(0.0, -1.0), rotation=(0.0, 0.0)),
                scale=(1.5, 1.5, 1.25),
            ),
            ObjectSpec("cooked_food", ("cooked_food",), Placement(object="cooked_food_container"), graspable=True),
            ObjectSpec(
                "dessert",
                ("sweets",),
                Placement("counter", reuse_region_from="cooked_food_container", size=(0.5, 0.2), pos=(0.0, -1.0)),
                graspable=True,
                exclude=("sugar_cube",),
            ),
        ),
        goal=AllOf(
            ObjectOn("cooked_food", "cooked_food_container"),
            ObjectOn("dessert", "cooked_food_container"),
            GripperFar("dessert"),
        ),
        stages=place("dessert", "cooked_food_container"),
        instruction="Put the {dessert} into the tupperware with the {cooked_food}.",
        paraphrases=(
            "The {dessert} goes into the box next to the {cooked_food}.",
            "Pack the {dessert} with the meal.",
            "Add the {dessert} to the lunch box.",
            "Bring the {dessert} from the counter into the tupperware.",
        ),
    ),
)

TASKS = (*COUNTER,)
