"""`robocasa-lerobot doctor`: what this machine has, what it lacks, and the one command that mends each failure."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from robocasa_lerobot import gl
from robocasa_lerobot.jobs.workers import memory_bytes
from robocasa_lerobot.policies.registry import POLICY_TYPES

EXAMPLE = "robocasa-lerobot doctor --json"

PYTHON = (3, 12)
LEROBOT = "0.6.1"
FREE_DISK_GIB = 5.0  # a demo run needs about 1 GiB; datasets and checkpoints of a small study the rest
MEMORY_GIB = 6.0  # training of the small policy beside two kitchens
ENCODERS = ("libx264", "libsvtav1")  # what we write, and what LeRobot's own datasets are written with
DISCOVERY_TIMEOUT_S = 300

Status = Literal["ok", "warning", "fault"]
SYMBOLS: dict[Status, str] = {"ok": "ok", "warning": "warning", "fault": "FAULT"}


@dataclass(frozen=True)
class Finding:
    """What one check found; `remedy` is the command (or the one step) that mends it, empty where nothing is wrong."""

    name: str
    status: Status
    found: str
    remedy: str = ""


def check_python(version: tuple[int, int, int] | None = None) -> Finding:
    """Python is new enough."""
    version = version or sys.version_info[:3]
    found = ".".join(map(str, version))
    if version[:2] < PYTHON:
        return Finding("Python", "fault", f"{found}, needs >= 3.12", "make PYTHON=/path/to/python3.12 setup")
    return Finding("Python", "ok", found)


def check_pictures(on_cpu: Callable[[], bool] = gl.draws_on_cpu) -> Finding:
    """Who draws what cameras see."""
    asked = os.environ.get(gl.RENDERER_VARIABLE)
    why = f", by {gl.RENDERER_VARIABLE}" if asked else ""
    return Finding("pictures", "ok", ("drawn by our own code on the CPU" if on_cpu() else "drawn by OpenGL") + why)


def check_opengl(
    probe: Callable[[str], gl.GLProbe] = gl.probe,
    has_gpu: Callable[[], bool] = gl.has_gpu,
    on_cpu: Callable[[], bool] = gl.draws_on_cpu,
) -> Finding:
    """A backend really renders: the one in `MUJOCO_GL`, else EGL, else OSMesa."""
    asked = os.environ.get(gl.VARIABLE)
    results = []
    for backend in (asked,) if asked else gl.HEADLESS_BACKENDS:
        results.append(probe(backend))
        if results[-1].renderer is not None:
            break
    last = results[-1]
    if last.renderer is None:
        failures = "; ".join(f"{r.backend}: {r.failure}" for r in results)
        if on_cpu() and not asked:
            lacking = "shadows (--preset quality), depth, segmentation, views from above and driving by hand (teleop)"
            found = f"{failures}; without it no {lacking}"
            return Finding("OpenGL", "warning", found, gl.REMEDY)
        return Finding("OpenGL", "fault", failures, f"unset {gl.VARIABLE}" if asked else gl.REMEDY)
    found = f"{last.backend}: {last.renderer}"
    if last.software and has_gpu():
        remedy = f"{gl.NVIDIA_REMEDY}  ({gl.NVIDIA_CONTAINER_NOTE})"
        return Finding("OpenGL", "warning", f"{found}; drawn by the CPU although there is a GPU", remedy)
    return Finding("OpenGL", "ok", found + (" (drawn by the CPU)" if last.software else ""))


def check_render_devices(devices: Callable[[], tuple[gl.RenderDevice, ...]] = gl.render_devices) -> Finding:
    """What EGL can draw on, with the numbers that `render_devices` and `MUJOCO_EGL_DEVICE_ID` count in."""
    found = devices()
    chosen = os.environ.get(gl.DEVICE_VARIABLE)
    listed = ", ".join(map(str, found)) or "EGL lists none"
    if chosen is not None and chosen not in {str(device.index) for device in found}:
        return Finding(
            "render devices", "fault", f"{listed}; {gl.DEVICE_VARIABLE}={chosen}", f"unset {gl.DEVICE_VARIABLE}"
        )
    return Finding("render devices", "ok", listed)


def check_video() -> Finding:
    """PyAV, which brings its own ffmpeg libraries, has the encoders that datasets are written with."""
    try:
        import av
    except ImportError as error:
        return Finding("video (PyAV)", "fault", str(error), "make setup")
    missing = [name for name in ENCODERS if name not in av.codecs_available]
    if missing:
        return Finding("video (PyAV)", "fault", f"{av.__version__} lacks {', '.join(missing)}", "make setup")
    return Finding("video (PyAV)", "ok", f"{av.__version__} with {', '.join(ENCODERS)}")


def check_torchcodec(import_torchcodec: Callable[[], None] | None = None) -> Finding:
    """Torchcodec finds the system's ffmpeg libraries; without them videos are read with PyAV, only more slowly."""
    try:
        (import_torchcodec or _import_torchcodec)()
    except Exception:  # it raises RuntimeError, OSError or ImportError, depending on the missing part
        remedy = "apt-get install --yes ffmpeg"
        return Finding(
            "ffmpeg", "warning", "no system libraries: videos are read with PyAV instead of torchcodec", remedy
        )
    return Finding("ffmpeg", "ok", "torchcodec loads the system's libraries")


def _import_torchcodec() -> None:
    import torchcodec.decoders  # noqa: F401


def check_gpu() -> Finding:
    """Torch sees the GPU, if there is one."""
    import torch

    if torch.cuda.is_available():
        names = [torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count())]
        return Finding("GPU", "ok", ", ".join(names))
    if gl.has_gpu():
        if torch.version.cuda is None:
            remedy = "rm -r .venv && make setup  (its torch is built for CUDA)"
            return Finding("GPU", "warning", "there is one, but torch was built without CUDA", remedy)
        remedy = "nvidia-smi  (names the driver's fault; torch needs a driver for CUDA " + str(torch.version.cuda) + ")"
        return Finding("GPU", "warning", "there is one, but torch cannot use it", remedy)
    return Finding("GPU", "ok", "none: the small presets train on the CPU")


def check_disk(folder: Path | None = None, free_bytes: int | None = None) -> Finding:
    """There is room where outputs are written (the working folder)."""
    folder = folder or Path.cwd()
    free_gib = (shutil.disk_usage(folder).free if free_bytes is None else free_bytes) / 2**30
    found = f"{free_gib:.0f} GiB free in the working folder"
    if free_gib < FREE_DISK_GIB:
        remedy = "rm -r outputs/demo  (or work on another disk)"
        return Finding("disk", "fault", f"{found}, needs {FREE_DISK_GIB:.0f}", remedy)
    return Finding("disk", "ok", found)


def check_memory(total_bytes: int | None = None) -> Finding:
    """There is memory for training beside two kitchens."""
    if total_bytes is None:
        total_bytes = memory_bytes()
    total_gib = total_bytes / 2**30
    found = f"{total_gib:.0f} GiB"
    if total_gib < MEMORY_GIB:
        remedy = "lower training batch sizes and the number of parallel kitchens"
        return Finding("memory", "warning", f"{found}, {MEMORY_GIB:.0f} are comfortable", remedy)
    return Finding("memory", "ok", found)


def check_cache(folder: Path | None = None) -> Finding:
    """The folder where Hugging Face libraries keep what they read can be written."""
    if folder is None:
        from huggingface_hub.constants import HF_HOME

        folder = Path(HF_HOME)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return Finding("cache", "fault", f"cannot write {folder}: {error.strerror}", "export HF_HOME=$PWD/outputs/hf")
    return Finding("cache", "ok", f"{folder} can be written")


def check_lerobot(version: str | None = None) -> Finding:
    """The version of LeRobot that this project is written for."""
    try:
        version = version or importlib.metadata.version("lerobot")
    except importlib.metadata.PackageNotFoundError:
        return Finding("LeRobot", "fault", "not installed", "make setup")
    if version != LEROBOT:
        return Finding("LeRobot", "fault", f"{version}, needs {LEROBOT}", "make setup")
    return Finding("LeRobot", "ok", version)


_DISCOVERY = """
from lerobot.utils.import_utils import register_third_party_plugins
register_third_party_plugins()
from lerobot.configs.policies import PreTrainedConfig
from lerobot.envs.configs import EnvConfig
print("types:", *EnvConfig.get_known_choices(), *PreTrainedConfig.get_known_choices())
"""
OUR_TYPES = ("robocasa_kitchen", *POLICY_TYPES)


def check_plugins(run: Callable[[], subprocess.CompletedProcess[str]] | None = None) -> Finding:
    """LeRobot's own commands find our env and policy types (asked in a fresh process, as those commands would)."""
    done = (run or _run_discovery)()
    types = next((line.split()[1:] for line in done.stdout.splitlines() if line.startswith("types:")), [])
    missing = [name for name in OUR_TYPES if name not in types]
    if missing:
        lines = [line.strip() for line in done.stderr.splitlines() if "robocasa" in line.lower() or "Error" in line]
        found = f"LeRobot does not find {', '.join(missing)}" + (f": {lines[-1]}" if lines else "")
        asked = os.environ.get(gl.VARIABLE)
        unset = asked and gl.probe(asked).renderer is None  # MuJoCo does not import, and so neither do our plugins
        return Finding("plugins", "fault", found, f"unset {gl.VARIABLE}" if unset else "make setup")
    return Finding("plugins", "ok", f"LeRobot finds {', '.join(OUR_TYPES)}")


def _run_discovery() -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", _DISCOVERY], capture_output=True, text=True, timeout=DISCOVERY_TIMEOUT_S, check=False
    )


CHECKS: tuple[Callable[[], Finding], ...] = (
    check_python,
    check_pictures,
    check_opengl,
    check_render_devices,
    check_video,
    check_torchcodec,
    check_gpu,
    check_disk,
    check_memory,
    check_cache,
    check_lerobot,
    check_plugins,
)


def examine(check: Callable[[], Finding]) -> Finding:
    """The finding of a check; one that breaks (a package that does not import) is a fault of the set-up."""
    try:
        return check()
    except Exception as error:
        name = check.__name__.removeprefix("check_")
        return Finding(name, "fault", f"{type(error).__name__}: {error}", "make setup")


def table(findings: list[Finding]) -> str:
    """The findings as text, one line each, and under each one that is not ok the command that mends it."""
    width = max(len(finding.name) for finding in findings)
    lines = []
    for finding in findings:
        lines.append(f"{SYMBOLS[finding.status]:<8} {finding.name:<{width}}  {finding.found}")
        if finding.remedy:
            lines.append(f"{'':<8} {'':<{width}}  mend: {finding.remedy}")
    return "\n".join(lines)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options of `doctor`."""
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(args: argparse.Namespace) -> int:
    """Run all checks and print them; 1 if one is a fault, else 0."""
    findings = [examine(check) for check in CHECKS]
    if args.json:
        print(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        print(table(findings))
    return int(any(finding.status == "fault" for finding in findings))
