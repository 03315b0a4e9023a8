"""Chopping food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, ForEach, GripperFar, Not, ObjectOn, ObjectTouches, OnShelf
from robocasa_lerobot.envs.scene.initial_states import Water
from robocasa_lerobot.envs.scene.spec import InitialOpenness

BOARD = "non_vegetable_container"
NEAR = "(contact; xy dist < 0.7 x {} radius)"


def each_on_its_own(first: str, second: str) -> AllOf:
    return AllOf(ObjectOn(first, "cutting_board1"), ObjectOn(second, "cutting_board2"))


OURS = {
    "ArrangeVegetables": Ours(
        goal={
            **{
                f"{name} on cutting_board {NEAR.format('cutting_board')}": ObjectOn(name, "cutting_board")
                for name in ("vegetable1", "vegetable2")
            },
            **away("cutting_board"),
        },
        initial={"faucet off": Water("sink", on=False)},
        turned={"cutting_board": (np.pi / 2, np.pi / 2)},
    ),
    "BreadSetupSlicing": Ours(
        goal={
            f"every obj_i on receptacle {NEAR.format('receptacle')}": ForEach(
                "obj", lambda name: ObjectOn(name, "receptacle")
            ),
            "gripper > 0.25 m from obj_0": GripperFar("obj_0"),
        },
        initial={"number of breads random 1-3": "obj"},
        called={"obj_0": "obj_i"},
    ),
    "ClearCuttingBoard": Ours(
        goal={
            **{
                f"{name} on {BOARD} {NEAR.format(BOARD)}": ObjectOn(name, BOARD)
                for name in ("vegetable1", "vegetable2")
            },
            f"NOT (non_vegetable on {BOARD}: contact and xy dist < 0.7 x radius)": Not(
                ObjectOn("non_vegetable", BOARD)
            ),
            **away(BOARD),
        },
        initial={"non_vegetable lies on the cutting board": "non_vegetable"},
    ),
    "OrganizeVegetables": Ours(
        goal={
            "OR(vegetable1 on cutting_board1 AND vegetable2 on cutting_board2; vegetable2 on cutting_board1 AND "
            "vegetable1 on cutting_board2) (contact; xy dist < 0.7 x board radius)": AnyOf(
                each_on_its_own("vegetable1", "vegetable2"), each_on_its_own("vegetable2", "vegetable1")
            ),
        },
        initial={},
    ),
    "ArrangeCuttingFruits": Ours(
        goal={
            "fruit1 on cutting_board (contact; xy dist < 0.7 x cutting_board radius)": ObjectOn(
                "fruit1", "cutting_board"
            ),
            "fruit2 on cutting_board (contact; xy dist < 0.7 x cutting_board radius)": ObjectOn(
                "fruit2", "cutting_board"
            ),
            "non_fruit1 on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "non_fruit1", "fridge"
            ),
            "non_fruit2 on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "non_fruit2", "fridge"
            ),
            "gripper > 0.25 m from fruit1": GripperFar("fruit1", 0.25),
            "gripper > 0.25 m from fruit2": GripperFar("fruit2", 0.25),
            "gripper > 0.25 m from non_fruit1": GripperFar("non_fruit1", 0.25),
            "gripper > 0.25 m from non_fruit2": GripperFar("non_fruit2", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
        },
        turned={"cutting_board": (np.pi / 2, np.pi / 2)},
    ),
    "MeatTransfer": Ours(
        goal={
            "container touching counter": ObjectTouches("container", "counter"),
            "gripper > 0.25 m from meat": GripperFar("meat", 0.25),
            "meat in container (contact; xy dist < 0.7 x container radius)": ObjectOn("meat", "container"),
        },
        initial={
            "cabinet doors closed": None,
        },
        turned={"container": (-0.2, 0.2)},
    ),
}
