"""Sanitizing cutting boards: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, Strokes

RUBBED = Strokes("sponge", "cutting_board", n_places=5, apart_m=0.02, span_m=0.1)

OURS = {
    "ScrubCuttingBoard": Ours(
        goal={
            "recorded scrub points >= 5": RUBBED,
            "diagonal of xy bounding box of recorded points >= 0.1 m": RUBBED,
            "gripper > 0.15 m from sponge": GripperFar("sponge", 0.15),
        },
        initial={"robot base in front of sponge": "sponge"},
        order=RUBBED,
        turned={"cutting_board": (0.0, 0.0)},
    ),
}
