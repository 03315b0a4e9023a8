"""What has fallen into a vessel is inside, however it has tumbled, and what is above or beside it is not."""

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.predicates import ObjectInside
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.tasks.registry import get_task

# Turns of what has tumbled: on a face of its box, on an edge, on a corner.
TURNS = ((1.0, 0.0, 0.0, 0.0), (0.924, 0.383, 0.0, 0.0), (0.88, 0.28, 0.365, 0.12))


@pytest.mark.parametrize("split", ["target", "pretrain"])
def test_it_counts_in_the_jug_however_it_lies_there(split: str) -> None:
    scene = build_scene(get_task("BlendMarinade"), split, 0)
    data = mujoco.MjData(scene.model)
    mujoco.mj_resetData(scene.model, data)
    mujoco.mj_forward(scene.model, data)
    jug = scene.fixture("blender", Blender).regions["jug"]
    goal = ObjectInside("marinade_veg1", "blender")
    half = max(scene.objects["marinade_veg1"].item.size) / 2
    (wide, _, tall), joint = jug.half, data.joint("marinade_veg1_joint0")
    places = {
        (0.0, 0.0, half - tall): True,
        (1.2 * wide, 0.0, half - tall): jug.across > 0.0,  # at the wall of a round one
        (0.0, 0.0, tall + half): False,  # on the rim
        (wide + half + 0.02, 0.0, half - tall): False,  # leans at the jug from outside
    }
    for turn in TURNS:
        for place, held in places.items():
            joint.qpos[:] = [*jug.world(data, place), *(np.asarray(turn) / np.linalg.norm(turn))]
            mujoco.mj_forward(scene.model, data)
            assert goal.holds(scene, data) == held, (turn, place)
