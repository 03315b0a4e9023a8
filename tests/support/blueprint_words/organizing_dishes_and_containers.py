"""Organizing dishes and containers: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import DoorsClosed, GripperFar, HandlePoints, ObjectInside, ObjectOn
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task

IN_A_REGION = "(all bbox corners within one interior region, tol 0.05)"

OURS = {
    "EmptyDishRack": Ours(
        goal={
            f"mug inside cabinet {IN_A_REGION}": ObjectInside("mug", "cabinet", margin=0.05),
            "cabinet doors closed (<= 0.005 of range)": DoorsClosed("cabinet"),
            **away("mug"),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
        placed={"mug": get_task("EmptyDishRack").objects[-1].start},  # beside the rods
    ),
    "StackBowlsCabinet": Ours(
        goal={
            f"bowl1 inside cabinet {IN_A_REGION}": ObjectInside("bowl1", "cabinet", margin=0.05),
            f"bowl2 inside cabinet {IN_A_REGION}": ObjectInside("bowl2", "cabinet", margin=0.05),
            # Ours: the small one in the large one, as the instruction says.
            "OR(bowl2 in bowl1 (contact; centre xy < 0.7*bowl1 radius), bowl1 in bowl2 (contact; centre xy < "
            "0.7*bowl2 radius))": ObjectOn("bowl1", "bowl2"),
            "gripper > 0.25 m from bowl1": GripperFar("bowl1", 0.25),
            "gripper > 0.25 m from bowl2": GripperFar("bowl2", 0.25),
        },
        initial={"cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "OrganizeMugsByHandle": Ours(
        goal={
            f"mug_counter1 inside cabinet {IN_A_REGION}": ObjectInside("mug_counter1", "cabinet", margin=0.05),
            # Ours: by where the handle points, 40 degrees to either side of the right.
            "mug_counter1 yaw in cabinet frame in [50, 130] deg": HandlePoints(
                "mug_counter1", "cabinet", "right", float(np.deg2rad(40.0))
            ),
            "gripper > 0.25 m from mug_counter1": GripperFar("mug_counter1", 0.25),
        },
        initial={
            "cabinet doors open": InitialOpenness("cabinet", 0.9, 1.0),
            "mugs in cabinet have yaw 90 deg (handle right)": "mug1",
        },
        turned={"mug1": (0.0, 0.0), "mug2": (0.0, 0.0)},
    ),
}
