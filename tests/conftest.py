"""Set-up shared by all tests: no network, a cache of their own, an OpenGL backend, and the folder of real input."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from task_sample import SAMPLE_VARIABLE, whose_turn

from robocasa_lerobot import gl

REPOSITORY = Path(__file__).parents[1]

# No deadlines (the machine may be busy), and the same examples in every run.
settings.register_profile("tests", deadline=None, derandomize=True, max_examples=50, database=None)
settings.load_profile("tests")


# Here and not when pytest is configured: where folders are given, their own conftests are imported before that, and
# with them what reads these when it is imported. The hub was then asked five times for each missing file (23 s).
_CACHE = tempfile.mkdtemp(prefix="robocasa_lerobot_tests_")
os.environ.update(HF_HOME=_CACHE, HF_HUB_OFFLINE="1", WANDB_MODE="disabled")
# Tiny networks: more threads only wait for each other (12 s became 150 s beside other work on two cores).
os.environ.setdefault("OMP_NUM_THREADS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--task-sample", metavar="TEXT", help="draw the fast tests' tasks by this (default: the commit)")
    parser.addoption("--in-turns", action="store_true", help="run a third of the costly tests, drawn as tasks are")


def pytest_report_collectionfinish() -> str | None:
    selection = sys.modules.get("task_selection")  # only where a test module asked for tasks: it loads all of them
    if selection is None:
        return None
    sample = os.environ[SAMPLE_VARIABLE]
    return f"tasks beside the usual ones: {', '.join(selection.drawn())}; again with --task-sample={sample}"


def _commit() -> str:
    git = ["git", "-C", str(REPOSITORY), "rev-parse", "--short=12", "HEAD"]
    return subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip() or "none"


def pytest_configure(config: pytest.Config) -> None:
    os.environ[SAMPLE_VARIABLE] = config.getoption("--task-sample") or _commit()


def pytest_unconfigure() -> None:
    shutil.rmtree(_CACHE, ignore_errors=True)


def pytest_collection_finish() -> None:
    # What the test modules have imported stays: millions of objects that every collection would walk through again,
    # which statsmodels asks for in each of its corrections.
    gc.freeze()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--in-turns"):
        costly = [item for item in items if item.get_closest_marker("costly")]
        later = set(costly) - set(whose_turn(costly, os.environ[SAMPLE_VARIABLE]))
        config.hook.pytest_deselected(items=[item for item in items if item in later])
        items[:] = [item for item in items if item not in later]
    rendering = [item for item in items if item.get_closest_marker("render")]
    if not rendering:
        return
    try:
        gl.ensure_gl()
    except gl.NoOpenGLError as error:
        if os.environ.get("CI"):
            pytest.exit(f"tests that render cannot be left out here: {error}", returncode=1)
        for item in rendering:
            item.add_marker(pytest.mark.skip(reason=str(error)))


@pytest.fixture(autouse=True)
def renderer_as_it_was() -> Iterator[None]:
    """A test on a pretended machine does not decide who draws in the next one."""
    before = os.environ.get(gl.RENDERER_VARIABLE)
    yield
    os.environ.pop(gl.RENDERER_VARIABLE, None)
    if before is not None:
        os.environ[gl.RENDERER_VARIABLE] = before


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of real input beside the checkout."""
    folder = REPOSITORY.parent / "shared"
    if not folder.is_dir():
        pytest.skip(f"no folder with real input: {folder.name}/ beside the checkout")
    return folder
