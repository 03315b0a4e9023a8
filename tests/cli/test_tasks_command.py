"""`robocasa-lerobot tasks`: filters, pages, pictures; and that the page in `docs/` is that of the declarations."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from robocasa_lerobot import cli
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.typical import stages_of
from robocasa_lerobot.gallery.task_pages import DEMONSTRATOR, page, pages

DOCS = Path(__file__).parents[2] / "docs" / "tasks.md"
TASKS = [get_task(name) for name in task_names()]


def _lines(text: str) -> list[str]:
    """Without those about demonstrators, of which every new skill changes one."""
    return [line for line in text.splitlines() if not line.startswith(f"- {DEMONSTRATOR}")]


def test_the_page_is_current() -> None:
    assert _lines(DOCS.read_text(encoding="utf-8")) == _lines(pages(TASKS)), "run `make docs`"


@pytest.mark.slow
def test_the_page_names_the_demonstrators_that_there_are() -> None:
    assert DOCS.read_text(encoding="utf-8") == pages(TASKS), "run `make docs`"


@pytest.mark.parametrize("name", task_names())
def test_a_page_has_everything(name: str) -> None:
    task = get_task(name)
    text = "\n".join(page(task))
    for said in (task.instruction, task.summary, *task.paraphrases, *(f.role for f in task.fixtures), *task.facts.sets):
        assert said in text
    assert all(wanted.name in text for wanted in task.objects)
    assert f"{task.horizon} steps" in text
    assert (f"{DEMONSTRATOR}yes" in text) == can_demonstrate(task)
    assert text.count("`: ") >= 1  # a term of the goal
    assert "inf" not in text.replace("information", "").split()


def _listed(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[str]:
    assert cli.main(["tasks", *arguments, "--json"]) == 0
    return [task["name"] for task in json.loads(capsys.readouterr().out)]


def test_filters(capsys: pytest.CaptureFixture[str]) -> None:
    assert _listed(capsys) == list(task_names())
    drawers = _listed(capsys, "--skill", "drawers")
    assert {"OpenDrawer", "CloseDrawer"} <= set(drawers)
    assert all("drawers" in {stage.skill for stage in stages_of(get_task(name))} for name in drawers)
    assert _listed(capsys, "--set", "atomic_seen", "--fixture", "drawer_top", "--skill", "drawers") == ["OpenDrawer"]
    able, unable = _listed(capsys, "--demonstrated"), [t.name for t in TASKS if not can_demonstrate(t)]
    assert sorted((*able, *unable)) == list(task_names())
    assert cli.main(["tasks", "--skill", "drawer"]) == 2
    assert "'drawers'" in capsys.readouterr().err
    assert cli.main(["tasks", "OpenDrawer", "--skill", "knobs"]) == 2
    assert "leave one out" in capsys.readouterr().err


def test_one_task_is_described_and_many_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["tasks", "OpenDrawer"]) == 0
    assert "`drawer_open`" in capsys.readouterr().out
    assert cli.main(["tasks", "OpenDrawer", "CloseDrawer"]) == 0
    assert "2 tasks, 2 with a demonstrator" in capsys.readouterr().out
    assert cli.main(["tasks", "--pictures", "many.png"]) == 2
    assert "name one" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.render
def test_pictures_of_the_first_and_the_last_state(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "drawer.png"
    assert cli.main(["tasks", "OpenDrawer", "--pictures", str(out)]) == 0
    assert "done" in capsys.readouterr().out
    with Image.open(out) as picture:
        width, height = picture.size
        first, last = picture.crop((0, 26, 480, height // 2)), picture.crop((0, height // 2 + 26, 480, height))
        assert width == 480 + 3 * 320
        assert first.tobytes() != last.tobytes()
    assert cli.main(["tasks", "OpenDrawer", "--pictures", str(tmp_path / "drawer.gif")]) == 2
