"""NavigateKitchen: drive from one fixture to another."""

from robocasa_lerobot.envs.predicates import StandsBefore
from robocasa_lerobot.envs.scene.spec import FixtureSpec, RobotStart
from robocasa_lerobot.envs.tasks.task import Stage, Task

TASKS = (
    Task(
        name="NavigateKitchen",
        summary="The base stands within 20 cm of the place in front of the fixture, and faces it.",
        fixtures=(
            FixtureSpec("source", "landmark"),
            FixtureSpec("target", "landmark_once", other_than=("source",), apart_m=1.0),
        ),
        robot_start=RobotStart("source"),
        goal=StandsBefore("target"),
        stages=(Stage("navigation", "drive", "target"),),
        instruction="Go to the {target}.",
        paraphrases=(
            "Drive to the {target} and stop in front of it.",
            "I need you at the {target}.",
            "Move your base until you face the {target}.",
            "The {target} is where you should stand.",
        ),
    ),
)
