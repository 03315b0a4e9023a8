"""Sanitizing surfaces: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away, together
from robocasa_lerobot.envs.predicates import (
    NearFixture,
    Not,
    ObjectInside,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    OnShelf,
    Strokes,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_A_REGION = "(all 8 bbox corners in interior region, slack 0.05)"
OPEN = {"cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)}
IN_MICROWAVE = ObjectInside("obj", "microwave", margin=0.05)


def wiped(strokes: Strokes, what: str, where: str) -> Ours:
    return Ours(
        goal={
            f"count of distinct {what} points on {where} >= 5": strokes,
            f"diagonal of the xy bounding box of all {what} points >= 0.1 m": strokes,
            **away("sponge", metres=0.15),
        },
        initial={},
        order=strokes,
    )


OURS = {
    "SanitizeSink": wiped(Strokes("sponge", "sink", n_places=5, apart_m=0.025, span_m=0.1), "scrub", "the sink"),
    "WipeTable": wiped(Strokes("sponge", "", n_places=5, apart_m=0.02, span_m=0.1), "wipe", "any counter"),
    "ArrangeSinkSanitization": Ours(
        goal={
            "sponge touching any counter": ObjectTouchesAnyCounter("sponge"),
            "dishbrush touching any counter": ObjectTouchesAnyCounter("dishbrush"),
            "sponge bbox within 0.25 m of sink bbox": NearFixture("sponge", "sink", 0.25),
            "dishbrush bbox within 0.25 m of sink bbox": NearFixture("dishbrush", "sink", 0.25),
            **away("sponge", "dishbrush"),
        },
        initial=OPEN,
        kinds={"counter": "counter"},
        near={"counter": "sink"},
    ),
    "CleanMicrowave": Ours(
        goal={
            f"obj inside microwave {IN_A_REGION}": IN_MICROWAVE,
            **away("obj", metres=0.1),
        },
        initial={"microwave door closed": None},
        order=IN_MICROWAVE,  # the door may stay open
    ),
    "CountertopCleanup": Ours(
        goal={
            f"utensil inside drawer {IN_A_REGION}": ObjectInside("utensil", "drawer", margin=0.05),
            "NOT utensil touching any counter": Not(ObjectTouchesAnyCounter("utensil")),
            f"receptacle inside cabinet {IN_A_REGION}": ObjectInside("receptacle", "cabinet", margin=0.05),
            **{
                f"{name} in food_bowl {ON_ITS_MIDDLE.format('food_bowl')}": together(name, other, "food_bowl")
                for name, other in (("food1", "food2"), ("food2", "food1"))
            },
            "food_bowl inside a fridge-compartment shelf (8 bbox corners in region, slack 0.05; centre height within "
            "lower 90 % of shelf height)": OnShelf("food_bowl", "fridge"),
            **away("utensil", "receptacle", "food_bowl"),
        },
        initial={
            **OPEN,
            "fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "drawer open (0.27-0.30 of range (partial open))": InitialOpenness("drawer", 0.49, 0.55),
        },
    ),
    "PrepForSanitizing": Ours(
        goal={
            "obj1 touching counter (contact)": ObjectTouches("obj1", "counter"),
            "obj2 touching counter (contact)": ObjectTouches("obj2", "counter"),
            **away("obj1", "obj2"),
        },
        initial={"cabinet doors closed": None},
    ),
}
