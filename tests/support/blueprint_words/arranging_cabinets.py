"""Arranging cabinets: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import GripperFar, NearerThan, ObjectInside, OnOneSide
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.atomic.common import in_cabinet

_MUGS = ("glass1", "glass2", "glass3")

OURS = {
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
