"""`docs/deviations.md`: what differs from the published tasks, with its reason, and how many kitchens admit a task."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.envs.kitchens.splits import scene_ids
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.gallery.deviations import FEW, admitted, deviations, explained, kitchens

DOCS = Path(__file__).parents[2] / "docs" / "deviations.md"
ROW = re.compile(r"\| \[(\w+)\]\(tasks\.md#(\w+)\) \| (\d+) of (\d+) \| (\d+) of (\d+) \| (.*) \|")


def _rows() -> dict[str, re.Match[str]]:
    rows = [line for line in DOCS.read_text(encoding="utf-8").splitlines() if line.startswith("| [")]
    found = {row.group(1): row for row in map(ROW.fullmatch, rows) if row is not None}
    assert len(found) == len(rows)
    return found


def test_every_difference_stands_there() -> None:
    said = {name: row.group(7) for name, row in _rows().items()}
    assert set(said) <= set(task_names()), "run `make docs`"
    for name in task_names():
        assert said.get(name, "") == explained(get_task(name)), "run `make docs`"


def test_what_few_kitchens_admit_says_why() -> None:
    for row in _rows().values():
        numbers = list(map(int, row.groups()[2:6]))
        for admits, of in (numbers[:2], numbers[2:]):
            assert admits > 0
            assert Fraction(admits, of) >= FEW or row.group(7), row.group(1)


def test_a_kitchen_of_each_layout_is_asked() -> None:
    assert kitchens("target") == list(scene_ids("target"))
    pretrain = kitchens("pretrain")
    assert [layout for layout, _ in pretrain] == sorted({layout for layout, _ in scene_ids("pretrain")})
    assert len({style for _, style in pretrain}) == len(pretrain), "styles in turn"


def test_fewer_kitchens_admit_what_needs_more() -> None:
    everywhere, rare = (admitted(get_task(name), "target") for name in ("CloseDrawer", "OpenOven"))
    assert everywhere.share == 1
    assert 0 < rare.share < 1


@pytest.mark.costly
def test_the_command_writes_the_page(tmp_path: Path) -> None:
    names = ["OpenOven", "OpenDishwasher"]
    assert cli.main(["tasks", *names, "--deviations", str(tmp_path / "new" / "page.md"), "--workers=2"]) == 0
    text = (tmp_path / "new" / "page.md").read_text(encoding="utf-8")
    assert text == deviations([get_task(name) for name in sorted(names)])
    assert "| [OpenOven](tasks.md#openoven) | " in text


def test_what_differs_in_many_tasks_is_current_and_tells_of_the_instructions() -> None:
    beginning = deviations([])
    assert "\n- Instructions: " in beginning
    assert DOCS.read_text(encoding="utf-8").startswith(beginning), "run `make docs`"


@pytest.mark.slow
def test_the_page_is_current() -> None:
    assert DOCS.read_text(encoding="utf-8") == deviations(map(get_task, task_names())), "run `make docs`"
