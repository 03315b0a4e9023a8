"""The commit that results name."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

import robocasa_lerobot
from robocasa_lerobot.provenance import git_commit


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository in which the package lies, with a page of results and one of a benchmark."""
    for name in ("robocasa_lerobot/__init__.py", "docs/results.md", "docs/results/a/about.json", "docs/scaling.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("before")
    for words in (["init"], ["add", "."], ["-c", "user.name=n", "-c", "user.email=e@e", "commit", "-m", "all"]):
        subprocess.run(["git", "-C", str(tmp_path), *words], check=True, capture_output=True)
    monkeypatch.setattr(robocasa_lerobot, "__file__", str(tmp_path / "robocasa_lerobot/__init__.py"))
    return tmp_path


def test_what_a_study_writes_as_it_goes_makes_no_clean_code_dirty(checkout: Path) -> None:
    ask = git_commit.__wrapped__  # what it found before is kept
    commit = ask()
    assert commit is not None
    assert len(commit) == 40
    for name in ("docs/results.md", "docs/results/a/about.json"):
        (checkout / name).write_text("after")
    assert ask() == commit
    (checkout / "docs/scaling.md").write_text("after")
    assert ask() == f"{commit}-dirty"
    assert ask("docs/scaling.md") == commit
