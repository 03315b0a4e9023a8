"""Making toast: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

ON_BOARD = "on cutting_board (contact; xy dist < 0.7 x cutting_board radius)"

OPEN = {"cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)}

OURS = {
    "BreadSelection": Ours(
        goal={
            f"croissant {ON_BOARD}": ObjectOn("croissant", "cutting_board"),
            "gripper > 0.25 m from croissant": GripperFar("croissant", 0.25),
            f"jam {ON_BOARD}": ObjectOn("jam", "cutting_board"),
        },
        initial=OPEN,
    ),
    "PrepareToast": Ours(
        goal={
            "obj2 touching counter": ObjectTouches("obj2", "counter"),
            **away("obj"),
            "obj on container (contact; xy dist < 0.7 x container radius)": ObjectOn("obj", "container"),
            "container touching counter": ObjectTouches("container", "counter"),
            "cabinet door(s) closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
        },
        initial=OPEN,
    ),
    "SweetSavoryToastSetup": Ours(
        goal={
            **away("plate"),
            "bread on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("bread", "plate"),
            "avocado on plate (contact; xy dist < 0.7 x plate radius)": ObjectOn("avocado", "plate"),
            "jam touching counter": ObjectTouches("jam", "counter"),
            "jam within 0.25 m (3d) of plate": Near("jam", "plate", 0.25, in_space=True),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet", 0.005),
        },
        initial=OPEN,
    ),
}
