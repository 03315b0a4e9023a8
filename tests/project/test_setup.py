"""The set-up: the lock is complete and pinned by hash, and the search for a Python says what to do."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

REPOSITORY = Path(__file__).parents[2]
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
FIND_PYTHON = REPOSITORY / "scripts" / "find_python.sh"


def locked() -> dict[str, tuple[Version, int]]:
    """Name -> (version, number of hashes) of the lock's entries."""
    text = (REPOSITORY / "requirements.lock").read_text(encoding="utf-8")
    entries = re.split(r"\n(?=\S)", text.strip())
    parsed = [re.match(r"([A-Za-z0-9_.-]+)==([^\s;]+)", entry) for entry in entries]
    assert all(parsed), "an entry without a version"
    return {
        canonicalize_name(match[1]): (Version(match[2]), entry.count("--hash=sha256:"))
        for match, entry in zip(parsed, entries, strict=True)
        if match
    }


def wanted() -> list[str]:
    """Requirements of the package and its extras; that of `ray` has a lock of its own."""
    extras = {name: lines for name, lines in PROJECT["project"]["optional-dependencies"].items() if name != "ray"}
    return [*PROJECT["project"]["dependencies"], *(line for extra in extras.values() for line in extra)]


@pytest.mark.parametrize("requirement", wanted())
def test_every_requirement_is_locked_in_its_range(requirement: str) -> None:
    parsed = Requirement(requirement)
    version, _ = locked()[canonicalize_name(parsed.name)]
    assert parsed.specifier.contains(version), "run `make lock`"


def test_ray_is_locked_in_its_range() -> None:
    (requirement,) = PROJECT["project"]["optional-dependencies"]["ray"]
    lock = (REPOSITORY / "benchmarks" / "requirements" / "ray.lock").read_text(encoding="utf-8")
    (version,) = re.findall(r"^ray==(\S+)", lock, re.MULTILINE)
    assert Requirement(requirement).specifier.contains(version)


def test_every_locked_package_has_hashes() -> None:
    assert [name for name, (_, hashes) in locked().items() if hashes == 0] == []


def test_dependencies_have_a_reason() -> None:
    reasons = (REPOSITORY / "docs" / "decisions" / "0001-dependencies.md").read_text(encoding="utf-8").lower()
    missing = [r for r in wanted() if f"`{Requirement(r).name.lower()}" not in reasons]
    assert [name for name in missing if not name.startswith("types-")] == []


def find_python(**environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["/bin/sh", str(FIND_PYTHON)], env=environment, capture_output=True, text=True, timeout=60, check=False
    )


def test_a_named_python_is_taken(tmp_path: Path) -> None:
    done = find_python(PYTHON=sys.executable, PATH="", HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).samefile(sys.executable)


def test_a_named_python_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    done = find_python(PYTHON="/bin/false", PATH="", HOME=str(tmp_path))
    assert (done.returncode, done.stdout) == (1, "")
    assert "PYTHON=/bin/false" in done.stderr


def test_inactive_shims_and_old_versions_are_passed_over(tmp_path: Path) -> None:
    """A shim on the PATH that fails is no Python; the next place is pyenv's folder."""
    shims, version = tmp_path / "shims", tmp_path / "pyenv" / "versions" / "3.12.99" / "bin"
    for folder in (shims, version):
        folder.mkdir(parents=True)
    for name in ("python3.12", "python3.13", "python3.14", "python3", "python"):
        (shims / name).write_text("#!/bin/sh\nexit 127\n")
        (shims / name).chmod(0o755)
    (version / "python").symlink_to(sys.executable)
    done = find_python(PATH=str(shims), PYENV_ROOT=str(tmp_path / "pyenv"), HOME=str(tmp_path))
    assert (done.returncode, done.stdout.strip()) == (0, str(version / "python")), done.stderr


def test_without_any_python_it_says_what_to_do(tmp_path: Path) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    (tools / "cat").symlink_to("/bin/cat")
    done = find_python(PATH=str(tools), HOME=str(tmp_path))
    assert (done.returncode, done.stdout) == (1, "")
    for remedy in ("apt-get install", "pyenv install 3.12", "uv python install 3.12", "make PYTHON="):
        assert remedy in done.stderr


def test_help_lists_every_target() -> None:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    done = subprocess.run(
        ["make", "--no-print-directory", "help"],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)
    assert phony is not None
    for target in phony[1].split():
        assert f"make {target} " in done.stdout


def test_what_is_always_installed_is_never_skipped() -> None:
    """A module of ours, or of what we stand on, that does not import is a failure, no reason to leave tests out."""
    names = {Requirement(line).name.replace("-", "_") for line in PROJECT["project"]["dependencies"]}
    skipping = re.compile(r"""importorskip\(\s*["'](\w+)""")
    found = {
        f"{path.relative_to(REPOSITORY)}: {name}"
        for path in (REPOSITORY / "tests").rglob("*.py")
        for name in skipping.findall(path.read_text(encoding="utf-8"))
        if name in names | {"robocasa_lerobot"}
    }
    assert not found
