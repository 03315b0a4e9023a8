"""What is left out because all that was drawn hides it would not be seen; and renderers that share their work."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.rendering.software.arrays import Kept, Pose, Scratch, Shapes, View
from robocasa_lerobot.envs.rendering.software.drawing import KEEP_NOTHING, draw
from robocasa_lerobot.envs.rendering.software.occlusion import is_hidden
from robocasa_lerobot.envs.rendering.software.painter import Painter
from robocasa_lerobot.envs.rendering.software.rasterization import NOTHING, to_camera, visible

PIXELS = 96
EDGES_M = np.array((1.0, 2.0))
FAR_M = 50.0


def cluttered(rng: np.random.Generator, panes: int) -> mujoco.MjModel:
    """A wall with a gap, a pillar, and panes of all kinds before, in and behind them."""
    geoms = [
        "<geom type='box' pos='-1.1 3 0' size='1 .1 3' rgba='.6 .5 .4 1' group='1'/>",
        "<geom type='box' pos='1.4 3 0' size='1 .1 3' rgba='.4 .5 .6 1' group='1'/>",
        "<geom type='ellipsoid' pos='.2 1.5 0' size='.3 .3 .6' rgba='.2 .7 .2 1' group='1'/>",
    ]
    for _ in range(panes):
        kind = rng.choice(("box", "ellipsoid"))
        size, euler = (" ".join(f"{x:.3f}" for x in rng.uniform(*bounds, 3)) for bounds in ((0.01, 0.4), (-90, 90)))
        pos = " ".join(f"{x:.3f}" for x in (rng.uniform(-3, 3), rng.uniform(-1, 7), rng.uniform(-2, 2)))
        geoms.append(f"<geom type='{kind}' pos='{pos}' size='{size}' euler='{euler}' rgba='.9 .3 .3 .5' group='1'/>")
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><visual><quality offsamples='0'/></visual><worldbody><light pos='0 0 3' dir='0 1 -1'/>"
        f"<camera name='seen' pos='0 0 0' xyaxes='1 0 0 0 0 1' fovy='70'/>{''.join(geoms)}</worldbody></mujoco>"
    )


def drawn(painter: Painter, pose: Pose, view: View) -> Scratch:
    """What the rows of a view are drawn in, afterwards."""
    scratch = Scratch.of(len(painter._shapes.vertices), PIXELS, PIXELS)
    picture = np.zeros((PIXELS, PIXELS, 3), np.uint8)
    nothing = Kept.of(np.zeros(len(painter._shapes.reach), dtype=np.bool_), 0, 0)
    draw(painter._shapes, pose, scratch, view, EDGES_M, FAR_M, KEEP_NOTHING, nothing, picture)
    return scratch


def is_seen(geom: int, shapes: Shapes, pose: Pose, view: View, scratch: Scratch) -> bool:
    """Whether any of its triangles is, looked at one by one."""
    to_camera(geom, shapes, pose, scratch)
    seen = np.full(PIXELS * PIXELS, NOTHING, dtype=np.int32)
    first, end = shapes.first_face[geom], shapes.first_face[geom + 1]
    visible(first, end, False, shapes.faces, scratch.corners, pose.lens, view, scratch.inverse, seen)
    return bool((seen != NOTHING).any())


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("rows", [(0, PIXELS), (30, 70)])
def test_a_hidden_geom_is_seen_nowhere(seed: int, rows: tuple[int, int]) -> None:
    model = cluttered(np.random.default_rng(seed), panes=60)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = SceneRenderer(model, PIXELS, PIXELS, opengl=False)
    painter, alike = renderer._painter, renderer._alike
    assert painter is not None
    assert alike is not None
    alike.follow(data)
    pose, view = painter._pose(alike.data, 0, painter._looks()), View(*rows, PIXELS)
    scratch = drawn(painter, pose, view)
    panes = np.flatnonzero((pose.looks[:, 3] > 0.0) & (pose.looks[:, 3] < 1.0)).tolist()
    hidden = {pane for pane in panes if is_hidden(pane, painter._shapes, pose, view, scratch.inverse)}
    unseen = {pane for pane in panes if not is_seen(pane, painter._shapes, pose, view, scratch)}
    assert hidden <= unseen
    assert len(hidden) > len(unseen) / 2 > 5, "most of what the wall hides is found"
    assert len(unseen) < len(panes)
    renderer.close()


def test_a_renderer_of_another_size_shares_the_look_alike_and_draws_the_same() -> None:
    env = KitchenEnv("TurnOnStove", cameras=("robot0_eye_in_hand",), image_size=64)
    env.reset(seed=3)
    rng = np.random.default_rng(0)
    shared, own = env.renderer_of_size(80, 120), SceneRenderer(env.model, 80, 120)
    assert shared._alike is env._open_renderer()._alike
    for _ in range(3):
        env.step(np.full(12, 0.4, dtype=np.float32))
        for one, other in zip(
            shared.pictures(env.data, contract.CAMERAS), own.pictures(env.data, contract.CAMERAS), strict=True
        ):
            assert one.shape == (80, 120, 3)
            assert np.array_equal(one, other)
        opaque = np.flatnonzero((env.model.geom_group == 1) & (env.model.geom_rgba[:, 3] == 1.0))
        # Shapes of another colour make the look-alike be made anew, by each renderer for itself.
        env.model.geom_rgba[opaque[::7]] = (*rng.uniform(0.1, 0.9, 3), 1.0)
    shared.close()
    own.close()
    env.close()
