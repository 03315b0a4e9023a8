"""Several kitchens at once: Gymnasium's `AsyncVectorEnv` with one process, and so one OpenGL context, for each.

    with closing(make_vector_env("OpenDrawer", 4)) as envs:
        observations, infos = envs.reset(seed=0)

Observations travel through shared memory. A worker that raises, dies or hangs ends the whole vector env with a
`WorkerError` that says which worker, why, and in which task, episode and step; the other workers end cleanly.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from robocasa_lerobot import contract, gl
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.vector.env import KitchenVectorEnv, WorkerError
from robocasa_lerobot.envs.vector.worker import EnvFactory, FaultFile, Member
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.jobs.workers import cores_here

__all__ = ["KitchenVectorEnv", "WorkerError", "env_info", "make_vector_env"]

TIMEOUT_SECONDS = 300.0


def make_vector_env(
    task: str | EnvFactory | Sequence[str | EnvFactory],
    num_envs: int | None = None,
    *,
    devices: int | Sequence[int] | None = None,
    autoreset: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    context: str = "forkserver",
    timeout_seconds: float | None = TIMEOUT_SECONDS,
    copy: bool = True,
    **kitchen: Any,
) -> KitchenVectorEnv:
    """Kitchens in processes of their own, as one Gymnasium vector env.

    A script that calls this needs `if __name__ == "__main__":`, as with all of Python's process pools but `fork`.

    Args:
        task: a task's name or a callable that makes an env, or several of them, which are dealt out in turn.
        num_envs: number of envs; as many as there are tasks if None.
        devices: EGL devices that the workers render on, dealt out in turn (worker i on `devices[i % len(devices)]`).
            None leaves the choice to `MUJOCO_EGL_DEVICE_ID`, and without that to EGL, which gives all workers the
            first device. The numbers are EGL's, not CUDA's (see `gl`).
        autoreset: what follows the end of an episode. `NEXT_STEP` (default): the step's observation and info are the
            episode's last ones, and the env's next step ignores its action, resets and gives reward 0. `SAME_STEP`:
            the step already gives the next episode's first observation and info; the last ones are in
            `infos["final_obs"]` and `infos["final_info"]`. `DISABLED`: nothing; the caller resets with
            `options={"reset_mask": ...}`. The default, as it cannot be misread: no observation is replaced.
        context: "forkserver" or "spawn".
        timeout_seconds: a worker that gives no answer to one command for so long counts as hanging; None waits.
        copy: give each caller its own observations; False gives views into the shared memory, which the next step
            overwrites.
        kitchen: further arguments of `KitchenEnv`, for the envs that are given by a task's name.

    Raises:
        UserError: no env, or more tasks than envs.
        UnknownNameError: no such task, context, autoreset mode or argument of the kitchen.
        RenderDeviceError: no such render device.
        NoOpenGLError: nothing on this machine can render.
        WorkerError: a worker could not start.
    """
    tasks = [task] if isinstance(task, str) or callable(task) else list(task)
    count = len(tasks) if num_envs is None else num_envs
    if not tasks or count < len(tasks):
        raise UserError(f"{len(tasks)} tasks for {count} envs: expected at least one task, and an env for each.")
    if kitchen and not any(isinstance(one, str) for one in tasks):
        raise UserError(f"{', '.join(kitchen)}: arguments of the kitchen, but every env has a factory of its own.")
    if "render_device" in kitchen:
        raise UserError("render_device: in a vector env the devices are given together: devices=[...].")
    _check_arguments(kitchen)
    for one in tasks:
        if isinstance(one, str):
            get_task(one)  # a misspelt name fails here, and not in a worker
    # Envs without cameras run on machines that cannot render.
    drawing = bool(kitchen.get("cameras", contract.CAMERAS))
    numbers = _render_devices(devices, drawing)
    backend: str | None = None
    if devices is not None:
        backend = gl.ensure_gl()
    elif drawing:
        backend = gl.ensure_drawing()
    variables = _variables(count, drawing, backend is not None)
    members = []
    for index in range(count):
        one = tasks[index % len(tasks)]
        make = partial(KitchenEnv, one, **kitchen) if isinstance(one, str) else one
        label = one if isinstance(one, str) else getattr(one, "__name__", repr(one))
        device = numbers[index % len(numbers)] if numbers else None
        members.append(Member(make, label, backend if backend != "default" else None, device, FaultFile(), variables))
    return KitchenVectorEnv(members, _autoreset_mode(autoreset), context, timeout_seconds, copy)


def env_info(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """The info of one env, as that env gave it, out of a vector env's infos.

    Gymnasium stores each key's values in one array over the envs, nested dictionaries as dictionaries of arrays, and
    beside each key its mask `_key` of the envs that have it: tasks with different success terms share one
    `infos["success_terms"]`, where only the masks tell whose terms are whose.
    """
    found: dict[str, Any] = {}
    for key, value in infos.items():
        mask = infos.get(f"_{key}")
        if mask is None or not mask[index]:
            continue
        if isinstance(value, dict):
            found[key] = env_info(value, index)
        else:
            item = value[index]
            found[key] = item.item() if isinstance(item, np.generic) else item
    return found


def _autoreset_mode(mode: AutoresetMode | str) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    by_name = {known.name.lower(): known for known in AutoresetMode} | {known.value: known for known in AutoresetMode}
    if mode not in by_name and str(mode).lower() not in by_name:
        raise UnknownNameError("autoreset mode", str(mode), [known.name.lower() for known in AutoresetMode])
    return by_name.get(mode) or by_name[mode.lower()]


def _check_arguments(kitchen: dict[str, Any]) -> None:
    known = set(inspect.signature(KitchenEnv).parameters) - {"task", "render_device"}
    for name in kitchen:
        if name not in known:
            remedy = "A limit on the steps is `horizon`." if name == "max_episode_steps" else ""
            raise UnknownNameError("argument of the kitchen", name, known, remedy)


def _variables(workers: int, drawing: bool, opengl: bool) -> dict[str, str]:
    """What workers find in their environment: who draws, and with how many threads if they share the cores."""
    variables = {}
    if drawing or opengl:
        variables[gl.RENDERER_VARIABLE] = "opengl" if opengl else "cpu"
    if not os.environ.get("OMP_NUM_THREADS"):
        variables["OMP_NUM_THREADS"] = str(max(1, cores_here() // workers))
    return variables


def _render_devices(devices: int | Sequence[int] | None, drawing: bool) -> list[int]:
    """The devices to deal out, all of which exist; those of the environment variable if none are given.

    The variable may be there for other programs: it counts only where pictures are drawn, and by EGL.
    """
    if devices is None:
        inherited = os.environ.get(gl.DEVICE_VARIABLE)
        if inherited is None or not drawing or (os.environ.get(gl.VARIABLE) or "egl") != "egl":
            return []
        if not inherited.isdecimal():
            raise gl.RenderDeviceError(f"{gl.DEVICE_VARIABLE}: found {inherited!r}, expected a device's number.")
        devices = int(inherited)
    numbers = [devices] if isinstance(devices, int) else list(devices)
    if not numbers:
        raise UserError("devices: found an empty list, expected at least one device, or None for EGL's choice.")
    for number in numbers:
        gl.check_device(number)
    return numbers
