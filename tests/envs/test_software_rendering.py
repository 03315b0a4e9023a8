"""Pictures that our own code draws on the CPU are those of OpenGL, need none of it, and are the same in any process."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import warnings

import mujoco
import numpy as np
import pytest
import task_selection
from numpy.typing import NDArray

from robocasa_lerobot import contract, gl
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.planning.errors import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.rendering.software import painter as painter_module
from robocasa_lerobot.envs.rendering.software.arrays import View
from robocasa_lerobot.envs.rendering.software.rasterization import NOTHING, visible
from robocasa_lerobot.errors import UnknownNameError

Picture = NDArray[np.uint8]
PIXELS = 128


def differences(one: Picture, other: Picture) -> NDArray[np.int64]:
    """Levels by which pixels differ, the most of their three channels."""
    return np.asarray(np.abs(one.astype(int) - other.astype(int)).max(axis=-1))


@pytest.mark.costly
@pytest.mark.render
@pytest.mark.parametrize("task", task_selection.every_task())
def test_a_kitchen_is_drawn_as_opengl_draws_it(task: str) -> None:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    env.reset(seed=11)
    rng = np.random.default_rng(3)
    renderers = [SceneRenderer(env.model, PIXELS, PIXELS, opengl=opengl) for opengl in (False, True)]
    for _ in range(3):
        for _ in range(8):
            env.step(rng.uniform(-1.0, 1.0, 12).astype(np.float32))
        ours, theirs = (renderer.pictures(env.data, contract.CAMERAS) for renderer in renderers)
        for camera, one, other in zip(contract.CAMERAS, ours, theirs, strict=True):
            apart = differences(one, other)
            # Over all tasks at most 0.93, 0.13 and 0.003, and 1.3, 0.12 and 0.014 at the wrist: fine textures, panes
            # one behind the other and their edges.
            at_wrist = camera == "robot0_eye_in_hand"
            assert apart.mean() < (1.5 if at_wrist else 1.0), camera
            assert (apart > 2).mean() < 0.15, camera
            assert (apart > 24).mean() < (0.02 if at_wrist else 0.01), camera
            assert one.std() > 10.0, camera
    for renderer in renderers:
        renderer.close()
    env.close()


ABOVE = "pos='0 -2 1.2' xyaxes='1 0 0 0 .5 .86'"


def scene(
    *parts: str, visual: str = "", assets: str = "", camera: str = "pos='0 -2 1.2' xyaxes='1 0 0 0 0.5 0.86'"
) -> str:
    return f"""
    <mujoco>
      <visual><quality offsamples='0' numslices='14' numstacks='9'/>{visual}</visual>
      <asset>{assets}</asset>
      <worldbody><camera name='seen' {camera}/>{"".join(parts)}</worldbody>
    </mujoco>"""


FLOOR = "<geom type='box' size='2 2 .05' pos='0 0 -.3' rgba='.5 .6 .4 1' group='1'/>"
THINGS = (
    "<geom type='box' size='.2 .1 .3' pos='-.5 .2 0' euler='10 20 30' rgba='.8 .2 .2 1' group='1'/>",
    "<geom type='sphere' size='.25' pos='.1 .1 .1' rgba='.2 .3 .9 1' group='1'/>",
    "<geom type='ellipsoid' size='.3 .15 .2' pos='.6 .3 0' euler='0 30 0' rgba='.9 .9 .2 1' group='1'/>",
    "<geom type='cylinder' size='.1 .2' pos='.4 -.4 0' rgba='.3 .8 .8 1' group='1'/>",
    "<geom type='capsule' size='.08 .2' pos='-.2 -.4 0' euler='0 60 0' rgba='.8 .5 .1 1' group='1'/>",
    "<geom type='plane' size='.3 .2 .1' pos='0 .9 .2' euler='60 0 0' rgba='.9 .9 .9 1' group='1'/>",
)
DARK = "<headlight active='0'/>"
PANES = (
    "<geom type='box' size='.3 .02 .3' pos='0 -.3 .2' rgba='.2 .9 .9 .4' group='1'/>",
    "<geom type='box' size='.3 .02 .3' pos='.2 -.6 .1' rgba='.9 .3 .3 .5' group='1'/>",
    "<geom type='ellipsoid' size='.2 .2 .2' pos='-.3 -.5 .1' rgba='.3 .3 .9 .6' group='1'/>",
)
SCENES: dict[str, tuple[str, float]] = {
    "headlight": (scene(FLOOR, *THINGS), 0.6),
    "directional": (scene("<light type='directional' dir='.3 .4 -1'/>", FLOOR, *THINGS, visual=DARK), 0.6),
    "spot": (
        scene("<light type='spot' pos='0 -.4 1.4' dir='.1 .2 -1' cutoff='35' exponent='6'/>", FLOOR, *THINGS),
        0.6,
    ),
    "glow": (
        scene(
            *(part.replace("rgba", "material='glowing' rgba") for part in THINGS),
            FLOOR,
            assets="<material name='glowing' emission='.4' specular='.9' shininess='.2'/>",
        ),
        0.6,
    ),
    "transparent": (scene(FLOOR, *THINGS, *PANES), 0.8),
    "lens": (
        scene(
            FLOOR,
            *THINGS,
            camera="pos='0 -2 1.2' xyaxes='1 0 0 0 .5 .86' sensorsize='.04 .03' focal='.03 .035' "
            "principal='.004 -.003' resolution='64 48'",
        ),
        0.8,
    ),
    # Large triangles that begin behind the camera.
    "inside": (scene(FLOOR, *THINGS, camera="pos='0 0 -.2' xyaxes='1 .2 0 0 .1 1' fovy='90'"), 1.0),
}


@pytest.mark.render
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("size", [(96, 96), (90, 140)])
def test_a_scene_is_drawn_as_opengl_draws_it(name: str, size: tuple[int, int]) -> None:
    xml, most = SCENES[name]
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ours = SceneRenderer(model, *size, opengl=False)
    assert ours._painter is not None
    # OpenGL draws this look-alike as well: the model's own round shapes have other facets.
    theirs = SceneRenderer(model, *size, opengl=True, alike=ours._alike)
    one, other = ours.render(data, "seen"), theirs.render(data, "seen")
    apart = differences(one, other)
    assert apart.mean() < most
    assert (apart > 24).mean() < 0.02  # edges
    assert other.std() > 5.0
    ours.close()
    theirs.close()


# Draws a kitchen where OpenGL cannot even be loaded, then in a process forked from that, and prints what was drawn.
WITHOUT_OPENGL = """
import hashlib, os, sys
sys.modules["OpenGL"] = None
import numpy as np
from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.demos.planning.errors import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

env = KitchenEnv("TurnOnSinkFaucet", image_size=96)
drawn = [env.reset(seed=5)[0]]
for number in range(6):
    drawn.append(env.step(np.full(12, 0.3, dtype=np.float32))[0])

def digest(observation):
    pictures = observation["pixels"]
    return hashlib.sha256(b"".join(pictures[name].tobytes() for name in sorted(pictures))).hexdigest()

print(*map(digest, drawn), flush=True)
state = env.get_state()
child = os.fork()
if child == 0:
    print(digest(env.set_state(state)[0]), flush=True)
    os._exit(0)
assert os.waitpid(child, 0)[1] == 0
"""


def without_opengl(**variables: str) -> list[str]:
    kept = {name: value for name, value in os.environ.items() if name not in (gl.VARIABLE, gl.RENDERER_VARIABLE)}
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_OPENGL],
        env={**kept, gl.RENDERER_VARIABLE: "cpu", **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_pictures_need_no_opengl_and_are_the_same_in_any_process() -> None:
    one, other = without_opengl(), without_opengl(OMP_NUM_THREADS="1")  # rows are shared out, or are not
    assert len(one) == 8
    assert len(set(one)) == 7, "each step is another picture, and a forked process draws the last one again"
    assert one == other


def shuffled(rng: np.random.Generator, corners: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A net of triangles without gaps over a square, its inner corners anywhere; corners (n, 3) at distance 1."""
    steps = np.linspace(-1.2, 1.2, corners)
    x, y = np.meshgrid(steps, steps)
    inner = (np.abs(x) < 1.1) & (np.abs(y) < 1.1)
    # Quarters of a pixel, so that many edges go through the middles of pixels.
    shift = np.round(rng.uniform(-0.3, 0.3, (2, *x.shape)) * (steps[1] - steps[0]) * 128) / 128
    points = np.stack((x + inner * shift[0], y + inner * shift[1], np.ones_like(x)), axis=-1).reshape(-1, 3)
    first = (np.arange(corners - 1)[:, None] * corners + np.arange(corners - 1)).ravel()
    one = np.stack((first, first + 1, first + corners + 1), axis=1)
    two = np.stack((first, first + corners + 1, first + corners), axis=1)
    return points, np.concatenate((one, two)).astype(np.int32)


@pytest.mark.parametrize("corners", [2, 5, 40])
def test_each_pixel_belongs_to_one_of_the_triangles_that_meet_there(corners: int) -> None:
    points, faces = shuffled(np.random.default_rng(corners), corners)
    view = View(0, 64, 64)
    lens = np.array((32.0, 32.0, 32.0, 32.0, 1e-3))
    covered = np.zeros(64 * 64, dtype=int)
    for turned in (faces, np.ascontiguousarray(faces[:, ::-1])):
        for face in range(len(faces)):
            inverse, seen = np.zeros(64 * 64, dtype=np.float32), np.full(64 * 64, NOTHING, dtype=np.int32)
            visible(face, face + 1, True, turned, points, lens, view, inverse, seen)
            covered += seen == face
    assert (covered == 1).all()  # of one of the two sides; the other one is its back


NOT_OURS = {
    "an endless plane": scene("<geom type='plane' size='0 0 .1' group='1'/>", THINGS[0]),
    "a cube of pictures": scene(
        "<geom type='box' size='1 1 1' material='m' group='1'/>",
        assets="<texture name='t' type='cube' builtin='flat' width='8' height='8'/><material name='m' texture='t'/>",
    ),
    "several samples": scene(FLOOR).replace("offsamples='0'", "offsamples='4'"),
    "a point of light": scene("<light type='point' pos='0 0 2'/>", FLOOR),
    "no perspective": scene(FLOOR, camera="pos='0 -2 1' xyaxes='1 0 0 0 .5 .86' projection='orthographic'"),
}


@pytest.mark.render
@pytest.mark.parametrize("name", NOT_OURS)
def test_what_we_cannot_draw_is_drawn_by_opengl(name: str) -> None:
    model = mujoco.MjModel.from_xml_string(NOT_OURS[name])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pictures = []
    for opengl in (False, True):
        renderer = SceneRenderer(model, 48, 48, opengl=opengl)
        assert renderer._painter is None
        pictures.append(renderer.render(data, "seen"))
        renderer.close()
    assert differences(*pictures).max() <= 1
    assert pictures[0].std() > 1.0


def test_a_renderer_that_does_not_exist_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "open_gl")
    with pytest.raises(UnknownNameError, match="opengl"):
        KitchenEnv("OpenDrawer").reset(seed=0)


@pytest.mark.parametrize(
    ("sees", "found", "expected"),
    [
        (False, gl.GLProbe("egl", None, "never asked"), True),
        (True, gl.GLProbe("egl", "NVIDIA H100/PCIe/SSE2"), False),
        (True, gl.GLProbe("egl", "llvmpipe (LLVM 15.0.6, 256 bits)"), True),
        (True, gl.GLProbe("egl", None, "no such library"), True),
    ],
)
def test_who_draws_follows_from_the_machine(
    monkeypatch: pytest.MonkeyPatch, sees: bool, found: gl.GLProbe, expected: bool
) -> None:
    for name in (gl.VARIABLE, gl.RENDERER_VARIABLE, gl.DEVICE_VARIABLE):
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.setattr(gl, "sees_gpu", lambda: sees)
    monkeypatch.setattr(gl, "has_gpu", lambda: sees)
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "probe", lambda backend: found)
    monkeypatch.setattr(sys, "platform", "linux")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert gl.draws_on_cpu() is expected
    assert bool(said) == (sees and expected), "a graphics card that does not draw is worth a warning"
    if sees:  # children need not try again
        assert os.environ[gl.RENDERER_VARIABLE] == ("cpu" if expected else "opengl")
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "opengl")
    assert gl.draws_on_cpu() is False
    monkeypatch.delenv(gl.RENDERER_VARIABLE)
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "0")
    assert gl.draws_on_cpu() is False


@pytest.mark.costly
@pytest.mark.parametrize("task", task_selection.demonstrated())
def test_a_picture_does_not_depend_on_what_is_kept(task: str) -> None:
    """A demonstration, drawn in full and with what stands still kept; then its states in any order."""
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    env.reset(seed=7)
    full, keeping = (SceneRenderer(env.model, 48, 48, opengl=False, keeps_backgrounds=keeps) for keeps in (False, True))
    found: list[tuple[NDArray[np.float64], list[Picture]]] = []
    with contextlib.suppress(SkillError):
        for action in demonstrate(env):
            *_, truncated, info = env.step(action.astype(np.float32))
            one, other = (renderer.pictures(env.data, contract.CAMERAS) for renderer in (full, keeping))
            assert all(np.array_equal(*pair) for pair in zip(one, other, strict=True))
            found.append((env.data.qpos.copy(), one))
            if truncated or info["success"]:
                break
    painter = keeping._painter
    assert painter is not None
    assert any(painter._standing._kept.values()), "views came again"
    before = [pictures for _, pictures in found]
    for number in np.random.default_rng(0).permutation(len(found))[:60].tolist():
        env.data.qpos[:] = found[number][0]
        mujoco.mj_forward(env.model, env.data)
        again = [renderer.pictures(env.data, contract.CAMERAS) for renderer in (full, keeping)]
        assert all(np.array_equal(*pair) for pair in zip(*again, strict=True))
        assert all(np.array_equal(*pair) for pair in zip(again[0], before[number], strict=True))
    env.close()


@pytest.mark.parametrize("threads", [1, 3])
def test_pictures_are_right_after_an_interrupt(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    """Ctrl-C while a view is drawn to be kept, as in a notebook or a teleoperation that goes on afterwards."""
    model = mujoco.MjModel.from_xml_string(scene(FLOOR, *THINGS))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = SceneRenderer(model, 48, 48, opengl=False)
    monkeypatch.setattr(painter_module, "_threads_at_most", lambda: threads)
    monkeypatch.setattr(painter_module, "_threads", {})
    first = renderer.render(data, "seen")
    really, interrupted = painter_module.draw, []

    def draw(*arguments: object) -> None:
        if painter_module.KEEP in [one for one in arguments if isinstance(one, int)]:
            interrupted.append(True)
            raise KeyboardInterrupt
        really(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(painter_module, "draw", draw)
        with pytest.raises(KeyboardInterrupt):
            renderer.render(data, "seen")
    assert interrupted
    for _ in range(3):
        np.testing.assert_array_equal(renderer.render(data, "seen"), first)
    for pool in painter_module._threads.values():
        pool.shutdown()
    renderer.close()
