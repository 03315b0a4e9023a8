"""Collecting what is recycled: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import (
    AllOf,
    GripperFar,
    Near,
    NearFixture,
    ObjectInBasin,
    ObjectTouches,
)

CANS = ("can1", "can2", "can3", "can4")
IN_SINK = "(all bbox corners in an interior region, tolerance 0.05)"

OURS = {
    "RecycleBottlesBySize": Ours(
        goal={
            **{
                f"{name} inside sink {IN_SINK}": ObjectInBasin(name, "sink")
                for name in ("bottle_small1", "bottle_small_sample")
            },
            "bottle_large1 and bottle_large_sample each <= 0.25 m (axis-aligned bbox gap) from sink": AllOf(
                NearFixture("bottle_large1", "sink", 0.25), NearFixture("bottle_large_sample", "sink", 0.25)
            ),
            "bottle_large1 in contact with counter": ObjectTouches("bottle_large1", "counter"),
            "bottle_large_sample in contact with counter": ObjectTouches("bottle_large_sample", "counter"),
            "bottle_large1 within 0.40 m (3D centres) of bottle_large_sample": Near(
                "bottle_large1", "bottle_large_sample", 0.4, in_space=True
            ),
            **away("bottle_large1", "bottle_small1", "bottle_large_sample", "bottle_small_sample"),
        },
        initial={"robot base in front of bottle_large1": "bottle_large1"},
        # The gripper opens by 8 cm.
        scales={"bottle_large1": (1.2, 1.2, 1.2), "bottle_large_sample": (1.2, 1.2, 1.2)},
    ),
    "RecycleSodaCans": Ours(
        goal={
            "every can <= 0.25 m (axis-aligned bbox gap) from stove": AllOf(
                *(NearFixture(name, "stove", 0.25) for name in CANS)
            ),
            "every can within 0.25 m (xy centres) of at least one other can": AllOf(
                *(Near(name, tuple(other for other in CANS if other != name), 0.25) for name in CANS)
            ),
            "every can in contact with a counter (any)": AllOf(
                *(ObjectTouches(name, "counter_stove") for name in CANS)
            ),
            "gripper > 0.15 m from every can": AllOf(*(GripperFar(name, 0.15) for name in CANS)),
        },
        initial={"start counter chosen at random among counter_cab, dining_counter, counter_microwave": None},
    ),
}
