"""NavigateKitchen: drive from one fixture to another."""

from robocasa_lerobot.envs.predicates import StandsBefore
from robocasa_lerobot.envs.scene.wanted import FixtureWanted, RobotStart
from robocasa_lerobot.envs.task import Stage
from robocasa_lerobot.envs.tasks.atomic.common import UNMULTIPLIED, atomic

TASKS = (
    atomic(
        "NavigateKitchen",
        450,
        "The base stands within 20 cm of the place in front of the fixture, and faces it.",
        fixtures=(
            FixtureWanted("source", "landmark"),
            FixtureWanted("target", "landmark_once", other_than=("source",), apart_m=1.0),
        ),
        start=RobotStart("source"),
        goal=StandsBefore("target"),
        stages=(Stage("navigation", "drive", "target"),),
        sets=("pretrain50", *UNMULTIPLIED, "atomic_seen"),
    ),
)
