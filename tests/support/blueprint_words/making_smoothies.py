"""Making smoothies: our words for its blueprints."""

from __future__ import annotations

from blueprint_words.ours import ON_ITS_MIDDLE, Ours, away
from robocasa_lerobot.envs.predicates import ForEach, GripperFar, GripperFarFromPart, ObjectInside, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.initial_states import LidAside
from robocasa_lerobot.envs.scene.spec import InitialOpenness

NO_LID = {"blender has no lid": LidAside("blender", gone=True)}
INTERIOR = "(all bbox corners in an interior region, tolerance 0.01)"
FOODS = ("smoothie_food1", "smoothie_food2")


def each_blended(name: str) -> dict[str, ForEach]:
    # The tolerance of the original is over the region's extent in metres: more than ours.
    return {
        f"every {name}{{i}} inside blender {INTERIOR}": ForEach(name, lambda one: ObjectInside(one, "blender")),
        f"gripper > 0.25 m from every {name}{{i}}": ForEach(name, lambda one: GripperFar(one, 0.25)),
    }


RUNS = StateIs("blender", "on")

OURS = {
    "AddIceCubes": Ours(
        goal=each_blended("ice_cube"),
        initial={
            **NO_LID,
            "robot base in front of bowl": "bowl",
            "number of ice cubes 2 or 3 at random": None,
        },
    ),
    "AddSweetener": Ours(
        goal=each_blended("sugar_cube"),
        initial={
            **NO_LID,
            "fruit already in blender": "obj",
            "robot base in front of plate": "plate",
            "number of sugar cubes 2 or 3 at random": None,
        },
    ),
    "BlendIngredients": Ours(
        goal={
            f"fruit inside blender {INTERIOR}": ObjectInside("fruit", "blender"),
            "blender turned on (needs lid on: lid within 0.04 m of closed position and tilt < 7 deg)": RUNS,
        },
        initial={"lid on blender": None, "blender off": None},
        order=RUNS,
        besides=frozenset({GripperFarFromPart("blender", "button")}),
    ),
    "PlaceStraw": Ours(
        goal={
            "straw in cup (contact AND xy centre distance < 0.06 m)": ObjectOn("straw", "cup", within=0.06),
            **away("cup"),
        },
        initial={
            "drawer partly open (0.27-0.30 of slide range)": InitialOpenness("drawer", 0.49, 0.55),
            "robot base beside the drawer (left or right at random among free sides, offset half drawer width + 0.20 "
            "m); {drawer_side} = side of the drawer seen from robot": None,
            "cup holds smoothie (visual liquid only)": "cup",
        },
    ),
    "PrepareSmoothie": Ours(
        goal={
            **{f"{name} in/on plate {ON_ITS_MIDDLE.format('plate')}": ObjectOn(name, "plate") for name in FOODS},
            **away(*FOODS),
            "distr_item inside fridge (all bbox corners in an interior region, tolerance 0.05) (stays)": ObjectInside(
                "distr_item", "fridge", margin=0.05
            ),
        },
        initial={"fridge doors open (0.90-1.0 of range)": InitialOpenness("fridge", 0.9, 1.0, part="fridge")},
    ),
}
