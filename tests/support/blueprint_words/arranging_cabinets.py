"""Arranging cabinets: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    DoorsClosed,
    GripperFar,
    NearerThan,
    ObjectInside,
    OnOneSide,
    RestsOn,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import in_cabinet

_MUGS = ("glass1", "glass2", "glass3")


def stacked(first: str, second: str) -> AnyOf:
    return AnyOf(RestsOn(first, second), RestsOn(second, first))


OURS = {
    "ResetCabinetDoors": Ours(
        goal={
            f"{name} door closed (<= 0.005 of range)": DoorsClosed(name, 0.005)
            for name in ("cabinet1", "cabinet2", "cabinet3")
        },
        initial={
            "cabinet1 doors open 0.30-1.0": InitialOpenness("cabinet1", 0.3, 1.0),
            "cabinet2 doors open 0.40-1.0": InitialOpenness("cabinet2", 0.4, 1.0),
            "cabinet3 doors open 0.25-0.90": InitialOpenness("cabinet3", 0.25, 0.9),
            "opening amounts random within ranges; cabinets drawn at random": None,
        },
    ),
    "StackCans": Ours(
        goal={
            "OR over the 3 ways to split the 4 cans into 2 pairs: both pairs stacked; pair stacked = world-x "
            "difference < 0.02 m (source compares x only; its height clause is always true; intent: one can resting "
            "on the other)": AnyOf(
                AllOf(stacked("can1", "can2"), stacked("can3", "can4")),
                AllOf(stacked("can1", "can3"), stacked("can2", "can4")),
                AllOf(stacked("can1", "can4"), stacked("can2", "can3")),
            ),
            **away("can1", "can2", "can3", "can4"),
        },
        initial={"cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
        called={"canA": "can1", "canC": "can3"},
    ),
    "GatherTableware": Ours(
        goal={
            "1.5 x (largest 3D distance among the 3 mugs) < largest 3D distance between bowl and any mug": NearerThan(
                _MUGS, _MUGS, "bowl", factor=1.5
            ),
            **{f"gripper > 0.25 m from {name}": GripperFar(name, 0.25) for name in _MUGS},
        },
        initial={
            "cabinet1 doors open (0.90-1.0 of range)": InitialOpenness("cabinet1", 0.9, 1.0),
            "cabinet2 doors open (0.90-1.0 of range)": InitialOpenness("cabinet2", 0.9, 1.0),
            "both cabinets drawn at random, must differ": None,
            "glass1, glass2 and bowl share cabinet1; glass3 in cabinet2": "glass3",
        },
        besides=frozenset(
            {OnOneSide(_MUGS, "bowl", "cabinet1"), *(ObjectInside(name, "cabinet1") for name in (*_MUGS, "bowl"))}
        ),
        placed={
            "glass1": in_cabinet("cabinet1", (0.3, 0.4), pos=("{end}", 0.0)),
            "glass2": in_cabinet("cabinet1", (0.3, 0.4), pos=("{end}", 0.0), reuse_region_from="glass1"),
            "bowl": in_cabinet("cabinet1", (0.25, 0.4), pos=("-{end}", 0.0), reuse_region_from="glass1"),
        },
    ),
}
