"""`inspect` of a registry: the paper's table of datasets and its two figures, of what lies on this machine."""

from __future__ import annotations

import itertools
import json
import re
import shutil
from pathlib import Path

import pytest
import yaml

from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.cli import main
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.registry.registry import open_registry
from robocasa_lerobot.evaluation.inventory.inventory import take_inventory
from robocasa_lerobot.evaluation.inventory.page import page


@pytest.fixture(scope="module")
def registry(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four pretraining demonstrations of two tasks in two kitchens, two target ones of one, and one lacking dataset."""
    folder = tmp_path_factory.mktemp("registry")
    write_fake_dataset(folder / "mine/both", episodes=4, length=6)
    write_fake_dataset(folder / "mine/OpenDrawer", episodes=2, length=4, tasks=("OpenDrawer",))
    shutil.rmtree(folder / "mine/OpenDrawer/meta/robocasa")  # as of another converter
    datasets = [
        {"path": "both", "tasks": ["OpenDrawer", "CloseDrawer"]},
        {"path": "OpenDrawer", "tasks": ["OpenDrawer"], "split": "target"},
        {"path": "lacking", "tasks": ["WashLettuce"], "split": "target"},
        {"path": "both", "views": "lerobot_cotraining_cams"},
    ]
    (folder / "own.yaml").write_text(yaml.safe_dump({"root": str(folder / "mine"), "datasets": datasets}))
    return folder / "own.yaml"


def test_tasks_scenes_demonstrations_and_hours_stand_beside_the_published_ones(
    registry: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", str(registry), "--report", "json"]) == 0
    pretrain, target, other_views = json.loads(capsys.readouterr().out)
    frames = 4 * 6
    assert (pretrain["tasks_with_data"], pretrain["tasks"], pretrain["scenes"]) == (2, 2, 2)
    assert (pretrain["demonstrations"], pretrain["hours"]) == (4, pytest.approx(frames / 20 / 3600))
    # No table of episodes: one task, its lengths, and no word about kitchens.
    assert (target["tasks_with_data"], target["tasks"], target["scenes"]) == (1, 2, None)
    assert (target["demonstrations"], target["seconds"]) == (2, [0.2, 0.2, 0.2])
    assert (other_views["tasks_with_data"], other_views["demonstrations"]) == (2, 4)

    assert main(["inspect", str(registry)]) == 0
    lines = [re.split(r"\s{2,}", line.strip()) for line in capsys.readouterr().out.splitlines()]
    rows = {line[0]: (line, after) for line, after in itertools.pairwise(lines)}
    ours, published = rows["pretrain, human"]
    assert ours[1:5] == ["2 of 2", "2", "4", "2"]
    assert published == ["published", "300", "2,500", "30,000", "100", "404"]
    assert rows["target, human"][1] == ["published", "50", "10", "25,000", "500", "208"]
    assert rows["pretrain, human, lerobot_cotraining_cams"][1][0] != "published"


def test_the_page_has_the_table_and_both_figures(registry: Path, tmp_path: Path) -> None:
    out = tmp_path / "data.html"
    assert main(["inspect", str(registry), "--out", str(out)]) == 0
    html = out.read_text()
    assert html.count("<svg") == 2
    for name in ("datasets-table", "stages-numbers", "lengths-numbers"):
        assert f'id="{name}"' in html
    assert "220 and 145 by the paper&#39;s text and 232 and 133" in html
    assert "from the datasets&#39; own tables" in html
    document = page("own", take_inventory(open_registry(str(registry))))
    stages = document.sections[1].parts[0].table  # type: ignore[union-attr]
    counts = {row[0].text: (row[1].value, row[2].value) for row in stages.rows}
    assert counts["1"] == (2, 65)
    assert sum(known for _, known in counts.values()) == len(task_facts())
    lengths = document.sections[1].parts[1].table  # type: ignore[union-attr]
    assert [cell.text for cell in lengths.rows[0][1:4]] == ["100.0"] * 3
    assert sum(float(row[-1].value or 0) for row in lengths.rows) == pytest.approx(100)


def test_the_published_registry_is_inspected_without_any_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", "robocasa365", "--out", "page.html"]) == 0
    assert "0 of 300" in capsys.readouterr().out
    assert (tmp_path / "page.html").is_file()


def test_mistakes_are_explained(registry: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, message in (
        ([str(registry), str(registry)], "inspected by itself"),
        ([str(registry), "--out", str(tmp_path / "a.svg")], "expected .html"),
        ([str(tmp_path / "nothing.hdf5"), "--out", "a.html"], "name its YAML file"),
        ([str(tmp_path / "nothing.yaml")], "nothing.yaml"),
    ):
        assert main(["inspect", *arguments]) == 2
        assert message in capsys.readouterr().err


def test_demonstrations_of_no_known_task_are_told(registry: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a dataset without a table of episodes the registry has to say the task."""
    content = yaml.safe_load(registry.read_text())
    content["datasets"] = [{"path": "OpenDrawer"}]
    other = registry.with_name("other.yaml")
    other.write_text(yaml.safe_dump(content))
    assert main(["inspect", str(other)]) == 2
    assert "says which episodes are of which task" in capsys.readouterr().err
