"""The choice of MuJoCo's OpenGL backend: EGL where it works, else OSMesa.

MuJoCo reads `MUJOCO_GL` when it is imported and defaults to a windowed backend, which a machine without a
display does not have. Entry points that render call `ensure_gl()` once; nothing is chosen at import.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from robocasa_lerobot.errors import UserError

VARIABLE = "MUJOCO_GL"
HEADLESS_BACKENDS = ("egl", "osmesa")
# Renderer names of the software rasterizers of Mesa and of SwiftShader.
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "swiftshader")
# libgl1 as well: PyOpenGL, which MuJoCo calls EGL through, loads the OpenGL functions from it.
REMEDY = "apt-get install --yes libegl1 libgl1 libgl1-mesa-dri"
NVIDIA_REMEDY = "apt-get install --yes libegl-nvidia0"
NVIDIA_CONTAINER_NOTE = "in a container, start it with NVIDIA_DRIVER_CAPABILITIES=all"

# Run in a process of its own: a driver that crashes must not take the caller with it, and a context made
# here would be inherited by forked workers. It draws: contexts have been seen that exist and draw nothing.
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><light/><geom size="1" rgba="1 0 0 1"/></worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 16, 16) as renderer:
    renderer.update_scene(data)
    picture = renderer.render()
    from OpenGL import GL
    name = GL.glGetString(GL.GL_RENDERER).decode()
assert picture[8, 8, 0] > 100 > picture[8, 8, 1], picture[8, 8]
print("renderer:", name)
"""


class NoOpenGLError(UserError):
    """No OpenGL context can be created on this machine."""


@dataclass(frozen=True)
class GLProbe:
    """What a try to render with a backend gave: the renderer's name, or the last line of the failure."""

    backend: str
    renderer: str | None
    failure: str = ""

    @property
    def software(self) -> bool:
        """Whether the pictures are drawn by the CPU."""
        return self.renderer is not None and any(name in self.renderer.lower() for name in SOFTWARE_RENDERERS)


@cache
def probe(backend: str) -> GLProbe:
    """Render a few pixels with `backend` ("egl", "osmesa", "glfw") in a process of its own (about half a second)."""
    environment = {**os.environ, VARIABLE: backend}
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE], env=environment, capture_output=True, text=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return GLProbe(backend, None, "no answer within 120 s")
    for line in done.stdout.splitlines():
        if done.returncode == 0 and line.startswith("renderer: "):
            return GLProbe(backend, line.removeprefix("renderer: "))
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return GLProbe(backend, None, lines[-1] if lines else f"exit status {done.returncode}")


def has_gpu() -> bool:
    """Whether the kernel shows an NVIDIA or AMD compute device, whatever the installed libraries can do with it."""
    return Path("/proc/driver/nvidia/version").exists() or Path("/dev/kfd").exists()


def ensure_gl() -> str:
    """Choose MuJoCo's backend for this process and its children, and return its name.

    A `MUJOCO_GL` that is already set stays. Without one, on Linux, the first of EGL and OSMesa that renders is
    chosen; other systems have a working default. Warns when the CPU draws although the machine has a GPU.

    Raises:
        NoOpenGLError: neither EGL nor OSMesa renders; the message has the command that mends it.
    """
    asked = os.environ.get(VARIABLE)
    if asked:
        return asked
    if sys.platform != "linux":
        return "default"
    tried = []
    for backend in HEADLESS_BACKENDS:
        result = probe(backend)
        if result.renderer is not None:
            if result.software and has_gpu():
                warnings.warn(
                    f"pictures are drawn by the CPU ({result.renderer}) although this machine has a GPU: many times "
                    f"slower. Install the vendor's OpenGL libraries: {NVIDIA_REMEDY} ({NVIDIA_CONTAINER_NOTE}).",
                    RuntimeWarning,
                    stacklevel=2,
                )
            _use(backend)
            return backend
        tried.append(f"{backend}: {result.failure}")
    raise NoOpenGLError(
        f"no OpenGL context for rendering ({'; '.join(tried)}). Install one: {REMEDY}  "
        "(then `robocasa-lerobot doctor` checks it)"
    )


def _use(backend: str) -> None:
    os.environ[VARIABLE] = backend
    # MuJoCo binds its backend at import, so one that was imported before this choice is bound anew.
    mujoco = sys.modules.get("mujoco")
    if mujoco is not None:
        module = importlib.import_module("mujoco.rendering.classic.gl_context")
        mujoco.GLContext = importlib.reload(module).GLContext  # type: ignore[attr-defined]


if __name__ == "__main__":  # for shell scripts: `python -m robocasa_lerobot.gl` prints the backend, or fails
    try:
        print(ensure_gl())
    except NoOpenGLError as error:
        raise SystemExit(str(error)) from None
