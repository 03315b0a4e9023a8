"""Preparing meat: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import Near, ObjectOn, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

OURS = {
    "PrepForTenderizing": Ours(
        goal={
            **{
                f"{name} in/on meat_container {ON_ITS_MIDDLE.format('meat_container')}": ObjectOn(
                    name, "meat_container"
                )
                for name in ("rolling_pin", "meat")
            },
            **away("meat_container"),
        },
        initial={"cab doors closed": None},
    ),
    "PrepMarinatingMeat": Ours(
        goal={
            "meat in/on cutting_board (contact AND xy centre distance < 0.7 x cutting_board horizontal "
            "radius)": ObjectOn("meat", "cutting_board"),
            "cutting_board in contact with counter": ObjectTouches("cutting_board", "counter"),
            "condiment in contact with counter (no distance to cutting_board checked)": ObjectTouches(
                "condiment", "counter"
            ),
            **away("condiment", "meat"),
        },
        initial={"cab doors open (0.90-1.0 of range)": InitialOpenness("cab", 0.9, 1.0)},
        besides=frozenset({Near("condiment", "cutting_board", 0.3)}),  # the instruction says beside the board
    ),
}
