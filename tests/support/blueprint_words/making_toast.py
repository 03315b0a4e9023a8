"""Making toast: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_BOARD = "on cutting_board (contact; xy dist < 0.7 x cutting_board radius)"

OURS = {
    "BreadSelection": Ours(
        goal={
            f"croissant {ON_BOARD}": ObjectOn("croissant", "cutting_board"),
            "gripper > 0.25 m from croissant": GripperFar("croissant", 0.25),
            f"jam {ON_BOARD}": ObjectOn("jam", "cutting_board"),
        },
        initial={"cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
}
