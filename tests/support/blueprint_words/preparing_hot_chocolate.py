"""Preparing hot chocolate: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import ForEach, ObjectOn
from robocasa_lerobot.envs.scene.initial_states import BurnerAt
from robocasa_lerobot.envs.tasks.atomic.common import HANDLE_TO_FRONT

OURS = {
    "SweetenHotChocolate": Ours(
        goal={
            f"every sugar{{i}} in/on saucepan {ON_ITS_MIDDLE.format('saucepan')}": ForEach(
                "sugar", lambda name: ObjectOn(name, "saucepan")
            ),
            **away("saucepan"),
        },
        initial={
            "burner under saucepan on (knob 0.50 to max); burner chosen at random among non-rear burners": BurnerAt(
                "stove", "{burner}", "on"
            ),
            "saucepan filled with hot chocolate (visual liquid only)": "saucepan",
            "number of sugar cubes 1-3 at random": None,
        },
        turned={"saucepan": HANDLE_TO_FRONT},
    ),
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
