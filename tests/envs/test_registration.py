"""What importing the package tells Gymnasium, and what it leaves for later."""

from __future__ import annotations

import subprocess
import sys

import gymnasium
import pytest

from robocasa_lerobot import envs

SAY_LOADED = """
import importlib, sys
importlib.import_module(sys.argv[1])
print(*(name for name in sys.modules if name.startswith("robocasa_lerobot.envs.")))
"""


def test_gymnasium_knows_every_task() -> None:
    names = {name.partition("/")[2] for name in gymnasium.registry if name.startswith(f"{envs.NAMESPACE}/")}
    assert names == set(envs.task_names())


def test_a_name_that_the_package_does_not_have() -> None:
    with pytest.raises(AttributeError, match="get_tasks"):
        envs.get_tasks  # type: ignore[attr-defined] # noqa: B018


@pytest.mark.parametrize("module", ["robocasa_lerobot.envs.rendering", "robocasa_lerobot.convert.render"])
def test_what_only_draws_imports_no_task(module: str) -> None:
    said = subprocess.run([sys.executable, "-c", SAY_LOADED, module], capture_output=True, text=True, check=True)
    loaded = said.stdout.split()
    assert "robocasa_lerobot.envs.rendering" in loaded
    needless = tuple(
        f"robocasa_lerobot.envs.{room}" for room in ("tasks", "scene", "kitchens", "objects", "predicates")
    )
    assert [name for name in loaded if name.startswith(needless)] == []
