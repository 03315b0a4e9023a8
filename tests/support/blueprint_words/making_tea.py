"""Making tea: our words for its blueprints."""

from __future__ import annotations

import numpy as np

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import ObjectOn, ObjectTilt, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

MIDDLE = "(contact AND xy centre distance < 0.7 x {} horizontal radius)"

OURS = {
    "ArrangeTeaAccompaniments": Ours(
        goal={
            f"milk on tray {MIDDLE.format('tray')}": ObjectOn("milk", "tray"),
            f"sugar_cube on tray {MIDDLE.format('tray')}": ObjectOn("sugar_cube", "tray"),
            **away("tray"),
        },
        initial={"fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
    ),
    "ServeTea": Ours(
        goal={
            f"teacup on saucer {MIDDLE.format('saucer')}": ObjectOn("teacup", "saucer"),
            "saucer touching dining_table (contact)": ObjectTouches("saucer", "dining_table"),
            **away("teacup"),
        },
        initial={
            "microwave door open (0.90-1.0 of range)": InitialOpenness("microwave", 0.9, 1.0),
            "teacup shows tea (visual liquid, brown)": "teacup",
        },
    ),
    "StrainerSetup": Ours(
        goal={
            f"strainer in bowl {MIDDLE.format('bowl')}": ObjectOn("strainer", "bowl"),
            # As a whole, which is less than about each of two axes.
            "strainer upright (|roll| < 30 deg AND |pitch| < 30 deg)": ObjectTilt(
                "strainer", high=float(np.deg2rad(30.0)), label="level"
            ),
            **away("strainer"),
        },
        initial={"cabinet doors closed (default)": None},
        turned={"strainer": (0.0, 0.0)},
    ),
}
