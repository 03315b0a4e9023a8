"""Workers render on the device they are told to, and a CPU that draws beside a GPU is announced."""

from __future__ import annotations

import os
import subprocess
import sys
import types
from contextlib import closing
from functools import partial
from pathlib import Path

import mujoco
import pytest
from vector_support import STILL, FaultyEnv, clean_workers  # noqa: F401 (a fixture)

from robocasa_lerobot import contract, gl
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.vector.kitchens import make_vector_env
from robocasa_lerobot.evaluation.run.messages import WorkerSettings
from robocasa_lerobot.evaluation.run.worker_pool import WorkerPool


def devices(*names: str) -> tuple[gl.RenderDevice, ...]:
    return tuple(gl.RenderDevice(index, name, index, False) for index, name in enumerate(names))


def test_workers_are_dealt_out_to_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    with closing(make_vector_env(FaultyEnv, 3, devices=[1, 0])) as envs:
        assert envs.call("variable", gl.DEVICE_VARIABLE) == ("1", "0", "1")
        assert envs.call("variable", gl.VARIABLE) == ("egl",) * 3
    assert gl.DEVICE_VARIABLE not in os.environ  # of this process


def test_a_device_in_the_environment_reaches_the_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "1")
    with closing(make_vector_env(FaultyEnv, 2)) as envs:
        assert envs.call("variable", gl.DEVICE_VARIABLE) == ("1", "1")
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "first")
    with pytest.raises(gl.RenderDeviceError, match="'first'"):
        make_vector_env(FaultyEnv, 2)


def test_a_device_in_the_environment_matters_only_where_egl_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: ())
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "0")
    for cameras in ((), []):
        with closing(make_vector_env("OpenDrawer", 1, cameras=cameras)) as envs:
            assert envs.call("cameras") == ((),)
    monkeypatch.setenv(gl.VARIABLE, "osmesa")
    monkeypatch.setattr(gl, "ensure_gl", lambda: "default")  # workers that draw nothing need no OSMesa
    with closing(make_vector_env(FaultyEnv, 1)) as envs:
        assert envs.reset(seed=1)[0]["agent_pos"].tolist() == [[1, 0]]


def test_devices_that_are_given_are_those_of_kitchens_without_cameras_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a kitchen draws when it is asked to."""
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    with closing(make_vector_env("OpenDrawer", 1, devices=1, cameras=())) as envs:
        assert [(member.backend, member.device) for member in envs._members] == [("egl", 1)]


@pytest.mark.parametrize("device", [2, -1, True])
def test_unknown_devices_are_refused_with_those_there_are(monkeypatch: pytest.MonkeyPatch, device: int) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "A40"))
    for make in (
        lambda: make_vector_env(FaultyEnv, 2, devices=[0, device]),
        lambda: KitchenEnv("OpenDrawer", render_device=device),
        lambda: gl.ensure_gl(device),
    ):
        with pytest.raises(gl.RenderDeviceError, match=r"0: H200 \(CUDA 0\), 1: A40 \(CUDA 1\)"):
            make()


def test_devices_need_egl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gl.VARIABLE, "osmesa")
    with pytest.raises(gl.RenderDeviceError, match="only EGL"):
        make_vector_env(FaultyEnv, 2, devices=0)


def test_a_process_that_draws_cannot_change_its_device(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "render_devices", lambda: devices("H200", "H200"))
    monkeypatch.setitem(sys.modules, "mujoco.egl", types.SimpleNamespace(EGL_DISPLAY=object()))
    monkeypatch.setattr(mujoco, "GLContext", types.SimpleNamespace(__module__="mujoco.egl"))
    monkeypatch.setenv(gl.DEVICE_VARIABLE, "0")
    assert gl.ensure_gl(0) == "egl"
    with pytest.raises(gl.RenderDeviceError, match="draws on device 0 already"):
        gl.ensure_gl(1)


@pytest.mark.render
def test_a_backend_that_is_named_after_mujocos_import_draws() -> None:
    code = """
import os, sys
import mujoco
assert mujoco.GLContext.__module__ == "mujoco.glfw"
os.environ["MUJOCO_GL"] = sys.argv[1]
from robocasa_lerobot.gl import ensure_gl
assert ensure_gl() == sys.argv[1]
assert mujoco.GLContext.__module__ == f"mujoco.{sys.argv[1]}"
with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8) as renderer:
    assert renderer.render().shape == (8, 8, 3)
"""
    chosen = {gl.VARIABLE, "PYOPENGL_PLATFORM"}  # by this process
    environment = {name: value for name, value in os.environ.items() if name not in chosen}
    command = [sys.executable, "-c", code, os.environ[gl.VARIABLE]]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere windows need no display")
@pytest.mark.parametrize("backend", ["glfw", "nonsense"])
def test_a_backend_that_does_not_work_here_is_told_with_what_to_do(backend: str, tmp_path: Path) -> None:
    """One for windows without a display fails where something is drawn, one that MuJoCo does not know at its import."""
    asked = ["--tasks=OpenDrawer", "--image-size=16", "--overview-size=16x16", f"--out={tmp_path / 'pictures'}"]
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment |= {gl.VARIABLE: backend, gl.RENDERER_VARIABLE: "opengl"}
    environment.pop("PYOPENGL_PLATFORM", None)
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "gallery", *asked]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert f"robocasa-lerobot gallery: no OpenGL context of MUJOCO_GL={backend} (" in done.stderr
    assert "Unset MUJOCO_GL: what works is found without it" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.render
def test_every_device_of_this_machine_can_be_pinned() -> None:
    """Each device that EGL lists is accepted in a worker, and what draws is told."""
    if os.environ[gl.VARIABLE] != "egl":
        pytest.skip("only EGL has numbered devices")
    assert [device.index for device in gl.render_devices()] == list(range(len(gl.render_devices())))
    device = gl.render_devices()[0].index
    with closing(make_vector_env("OpenDrawer", 1, devices=device, image_size=16, cameras=contract.CAMERAS[:1])) as envs:
        assert envs.renderers == (None,)
        envs.reset(seed=1)
        assert envs.renderer
        assert envs.call("render")[0].shape == (16, 16, 3)


def test_software_rendering_beside_a_gpu_is_announced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: True)
    monkeypatch.setattr(gl, "probe", lambda backend: gl.GLProbe(backend, "NVIDIA H200/PCIe/SSE2"))  # here, not there
    with closing(make_vector_env(partial(FaultyEnv, renderer="llvmpipe (LLVM 15)"), 2)) as envs:
        with pytest.warns(gl.SoftwareRenderingWarning, match="although this machine has a GPU") as caught:
            envs.reset(seed=1)
        envs.step(STILL)
        assert len(caught) == 1
        assert envs.renderers == ("llvmpipe (LLVM 15)",) * 2


@pytest.mark.parametrize(("renderer", "gpu"), [("llvmpipe (LLVM 15)", False), ("NVIDIA H200/PCIe/SSE2", True)])
@pytest.mark.filterwarnings("error")
def test_what_is_as_it_should_be_is_not_announced(monkeypatch: pytest.MonkeyPatch, renderer: str, gpu: bool) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: gpu)
    monkeypatch.setattr(gl, "probe", lambda backend: gl.GLProbe(backend, renderer))
    with closing(make_vector_env(partial(FaultyEnv, renderer=renderer), 2)) as envs:
        envs.reset(seed=1)
        assert envs.renderer == renderer


def test_a_parent_that_does_not_render_announces_it_for_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "probe", lambda backend: gl.GLProbe(backend, "llvmpipe (LLVM 15)"))
    monkeypatch.setattr(gl, "has_gpu", lambda: True)
    with pytest.warns(gl.SoftwareRenderingWarning, match=r"llvmpipe \(LLVM 15\)"):
        gl.announce_backend()


def test_evaluation_workers_are_dealt_out_to_devices_and_replaced_in_place() -> None:
    settings = WorkerSettings({}, "", {}, "cpu", 1, None, "", render_devices=(4, 7))
    pool = WorkerPool(settings, 3, 1.0)
    for expected in (4, 7, 4, 7):
        assert pool._least_used_device() == expected
        pool._slots.append(types.SimpleNamespace(render_device=expected))  # type: ignore[arg-type]
    del pool._slots[0]
    assert pool._least_used_device() == 4
    assert WorkerPool(WorkerSettings({}, "", {}, "cpu", 1, None, ""), 1, 1.0)._least_used_device() is None


@pytest.mark.render
def test_a_single_env_announces_it_although_the_backend_was_set_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "_announced", set())
    monkeypatch.setattr(gl, "has_gpu", lambda: True)
    monkeypatch.setattr(gl, "is_software", lambda renderer: True)
    with closing(KitchenEnv("OpenDrawer", image_size=16, cameras=contract.CAMERAS[:1])) as env:
        with pytest.warns(gl.SoftwareRenderingWarning):
            env.reset(seed=1)
        assert gl.used_renderer()
