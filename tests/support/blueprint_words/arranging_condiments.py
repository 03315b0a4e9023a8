"""Arranging condiments: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away
from robocasa_lerobot.envs.predicates import Beside, GripperFar, Near, NearFixture, ObjectInside, ObjectTouches
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_A_ROW = Beside("condiment2", "condiment1", "counter", across=0.2, along=0.05)

OURS = {
    "CategorizeCondiments": Ours(
        goal={
            "obj1 inside cabinet (bbox, margin 0.05 m)": ObjectInside("obj1", "cabinet", margin=0.05),
            "obj2 inside cabinet (bbox, margin 0.05 m)": ObjectInside("obj2", "cabinet", margin=0.05),
            "obj1 within 0.15 m (xy) of cab_obj1": Near("obj1", "cab_obj1", 0.15),
            "obj2 within 0.15 m (xy) of cab_obj2": Near("obj2", "cab_obj2", 0.15),
            "gripper > 0.25 m from obj1": GripperFar("obj1", 0.25),
            "gripper > 0.25 m from obj2": GripperFar("obj2", 0.25),
        },
        initial={"cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "OrganizeCondiments": Ours(
        goal={
            **{
                f"condiment{i} inside cabinet (bbox, margin 0.05 m)": ObjectInside(
                    f"condiment{i}", "cabinet", margin=0.05
                )
                for i in (1, 2, 3)
            },
            "distractor touching counter": ObjectTouches("distractor", "counter"),
            **away("condiment1", "condiment2", "condiment3", "distractor"),
        },
        initial={"cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
    ),
    "LineUpCondiments": Ours(
        goal={
            "condiment1 touching any counter": ObjectTouches("condiment1", "counter"),
            "condiment2 touching any counter": ObjectTouches("condiment2", "counter"),
            "condiment1 bbox within 0.35 m of stove": NearFixture("condiment1", "stove", 0.35),
            "condiment2 bbox within 0.35 m of stove": NearFixture("condiment2", "stove", 0.35),
            "world |dx| between condiments <= 0.20 m": IN_A_ROW,
            "world |dy| between condiments <= 0.05 m": IN_A_ROW,
            "gripper > 0.25 m from condiment1": GripperFar("condiment1", 0.25),
            "gripper > 0.25 m from condiment2": GripperFar("condiment2", 0.25),
        },
        initial={
            "cabinet door(s) open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0),
        },
    ),
}
