"""The scripts of the repository.

That of the fast tests runs every folder in one of its two parts, and tells a failure of either; that of the demo needs
no OpenGL.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from source_tree import REPOSITORY

PYTEST = """#!/bin/sh
# Stands in for Python: notes what pytest was asked for, and fails where it is told to.
shift 2
echo "$*" >> "$NOTES"
case " $* " in *" $FAILS "*) echo "bad in $*"; exit 1 ;; esac
echo "good"
"""

FIRST_STEP = """#!/bin/sh
# Stands in for Python: notes who draws at the first command, and ends there.
case " $* " in *" robocasa_lerobot.cli "*)
    echo "${MUJOCO_GL:-} ${ROBOCASA_LEROBOT_RENDERER:-} $*" > "$NOTES"; exit 7 ;;
esac
exec "$REAL" "$@"
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A copy of the script and of the folders of tests, without their files."""
    (tmp_path / "scripts").mkdir()
    shutil.copy(REPOSITORY / "scripts" / "test.sh", tmp_path / "scripts")
    for folder in (REPOSITORY / "tests").iterdir():
        if folder.is_dir():
            (tmp_path / "tests" / folder.name).mkdir(parents=True)
    (tmp_path / "python").write_text(PYTEST)
    (tmp_path / "python").chmod(0o755)
    return tmp_path


def run(checkout: Path, *arguments: str, fails: str = "nothing", cores: str = "2") -> tuple[int, str, list[str]]:
    (checkout / "bin").mkdir(exist_ok=True)
    (checkout / "bin" / "getconf").write_text(f"#!/bin/sh\necho {cores}\n")
    (checkout / "bin" / "getconf").chmod(0o755)
    notes = checkout / "notes"
    notes.unlink(missing_ok=True)
    environment = {
        **os.environ, "PYTHON": str(checkout / "python"), "NOTES": str(notes), "FAILS": fails,
        "PATH": f"{checkout / 'bin'}{os.pathsep}{os.environ['PATH']}",
    }  # fmt: skip
    done = subprocess.run(
        ["sh", str(checkout / "scripts" / "test.sh"), *arguments],
        capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, notes.read_text().splitlines()


def test_every_folder_of_tests_is_run_once(checkout: Path) -> None:
    (checkout / "tests" / "new").mkdir()
    status, _, calls = run(checkout)
    assert all(call.startswith("--in-turns ") for call in calls), "of the costly tests a third"
    asked = sorted(word for call in calls for word in call.split()[1:])
    folders = [f"tests/{path.name}" for path in (checkout / "tests").iterdir()]
    assert status == 0
    assert len(calls) == 2
    assert asked == sorted(set(folders) - {"tests/support", "tests/__pycache__"})


@pytest.mark.parametrize("fails", ["tests/envs", "tests/convert"])
def test_a_failure_of_either_part_is_one_of_the_whole(checkout: Path, fails: str) -> None:
    status, said, _ = run(checkout, fails=fails)
    assert status == 1
    assert "bad in" in said
    assert "good" in said


def test_what_is_asked_for_is_run_by_itself(checkout: Path) -> None:
    assert run(checkout, "tests/envs", "-x")[2] == ["tests/envs -x"]
    assert run(checkout, cores="1")[2] == ["--in-turns"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have OpenGL")
@pytest.mark.parametrize(("asked", "noted"), [("", " cpu -m"), ("osmesa", "osmesa  -m")])
def test_the_demo_starts_on_a_machine_without_opengl(tmp_path: Path, asked: str, noted: str) -> None:
    """As the kitchens do, which it makes; a backend that is asked for stays."""
    python, notes = tmp_path / "python", tmp_path / "notes"
    python.write_text(FIRST_STEP)
    python.chmod(0o755)
    chosen = {"MUJOCO_GL", "ROBOCASA_LEROBOT_RENDERER", "MUJOCO_EGL_DEVICE_ID", "HF_HOME"}
    environment = {
        **{name: value for name, value in os.environ.items() if name not in chosen}, "PYTHON": str(python),
        "REAL": sys.executable, "NOTES": str(notes), "MUJOCO_GL": asked, "PYTHONPATH": str(REPOSITORY),
        "__EGL_VENDOR_LIBRARY_FILENAMES": str(tmp_path / "no_vendor.json"),
    }  # fmt: skip
    done = subprocess.run(
        ["sh", str(REPOSITORY / "scripts" / "demo.sh")],
        cwd=tmp_path, capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip
    assert done.returncode == 7, done.stderr
    assert notes.read_text().startswith(f"{noted} robocasa_lerobot.cli demos --tasks OpenDrawer --episodes 280 ")
