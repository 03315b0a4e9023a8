"""Making juice: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperTouches,
    Higher,
    Not,
    ObjectInside,
    ObjectTilt,
    ObjectTouches,
    StepsWhile,
    UnderWater,
)
from robocasa_lerobot.envs.scene.initial_states import Water

FILLED = StepsWhile(UnderWater("blender_jug", "sink"), 25, label="blender_jug_filled")
# Our halves lie face down as they are, so that their axis points up.
PRESSED = StepsWhile(
    AllOf(
        ObjectTouches("fruit", "reamer"),
        ObjectTilt("fruit", high=float(np.deg2rad(20.0)), label="face_down"),
        GripperTouches("fruit"),
        Higher("fruit", "reamer"),
    ),
    11,
    label="fruit_pressed",
)

OURS = {
    "ChooseRipeFruit": Ours(
        goal={
            "fruit1 inside blender (all 8 bbox corners in interior region, tol 0.01)": ObjectInside(
                "fruit1", "blender"
            ),
            **away("fruit1"),
            "NOT fruit0 inside blender (bbox, tol 0.01)": Not(ObjectInside("fruit0", "blender")),
        },
        initial={
            "blender lid on": None,
            "blender off": None,
            "fruit0 recoloured brown (rgb 0.40 0.26 0.14) = rotten; fruit1 normal; both the same fruit model": "fruit0",
        },
    ),
    "JuiceFruitReamer": Ours(
        goal={
            "pressed > 10 steps in total, a step counts when: fruit touches reamer AND fruit roll (xyz Euler, signed) "
            "in (160, 180] deg AND gripper touches fruit AND fruit centre z > reamer centre z + half reamer "
            "height": PRESSED,
        },
        initial={},
        order=PRESSED,
    ),
    "FillBlenderJug": Ours(
        goal={
            "blender_jug under running water for >= 25 steps in total (water on AND jug centre xy within jug radius of "
            "stream AND jug centre below top of stream)": FILLED,
        },
        initial={"faucet off": Water("sink", on=False)},
        order=FILLED,
    ),
}
