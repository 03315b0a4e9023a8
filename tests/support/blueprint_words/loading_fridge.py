"""Loading the fridge: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours, away, together
from robocasa_lerobot.envs.predicates import AllOf, DoorsClosed, GripperFar, Not, OnShelf, When
from robocasa_lerobot.envs.scene.spec import InitialOpenness

IN_BOWLS = {"vegetable1": "veg_bowl", "vegetable2": "veg_bowl", "meat1": "meat_bowl", "meat2": "meat_bowl"}
OTHERS = {"vegetable1": "vegetable2", "vegetable2": "vegetable1", "meat1": "meat2", "meat2": "meat1"}
ON_A_SHELF = "(bbox inside region, margin 0.05 m; height <= 90% of region)"

OPEN = InitialOpenness("fridge", 0.9, 1.0, part="fridge")
BOTH = InitialOpenness("fridge", 0.9, 1.0)

OURS = {
    "LoadFridgeByType": Ours(
        goal={
            **{
                f"{name} in {bowl} (contact; xy dist < 0.7 x {bowl} radius)": together(name, OTHERS[name], bowl)
                for name, bowl in IN_BOWLS.items()
            },
            f"veg_bowl on fridge {{veg_shelf}} {ON_A_SHELF}": OnShelf("veg_bowl", "fridge", "{veg_shelf}"),
            f"meat_bowl on fridge {{meat_shelf}} {ON_A_SHELF}": OnShelf("meat_bowl", "fridge", "{_meat_shelf}"),
            **away("veg_bowl", "meat_bowl"),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge"),
            "random which of top / second highest shelf is for meat, the other for vegetables": None,
        },
    ),
    "CreateChildFriendlyFridge": Ours(
        goal={
            "item1 on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "item1", "fridge"
            ),
            "item1 NOT on top shelf": Not(OnShelf("item1", "fridge", "highest")),
            "item2 on fridge top shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "item2", "fridge", "highest"
            ),
            "OR(type alcohol AND item3 on top shelf; type fruit_vegetable AND item3 on a shelf AND item3 "
            "NOT on top shelf)": When(
                "third",
                {
                    "alcohol": OnShelf("item3", "fridge", "highest"),
                    "fruit_vegetable": AllOf(OnShelf("item3", "fridge"), Not(OnShelf("item3", "fridge", "highest"))),
                },
            ),
            "gripper > 0.25 m from item1": GripperFar("item1", 0.25),
            "gripper > 0.25 m from item2": GripperFar("item2", 0.25),
            "gripper > 0.25 m from item3": GripperFar("item3", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": OPEN,
            "third item type random: alcohol or fruit_vegetable": None,
        },
    ),
    "LoadCondimentsInFridge": Ours(
        goal={
            "condiment1 on fridge top shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "condiment1", "fridge", "highest"
            ),
            "condiment2 on fridge top shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "condiment2", "fridge", "highest"
            ),
            "distractor1 NOT on top shelf": Not(OnShelf("distractor1", "fridge", "highest")),
            "distractor2 NOT on top shelf": Not(OnShelf("distractor2", "fridge", "highest")),
            "distractor1 on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "distractor1", "fridge"
            ),
            "distractor2 on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "distractor2", "fridge"
            ),
            "gripper > 0.25 m from condiment1": GripperFar("condiment1", 0.25),
            "gripper > 0.25 m from condiment2": GripperFar("condiment2", 0.25),
            "gripper > 0.25 m from distractor1": GripperFar("distractor1", 0.25),
            "gripper > 0.25 m from distractor2": GripperFar("distractor2", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": OPEN,
        },
    ),
    "MoveFreezerToFridge": Ours(
        goal={
            "frozen_meat on fridge any shelf (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "frozen_meat", "fridge"
            ),
            "freezer door closed (<= 0.005 of range)": DoorsClosed("fridge", 0.005, part="freezer"),
            "fridge door(s) closed (<= 0.005 of range)": DoorsClosed("fridge", 0.005, part="fridge"),
            "freezer_distractor on a freezer shelf": OnShelf("freezer_distractor", "fridge", compartment="freezer"),
            "fridge_distractor on a fridge shelf": OnShelf("fridge_distractor", "fridge"),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": BOTH,
            "freezer door open (0.90-1.0 of range)": BOTH,
        },
    ),
    "RearrangeFridgeItems": Ours(
        goal={
            "pitcher on fridge {source_shelf} (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "pitcher", "fridge", "{source}"
            ),
            "item1_source on fridge {dest_shelf} (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "item1_source", "fridge", "{_other}"
            ),
            "item2_source on fridge {dest_shelf} (bbox inside region, margin 0.05 m; height <= 90% of region)": OnShelf(
                "item2_source", "fridge", "{_other}"
            ),
            "gripper > 0.25 m from pitcher": GripperFar("pitcher", 0.25),
            "gripper > 0.25 m from item1_source": GripperFar("item1_source", 0.25),
            "gripper > 0.25 m from item2_source": GripperFar("item2_source", 0.25),
        },
        initial={
            "fridge door(s) open (0.90-1.0 of range)": OPEN,
            "source shelf random: top or second highest; destination is the other one": None,
        },
        scales={"pitcher": (0.85, 0.85, 0.85)},
    ),
}
