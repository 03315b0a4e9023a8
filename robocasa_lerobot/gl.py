"""The choice of MuJoCo's OpenGL backend (EGL where it works, else OSMesa) and of the device that draws.

MuJoCo reads `MUJOCO_GL` when it is imported and defaults to a windowed backend, which a machine without a
display does not have. Entry points that render call `ensure_gl()` once; nothing is chosen at import.

Render devices are numbered as EGL lists them, which is what `MUJOCO_EGL_DEVICE_ID` counts in. That is not CUDA's
numbering: `CUDA_VISIBLE_DEVICES` neither hides a render device nor renumbers it.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import traceback
import warnings
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from robocasa_lerobot.errors import LackingMachineError, UnknownNameError, UserError

VARIABLE = "MUJOCO_GL"
# Who draws, where that is not left to the machine; children inherit it.
RENDERER_VARIABLE = "ROBOCASA_LEROBOT_RENDERER"
RENDERERS = ("cpu", "opengl")
OWN_RENDERER = "robocasa_lerobot (CPU)"
DEVICE_VARIABLE = "MUJOCO_EGL_DEVICE_ID"
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

# In a process of its own as well: looking loads every vendor's driver. The numbers are those of EGL_EXT_device_query
# (0x3055 extensions, 0x3233 device file), EGL_EXT_device_query_name (0x335F) and EGL_NV_device_cuda (0x323A).
_LIST_DEVICES = """
import ctypes, json
from mujoco.egl import egl_ext as EGL
def function(name, result, *arguments):
    return ctypes.CFUNCTYPE(result, *arguments)(EGL.eglGetProcAddress(name))
query = function("eglQueryDeviceStringEXT", ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
number = function(
    "eglQueryDeviceAttribEXT", ctypes.c_uint, ctypes.c_void_p, ctypes.c_int, ctypes.POINTER(ctypes.c_ssize_t))
def text(device, key):
    return (query(device, key) or b"").decode(errors="replace")
found = []
for index, device in enumerate(EGL.eglQueryDevicesEXT()):
    device = ctypes.cast(device, ctypes.c_void_p)
    extensions, cuda = text(device, 0x3055).split(), ctypes.c_ssize_t(-1)
    if "EGL_NV_device_cuda" in extensions:
        number(device, 0x323A, ctypes.byref(cuda))
    software = "EGL_MESA_device_software" in extensions
    name = text(device, 0x335F) if "EGL_EXT_device_query_name" in extensions else ""
    if not name and "EGL_EXT_device_drm" in extensions:
        name = text(device, 0x3233)
    found.append([index, name, cuda.value if cuda.value >= 0 else None, software])
print("devices:", json.dumps(found))
"""

# What has been announced in this process: one message, however many envs it has.
_announced: set[str] = set()
_used_renderer: str | None = None


class NoOpenGLError(LackingMachineError):
    """No OpenGL context can be created on this machine."""


class RenderDeviceError(UserError):
    """A render device that does not exist, or that this process can no longer change to."""


class SoftwareRenderingWarning(RuntimeWarning):
    """The CPU draws although the machine has a GPU."""


@dataclass(frozen=True)
class GLProbe:
    """What a try to render with a backend gave: the renderer's name, or the last line of the failure."""

    backend: str
    renderer: str | None
    failure: str = ""

    @property
    def software(self) -> bool:
        """Whether the pictures are drawn by the CPU."""
        return self.renderer is not None and is_software(self.renderer)


@dataclass(frozen=True)
class RenderDevice:
    """A device that EGL can draw on; `cuda` is its number in CUDA's own count, None where it has none."""

    index: int
    name: str
    cuda: int | None
    software: bool

    def __str__(self) -> str:
        name = self.name or ("the CPU" if self.software else "unnamed")
        return f"{self.index}: {name}" + (f" (CUDA {self.cuda})" if self.cuda is not None else "")


def is_software(renderer: str) -> bool:
    """Whether a renderer of this name (OpenGL's `GL_RENDERER`) is a program for the CPU."""
    return any(name in renderer.lower() for name in SOFTWARE_RENDERERS)


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


def sees_gpu() -> bool:
    """Whether the kernel shows anything that OpenGL could draw on, an integrated graphics chip included."""
    if has_gpu() or Path("/dev/dxg").exists():
        return True
    return any(Path("/dev/dri").glob("renderD*"))


def draws_on_cpu() -> bool:
    """Whether pictures are drawn by our own code on the CPU, and not by OpenGL.

    They are where OpenGL would use the CPU as well, or does not work: its software rasterizers take twice as long.
    `ROBOCASA_LEROBOT_RENDERER` decides it where it is set, and is set for this process's children where it took a try
    to find out; a render device that is asked for is OpenGL's.

    Raises:
        UnknownNameError: that variable names no renderer.
    """
    asked = os.environ.get(RENDERER_VARIABLE)
    if asked:
        if asked not in RENDERERS:
            raise UnknownNameError(RENDERER_VARIABLE, asked, RENDERERS)
        return asked == "cpu"
    if sys.platform != "linux" or os.environ.get(DEVICE_VARIABLE):
        return False
    backend = os.environ.get(VARIABLE) or "egl"
    if backend == "osmesa" or not sees_gpu():
        return True
    found = probe(backend)
    on_cpu = found.renderer is None or found.software
    if on_cpu:
        _warn_of_cpu(found.renderer or f"OpenGL does not work: {found.failure}")
    os.environ[RENDERER_VARIABLE] = "cpu" if on_cpu else "opengl"
    return on_cpu


def ensure_drawing() -> str | None:
    """Have what draws chosen for this process and its children; the backend of OpenGL where that draws, else None.

    Raises:
        as `draws_on_cpu` and `ensure_gl`.
    """
    return None if draws_on_cpu() else ensure_gl()


@cache
def render_devices() -> tuple[RenderDevice, ...]:
    """The devices that EGL lists (about half a second, once); empty where EGL lists none.

    MuJoCo asks for the first ten only, and so does this.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-c", _LIST_DEVICES],
            env={**os.environ, VARIABLE: "egl"},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return ()
    for line in done.stdout.splitlines():
        if done.returncode == 0 and line.startswith("devices: "):
            return tuple(RenderDevice(*fields) for fields in json.loads(line.removeprefix("devices: ")))
    return ()


def check_device(device: int) -> None:
    """Make sure that EGL lists `device`.

    Raises:
        RenderDeviceError: it does not, or the backend that was asked for is not EGL.
    """
    asked = os.environ.get(VARIABLE) or "egl"
    if asked != "egl":
        raise RenderDeviceError(
            f"render device {device} cannot be chosen with {VARIABLE}={asked}: only EGL has numbered devices. "
            f"Unset {VARIABLE}, or leave the device out."
        )
    if isinstance(device, bool) or device not in {known.index for known in render_devices()}:
        known_devices = ", ".join(map(str, render_devices())) or "none"
        raise RenderDeviceError(
            f"render device {device!r}: EGL lists {known_devices}. The numbers are EGL's, not CUDA's; "
            "`robocasa-lerobot doctor` shows both."
        )


def ensure_gl(device: int | None = None) -> str:
    """Choose MuJoCo's backend for this process and its children, and return its name.

    A `MUJOCO_GL` that is already set stays; MuJoCo is bound to it, should it have been imported before. Without one, on
    Linux, the first of EGL and OSMesa that renders is chosen; other systems have a working default. Warns when the CPU
    draws although the machine has a GPU; with a backend that was chosen before, `note_renderer` does so at the first
    picture.

    Args:
        device: number of the EGL device that this process shall draw on; None leaves it to `MUJOCO_EGL_DEVICE_ID`,
            and without that to EGL, whose first working device serves every process.

    Raises:
        NoOpenGLError: neither EGL nor OSMesa renders; the message has the command that mends it.
        RenderDeviceError: no such device, or the process draws on another one already.
    """
    if device is not None:
        check_device(device)
        _pin(device)
    asked = os.environ.get(VARIABLE)
    if asked:
        if asked in HEADLESS_BACKENDS and _bound_backend() not in (None, asked):
            use(asked)
        return asked
    if sys.platform != "linux":
        return "default"
    tried = []
    for backend in HEADLESS_BACKENDS if device is None else ("egl",):
        result = probe(backend)
        if result.renderer is not None:
            announce(result.renderer)
            use(backend)
            return backend
        tried.append(f"{backend}: {result.failure}")
    raise NoOpenGLError(
        f"no OpenGL context for rendering ({'; '.join(tried)}). Install one: {REMEDY}  "
        "(then `robocasa-lerobot doctor` checks it)"
    )


def use(backend: str, device: int | None = None) -> None:
    """Take over a backend and device that another process has chosen and checked, before the first OpenGL context."""
    if device is not None:
        _pin(device)
    if os.environ.get(VARIABLE) == backend and "mujoco" not in sys.modules:
        return
    os.environ[VARIABLE] = backend
    # MuJoCo binds its backend at import, so one that was imported before this choice is bound anew.
    mujoco = sys.modules.get("mujoco")
    if mujoco is not None:
        module = importlib.import_module("mujoco.rendering.classic.gl_context")
        mujoco.GLContext = importlib.reload(module).GLContext  # type: ignore[attr-defined]


def _bound_backend() -> str | None:
    """The backend that MuJoCo is bound to, an empty name for none; None before its import."""
    mujoco = sys.modules.get("mujoco")
    if mujoco is None:
        return None
    return str(getattr(getattr(mujoco, "GLContext", None), "__module__", "")).rpartition(".")[2]


def failed_backend(error: BaseException) -> NoOpenGLError | None:
    """What is to be done where an error is of the backend that `MUJOCO_GL` names; None where it is of anything else.

    MuJoCo loads that backend when it is imported, and leaves what is wrong with it to whichever line fails first.
    """
    asked = os.environ.get(VARIABLE)
    files = [Path(frame.f_code.co_filename) for frame, _ in traceback.walk_tb(error.__traceback__)]
    if not asked or not any("OpenGL" in file.parts or file.name == "gl_context.py" for file in files):
        return None
    return no_context(error)


def no_context(error: BaseException) -> NoOpenGLError:
    """An error that says what to do where there is no OpenGL context."""
    asked = os.environ.get(VARIABLE)
    named = f" of {VARIABLE}={asked}" if asked else ""
    remedy = f"Unset {VARIABLE}: what works is found without it" if asked else f"Install one: {REMEDY} "
    return NoOpenGLError(f"no OpenGL context{named} ({error}). {remedy} (`robocasa-lerobot doctor` checks it).")


def note_renderer() -> str:
    """The name of the renderer behind the current OpenGL context; announces a CPU that draws beside a GPU.

    Unlike a probe it says what really draws, whoever chose the backend.
    """
    global _used_renderer
    # Imported here: it binds to the backend that MuJoCo has loaded by now.
    from OpenGL import GL  # type: ignore[import-untyped]

    name = str(GL.glGetString(GL.GL_RENDERER).decode())
    _used_renderer = name
    announce(name)
    return name


def note_own_renderer() -> None:
    """Have `used_renderer` say that this process draws by our own code."""
    global _used_renderer
    _used_renderer = OWN_RENDERER


def announce_backend() -> None:
    """Try what renders, and announce it, in a process whose workers will render; costs half a second beside a GPU."""
    if has_gpu():
        found = probe(os.environ.get(VARIABLE) or "egl").renderer
        if found is not None:
            announce(found)


def used_renderer() -> str | None:
    """The name of the renderer that this process draws with; None before its first picture."""
    return _used_renderer


def announce(renderer: str) -> None:
    """Warn, once in a process, if `renderer` is software on a machine that has a GPU."""
    if is_software(renderer):
        _warn_of_cpu(renderer)


def _warn_of_cpu(why: str) -> None:
    """Warn, once in a process, that the CPU draws on a machine that has a GPU."""
    if why not in _announced and has_gpu():
        _announced.add(why)
        warnings.warn(
            f"pictures are drawn by the CPU ({why}) although this machine has a GPU: "
            f"slower. Install the vendor's OpenGL libraries: {NVIDIA_REMEDY} ({NVIDIA_CONTAINER_NOTE}).",
            SoftwareRenderingWarning,
            stacklevel=4,
        )


def _pin(device: int) -> None:
    """Set the device for MuJoCo's EGL display, which a process makes once."""
    if os.environ.get(DEVICE_VARIABLE) == str(device):
        return
    egl = sys.modules.get("mujoco.egl")
    if egl is not None and egl.EGL_DISPLAY is not None:
        present = os.environ.get(DEVICE_VARIABLE, "that EGL chose")
        raise RenderDeviceError(
            f"this process draws on device {present} already and cannot change to {device}. One process draws on one "
            "device: give it before the first picture, or use make_vector_env(..., devices=[...])."
        )
    os.environ[DEVICE_VARIABLE] = str(device)


if __name__ == "__main__":  # for shell scripts: `python -m robocasa_lerobot.gl` prints the backend, or fails
    try:
        print(ensure_gl())
    except NoOpenGLError as error:
        raise SystemExit(str(error)) from None
