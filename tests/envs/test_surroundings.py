"""What is seen past a room's walls: never nothing, from wherever a task may start the robot; nothing else changes."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.checks.views import views
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.layout import layout_ids
from robocasa_lerobot.envs.kitchens.plan.fixture_rows import WALL_THICKNESS
from robocasa_lerobot.envs.kitchens.splits import without
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.errors import UserError

pytestmark = pytest.mark.render


def test_cameras_beyond_a_wall_see_more_room_and_never_nothing() -> None:
    tasks = [get_task(name) for name in ("CloseDrawer", "CloseBlenderLid")]
    seen = list(views(20, tasks, 0, starts=12, size=32))
    assert {view.task for view in seen} == {"CloseDrawer", "CloseBlenderLid"}
    assert sum(view.beyond_m > 0 for view in seen) >= 2  # those that saw nothing beside the wall before
    assert not [view for view in seen if view.background > 0]


def test_scenes_and_states_are_those_of_the_room_alone() -> None:
    env = KitchenEnv("CloseDrawer", layouts=(1,), styles=(1,), image_size=64)
    observation, _ = env.reset(seed=27)
    bare = env.scene.spec.copy()
    shell = list(bare.worldbody.geoms)
    assert len(shell) == 6
    for geom in shell:
        bare.delete(geom)
    models = (env.model, bare.compile())
    assert models[0].nbody == models[1].nbody
    states = []
    for model in models:
        assert mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION) == len(env.get_state().physics)
        data = mujoco.MjData(model)
        data.qpos[:] = env.data.qpos
        data.ctrl[:] = 0.3
        mujoco.mj_step(model, data, 50)
        states.append(data.qpos.copy())
    assert states[0].tobytes() == states[1].tobytes()
    assert np.ptp(observation["pixels"]["robot0_agentview_left"]) > 50
    env.close()


def _admitted(layout_id: int) -> list[Task]:
    found = []
    for task in map(get_task, task_names()):
        try:
            without([(layout_id, layout_id)], task.needs, task.exclude_styles)
        except UserError:
            continue
        found.append(task)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("camera_set", ["default", "cotraining"])
@pytest.mark.parametrize("layout_id", layout_ids())
def test_no_camera_sees_past_any_kitchen(layout_id: int, camera_set: str) -> None:
    seen = list(views(layout_id, _admitted(layout_id), 0, camera_set=camera_set))
    assert len({view.task for view in seen}) > 45
    assert not [view for view in seen if view.background > 0]
    # From farther out the wall itself would be in the way.
    assert max(view.beyond_m for view in seen) < WALL_THICKNESS
