"""Chopping food: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, ForEach, GripperFar, Not, ObjectOn
from robocasa_lerobot.envs.scene.initial_states import Water

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
            "gripper > 0.25 m from obj_0": ForEach("obj", GripperFar),
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
}
