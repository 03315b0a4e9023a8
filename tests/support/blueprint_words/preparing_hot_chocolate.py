"""Preparing hot chocolate: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn

OURS = {
    "AddMarshmallow": Ours(
        goal={
            f"marshmallow in/on mug {ON_ITS_MIDDLE.format('mug')}": ObjectOn("marshmallow", "mug"),
            **away("mug"),
        },
        initial={
            "mug filled with hot chocolate (visual liquid only)": "mug",
            "robot base in front of marshmallow plate": "marshmallow",
        },
    ),
}
