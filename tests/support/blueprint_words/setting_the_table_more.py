"""Setting the table more: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import Ours
from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    BeforeStools,
    Beside,
    GripperFar,
    Near,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
)
from robocasa_lerobot.envs.scene.spec import InitialOpenness
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.typical import stages_of

DRINKS = tuple(stage.object for stage in stages_of(get_task("BeverageOrganization")) if stage.verb == "place")


def at_plate(glass: str, plate: str) -> Beside:
    return Beside(glass, plate, "stool1", across=0.25, along=0.1)


EACH_ITS_OWN = AnyOf(
    AllOf(at_plate("wine_glass1", "plate1"), at_plate("wine_glass2", "plate2")),
    AllOf(at_plate("wine_glass1", "plate2"), at_plate("wine_glass2", "plate1")),
)

EACH_ITS_STOOL = BeforeStools(("bowl1", "bowl2"), across=0.15, along=0.3)
WARM_IN_BOWL, OLD_IN_BOWL = ObjectOn("toaster_oven_bread", "bowl"), ObjectOn("bowl_bread", "bowl")

OURS = {
    "ArrangeBreadBowl": Ours(
        goal={
            "at least one bread in bowl (contact AND xy centre distance < 0.7 x bowl horizontal radius)": AnyOf(
                WARM_IN_BOWL, OLD_IN_BOWL
            ),
            "the other bread likewise in bowl OR touching the bread that is": AnyOf(
                AllOf(WARM_IN_BOWL, OLD_IN_BOWL), ObjectTouches("toaster_oven_bread", "bowl_bread")
            ),
            "bowl touching dining_counter (contact)": ObjectTouches("bowl", "dining_counter"),
            "gripper > 0.25 m from bowl": GripperFar("bowl", 0.25),
        },
        initial={
            "toaster_oven door open (1.0)": InitialOpenness("toaster_oven", 1.0, 1.0),
            "rack level: top if two levels, else the only one": "toaster_oven_bread",
        },
        scales={"bowl": (1.25, 1.25, 1.25)},  # room for fingers beside the bread
    ),
    "ArrangeDrinkware": Ours(
        goal={
            "pitcher touching dining_counter (contact)": ObjectTouches("pitcher", "dining_counter"),
            "cup touching dining_counter (contact)": ObjectTouches("cup", "dining_counter"),
            "gripper > 0.25 m from pitcher": GripperFar("pitcher", 0.25),
            "gripper > 0.25 m from cup": GripperFar("cup", 0.25),
        },
        initial={},
    ),
    "BeverageOrganization": Ours(
        goal={
            "every obj_i touching dining_table (contact)": AllOf(
                *(ObjectTouches(name, "dining_table") for name in DRINKS)
            ),
            "gripper > 0.25 m from obj_0": GripperFar("obj_0", 0.25),
        },
        initial={
            "number of drinks 2, 3 or 4 at random": None,
        },
        kinds={"counter": "counter"},
    ),
    "SetupButterPlate": Ours(
        goal={
            "butter on plate (contact AND xy centre distance < 0.7 x plate horizontal radius)": ObjectOn(
                "butter", "plate"
            ),
            "butter_knife within 0.3 m (xy) of plate": Near("butter_knife", "plate", 0.3),
            "butter_knife touching any counter": ObjectTouchesAnyCounter("butter_knife"),
            "gripper > 0.25 m from butter": GripperFar("butter", 0.25),
            "gripper > 0.25 m from butter_knife": GripperFar("butter_knife", 0.25),
        },
        initial={
            "fridge doors closed (default)": None,
        },
    ),
    "SetupWineGlasses": Ours(
        goal={
            "wine_glass1 and wine_glass2 matched to two different plates: in stool1's frame |dx| < 0.25 m "
            "AND |dy| < 0.10 m": EACH_ITS_OWN,
            "wine_glass1 touching dining_counter (contact)": ObjectTouches("wine_glass1", "dining_counter"),
            "wine_glass2 touching dining_counter (contact)": ObjectTouches("wine_glass2", "dining_counter"),
            "gripper > 0.25 m from wine_glass1": GripperFar("wine_glass1", 0.25),
            "gripper > 0.25 m from wine_glass2": GripperFar("wine_glass2", 0.25),
        },
        initial={},
        order=EACH_ITS_OWN,
    ),
    "SetupBowls": Ours(
        goal={
            "bowl1 and bowl2 matched to two different stools: in that stool's frame lateral |dx| < 0.15 m AND forward "
            "|dy| < 0.3 m": EACH_ITS_STOOL,
            # Ours: the counter that the instruction names.
            "bowl1 touching any counter": ObjectTouches("bowl1", "dining_counter"),
            "bowl2 touching any counter": ObjectTouches("bowl2", "dining_counter"),
            "gripper > 0.25 m from bowl1": GripperFar("bowl1", 0.25),
            "gripper > 0.25 m from bowl2": GripperFar("bowl2", 0.25),
        },
        initial={"cabinet doors open (0.90-1.0 of range)": InitialOpenness("cabinet", 0.9, 1.0)},
        order=EACH_ITS_STOOL,
        drawn={"stool{i}": "stool1"},
        kinds={"dining_counter": "dining_counter"},
        near={"dining_counter": "stool"},
        more={"stool1", "stool2"},
    ),
}
