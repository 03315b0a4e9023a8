"""Chopping vegetables: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, Not, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.typical import stages_of

TOOL = stages_of(get_task("CuttingToolSelection"))[0].object  # in one scene
OTHER = {"knife": "peeler", "peeler": "knife"}[TOOL]

OURS = {
    "CuttingToolSelection": Ours(
        goal={
            "gripper > 0.25 m from food_container": GripperFar("food_container", 0.25),
            "correct tool on food_container (contact AND centre xy distance < 0.7 x board radius)": ObjectOn(
                TOOL, "food_container"
            ),
            "NOT wrong tool on food_container": Not(ObjectOn(OTHER, "food_container")),
        },
        initial={
            "drawer open (0.90-1.0)": InitialOpenness("drawer", 0.9, 1.0),
            "drawer_top chosen at random; robot base stands to its left or right (half width + 0.2 m), whichever is "
            "free": None,
            "food drawn at random; tool map: knife for garlic, broccoli, avocado; peeler for eggplant, carrot, "
            "cucumber, potato": "food",
        },
        called={"correct": TOOL},
    ),
    "GatherCuttingTools": Ours(
        goal={
            "gripper > 0.25 m from cutting_board": GripperFar("cutting_board", 0.25),
            "peeler on cutting_board (contact AND centre xy distance < 0.7 x cutting_board radius)": ObjectOn(
                "peeler", "cutting_board"
            ),
            "knife on cutting_board (contact AND centre xy distance < 0.7 x cutting_board radius)": ObjectOn(
                "knife", "cutting_board"
            ),
        },
        initial={
            "drawer closed": None,
            "drawer_top chosen at random; robot base stands to its left or right (half width + 0.2 m), "
            "whichever is free": None,
        },
    ),
}
