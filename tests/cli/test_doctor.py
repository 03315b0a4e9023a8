"""The doctor: each failure is forced once and comes with the one thing that mends it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
import torch

from robocasa_lerobot import cli, gl
from robocasa_lerobot.cli import doctor
from robocasa_lerobot.cli.doctor import Finding

SOFTWARE = gl.GLProbe("egl", "llvmpipe (LLVM 15.0.6, 256 bits)")
HARDWARE = gl.GLProbe("egl", "NVIDIA H200/PCIe/SSE2")
BROKEN = gl.GLProbe("egl", None, "ImportError: Cannot initialize a EGL device display.")


def no_gpu() -> bool:
    return False


def one_gpu() -> bool:
    return True


def no_torchcodec() -> None:
    raise RuntimeError("Could not load libtorchcodec")


def discovery(stdout: str, stderr: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.CompletedProcess([], 0, stdout, stderr)


@pytest.fixture(autouse=True)
def _no_choice_of_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(gl.VARIABLE, raising=False)


FORCED: dict[str, tuple[Finding, str, str]] = {
    "old Python": (doctor.check_python((3, 11, 9)), "fault", "make PYTHON="),
    "full disk": (doctor.check_disk(free_bytes=2**30), "fault", "outputs/demo"),
    "little memory": (doctor.check_memory(total_bytes=2 * 2**30), "warning", "batch sizes"),
    "old LeRobot": (doctor.check_lerobot("0.4.0"), "fault", "make setup"),
    "no ffmpeg": (doctor.check_torchcodec(no_torchcodec), "warning", "apt-get install --yes ffmpeg"),
    "no plugins": (doctor.check_plugins(lambda: discovery("types: aloha act")), "fault", "make setup"),
}


@pytest.mark.parametrize("case", FORCED)
def test_failure_has_a_remedy(case: str) -> None:
    finding, status, remedy = FORCED[case]
    assert finding.status == status
    assert remedy in finding.remedy


def test_no_opengl() -> None:
    asked: list[str] = []

    def probe(backend: str) -> gl.GLProbe:
        asked.append(backend)
        return gl.GLProbe(backend, None, "ImportError: nothing")

    for on_cpu, status in ((False, "fault"), (True, "warning")):  # our own code draws most of it
        asked.clear()
        finding = doctor.check_opengl(probe, no_gpu, lambda on_cpu=on_cpu: on_cpu)
        assert (finding.status, finding.remedy) == (status, gl.REMEDY)
        assert asked == ["egl", "osmesa"]
    assert "egl: ImportError" in finding.found
    assert "osmesa: ImportError" in finding.found


def test_osmesa_is_good_enough() -> None:
    finding = doctor.check_opengl(lambda b: BROKEN if b == "egl" else gl.GLProbe(b, "llvmpipe"), no_gpu)
    assert finding.status == "ok"
    assert finding.found.startswith("osmesa: llvmpipe")


def test_software_rendering_beside_a_gpu_is_a_warning() -> None:
    assert doctor.check_opengl(lambda b: SOFTWARE, one_gpu).status == "warning"
    assert doctor.check_opengl(lambda b: SOFTWARE, no_gpu).status == "ok"
    assert doctor.check_opengl(lambda b: HARDWARE, one_gpu).status == "ok"


def test_who_draws_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(gl.RENDERER_VARIABLE, raising=False)
    assert doctor.check_pictures(lambda: True).found == "drawn by our own code on the CPU"
    assert doctor.check_pictures(lambda: False).found == "drawn by OpenGL"
    monkeypatch.setenv(gl.RENDERER_VARIABLE, "opengl")
    assert doctor.check_pictures().found == f"drawn by OpenGL, by {gl.RENDERER_VARIABLE}"


def test_render_devices_are_listed_with_both_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    found = (gl.RenderDevice(0, "NVIDIA H200", 3, False), gl.RenderDevice(1, "", None, True))
    monkeypatch.delenv(gl.DEVICE_VARIABLE, raising=False)
    assert doctor.check_render_devices(lambda: found).found == "0: NVIDIA H200 (CUDA 3), 1: the CPU"
    for chosen, status in (("1", "ok"), ("2", "fault"), ("first", "fault")):
        monkeypatch.setenv(gl.DEVICE_VARIABLE, chosen)
        assert doctor.check_render_devices(lambda: found).status == status


def test_a_backend_that_was_asked_for_and_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gl.VARIABLE, "osmesa")
    finding = doctor.check_opengl(lambda b: gl.GLProbe(b, None, "no library"), no_gpu)
    assert finding.status == "fault"
    assert finding.remedy == "unset MUJOCO_GL"


def test_cache_that_cannot_be_written(tmp_path: Path) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    finding = doctor.check_cache(in_the_way / "cache")
    assert finding.status == "fault"
    assert "HF_HOME" in finding.remedy
    assert doctor.check_cache(tmp_path / "new" / "cache").status == "ok"


@pytest.mark.parametrize(
    ("built", "found", "remedy"), [(None, "without CUDA", "make setup"), ("13.0", "cannot use it", "CUDA 13.0")]
)
def test_a_gpu_that_torch_cannot_use(
    built: str | None, found: str, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(torch.version, "cuda", built)
    monkeypatch.setattr(gl, "has_gpu", one_gpu)
    finding = doctor.check_gpu()
    assert finding.status == "warning"
    assert found in finding.found
    assert remedy in finding.remedy
    assert ("nvidia-smi" in finding.remedy) == (built is not None)


def test_plugin_failure_shows_its_reason() -> None:
    done = discovery("types: act", "ERROR:root:Could not import third-party plugin\nImportError: no module x\n")
    assert "ImportError: no module x" in doctor.check_plugins(lambda: done).found


def test_plugins_that_a_backend_keeps_from_importing_are_no_matter_of_the_setup(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(gl.VARIABLE, "nonsense")  # with which MuJoCo ends its own import
    assert doctor.check_plugins(lambda: discovery("types: aloha act")).remedy == "unset MUJOCO_GL"


def test_a_check_that_breaks_is_a_fault_and_not_a_crash() -> None:
    def check_something() -> Finding:
        raise ImportError("No module named 'torch'")

    finding = doctor.examine(check_something)
    assert (finding.name, finding.status, finding.remedy) == ("something", "fault", "make setup")
    assert "No module named 'torch'" in finding.found


def test_this_machine_is_named_in_full(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "CHECKS", tuple(c for c in doctor.CHECKS if c is not doctor.check_plugins))
    status = cli.main(["doctor", "--json"])
    findings = [Finding(**finding) for finding in json.loads(capsys.readouterr().out)]
    assert len(findings) == len(doctor.CHECKS)
    assert status == int(any(finding.status == "fault" for finding in findings))
    for finding in findings:
        assert bool(finding.remedy) == (finding.status != "ok"), finding


def test_exit_status_and_table(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for finding, status in [
        (Finding("disk", "ok", "9 GiB"), 0),
        (Finding("disk", "warning", "6 GiB", "make clean"), 0),
        (Finding("disk", "fault", "1 GiB", "make clean"), 1),
    ]:
        monkeypatch.setattr(doctor, "CHECKS", (lambda finding=finding: finding,))
        assert cli.main(["doctor"]) == status
        shown = capsys.readouterr().out
        assert finding.found in shown
        assert ("mend: make clean" in shown) == (finding.status != "ok")


def test_no_backend_at_all_tells_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl, "probe", lambda backend: gl.GLProbe(backend, None, "nothing"))
    with pytest.raises(gl.NoOpenGLError, match="apt-get install"):
        gl.ensure_gl()


def test_a_choice_that_was_made_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(gl.VARIABLE, "glfw")
    assert gl.ensure_gl() == "glfw"


def test_probe_of_an_impossible_backend_names_the_failure() -> None:
    result = gl.probe("windowless-dreams")
    assert result.renderer is None
    assert "windowless-dreams" in result.failure


@pytest.mark.render
def test_choice_binds_mujoco_even_after_its_import(monkeypatch: pytest.MonkeyPatch) -> None:
    code = """
import mujoco, os
from robocasa_lerobot.gl import ensure_gl
chosen = ensure_gl()
assert os.environ["MUJOCO_GL"] == chosen
assert mujoco.GLContext.__module__ == f"mujoco.{chosen}", mujoco.GLContext
with mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8) as renderer:
    assert renderer.render().shape == (8, 8, 3)
"""
    done = subprocess.run([doctor.sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
