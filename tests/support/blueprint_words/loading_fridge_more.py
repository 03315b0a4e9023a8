"""Loading the fridge more: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Behind, DoorsClosed, ObjectOn, ObjectTouches, OnShelf
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task

ON_A_SHELF = "(bbox inside region, margin 0.05 m; height <= 90% of region)"
INITIAL = {"fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")}
SHUT = {"fridge door(s) closed (<= 0.005 of range)": DoorsClosed("fridge", part="fridge")}
COOKED = ("meat_in_tupperware", "veg_in_tupperware")
BEFORE = [wanted for wanted in get_task("LoadPreparedFood").objects if "item" in wanted.name]

OURS = {
    "LoadFridgeFifo": Ours(
        goal={
            f"meat_old on fridge {{shelf}} {ON_A_SHELF}": OnShelf("meat_old", "fridge", "{shelf}"),
            f"meat_new on fridge {{shelf}} {ON_A_SHELF}": OnShelf("meat_new", "fridge", "{shelf}"),
            "meat_new > 0.10 m deeper than meat_old (fridge frame, towards back)": Behind(
                "meat_new", "meat_old", "fridge", by=0.10
            ),
            **SHUT,
        },
        initial={
            **INITIAL,
            "shelf random: top or second highest": None,
            "meat category random, same for both": "meat_new",
        },
    ),
    "LoadPreparedFood": Ours(
        goal={
            f"tupperware on fridge {{shelf}} {ON_A_SHELF}": OnShelf("tupperware", "fridge", "{shelf}"),
            "OR(meat and veg both in tupperware; one in tupperware AND meat touching veg) (in = contact and xy dist < "
            "0.7 x radius)": AnyOf(
                AllOf(*(ObjectOn(name, "tupperware") for name in COOKED)),
                AllOf(AnyOf(*(ObjectOn(name, "tupperware") for name in COOKED)), ObjectTouches(*COOKED)),
            ),
            "all 5 existing items on any fridge shelf (bbox inside, margin 0.05 m)": AllOf(
                *(OnShelf(wanted.name, "fridge") for wanted in BEFORE)
            ),
            **SHUT,
        },
        initial={**INITIAL, "target shelf random: top or second highest": None},
        placed={wanted.name: wanted.start for wanted in BEFORE},  # a place for the box is kept free
    ),
}
