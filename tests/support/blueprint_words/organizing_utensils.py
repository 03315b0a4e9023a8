"""Organizing utensils: our words for its blueprints."""

from __future__ import annotations

import math

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import AllOf, Beside, Not, ObjectInside, ObjectTouches, ObjectTouchesAnyCounter
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_ITS_PLACE = {
    "wooden_spoon": "cabinet",
    "wooden_spoon_2": "cabinet",
    "metallic_utensil": "drawer",
    "metallic_utensil_2": "drawer",
}
INSIDE = "(all 8 bbox corners in interior region, slack 0.05)"

LENGTHWISE = (math.pi / 2, math.pi / 2)
CUTLERY = ("drawer_fork", "drawer_spoon", "counter_fork", "counter_spoon")


AT_ITS_SIDE = Beside("counter_fork", "counter_spoon", "drawer", across=math.inf, along=math.inf, side="{fork_side}")


def by_twin(name: str) -> Beside:
    twin = name.replace("counter", "drawer")
    return Beside(name, twin, "drawer", across=0.1, along=math.inf)


OURS = {
    "ClusterUtensilsInDrawer": Ours(
        goal={
            "each of drawer_fork, drawer_spoon, counter_fork, counter_spoon inside drawer (all 8 bbox corners in "
            "interior region, slack 0.05)": AllOf(*(ObjectInside(name, "drawer", margin=0.05) for name in CUTLERY)),
            "NOT any of the 4 touching any counter": AllOf(*(Not(ObjectTouchesAnyCounter(name)) for name in CUTLERY)),
            "forks: |dx| < 0.1 m in drawer frame": by_twin("counter_fork"),
            "spoons: |dx| < 0.1 m in drawer frame": by_twin("counter_spoon"),
            **away("counter_fork", "counter_spoon"),
        },
        initial={
            # Of the slide's range, of which full travel is 0.55.
            "drawer open (0.27-0.30 of range (partial open))": InitialOpenness("drawer", 0.49, 0.55),
            "fork side left or right at random; spoon side is the opposite": "drawer_fork",
        },
        order=AT_ITS_SIDE,
        besides=frozenset({AT_ITS_SIDE}),
        turned=dict.fromkeys(CUTLERY, LENGTHWISE),
    ),
    "ArrangeUtensilsByType": Ours(
        goal={
            sentence: goal
            for name, fixture in IN_ITS_PLACE.items()
            for sentence, goal in (
                (f"{name} inside {fixture} {INSIDE}", ObjectInside(name, fixture, margin=0.05)),
                (f"NOT {name} touching counter", Not(ObjectTouches(name, "counter"))),
            )
        }
        | dict(away(*IN_ITS_PLACE)),
        initial={
            "cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
            # Of the slide's range, of which full travel is 0.55.
            "drawer open (0.27-0.30 of range (partial open))": InitialOpenness("drawer", 0.49, 0.55),
        },
    ),
}
