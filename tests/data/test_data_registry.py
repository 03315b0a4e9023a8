"""Which datasets a mixture means: registries, the published folder scheme, demo subsets and what is missing."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from robocasa_lerobot import contract
from robocasa_lerobot.benchmark.tasks import published_task_sets, published_tasks, task_facts
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig, SelectionConfig, demo_count
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.registry.hub import fetch_missing
from robocasa_lerobot.data.registry.published import PublishedDatasets
from robocasa_lerobot.data.registry.registry import (
    MissingDatasetsError,
    missing_datasets,
    resolve_mixture,
    select_datasets,
)
from robocasa_lerobot.envs.tasks import registry as envs
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.jsonl import read_jsonl, write_jsonl
from robocasa_lerobot.settings import decode, load_yaml


@pytest.fixture(scope="module")
def fake(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=12, length=4, image_size=32)


def info(folder: Path, version: str) -> None:
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps({"codebase_version": version}))


def registry_file(folder: Path, **content: object) -> str:
    path = folder / "registry.yaml"
    path.write_text(yaml.safe_dump({"root": str(folder), **content}))
    return str(path)


def test_published_sets_have_the_published_sizes_and_those_of_the_tasks_here() -> None:
    sizes = {name: len(tasks) for name, tasks in published_task_sets().items()}
    assert sizes == {
        "atomic_seen": 18, "composite_seen": 16, "composite_unseen": 16, "target50": 50, "pretrain50": 50,
        "pretrain100": 100, "pretrain200": 200, "pretrain300": 300, "mimicgen60": 60, "diversity17": 17,
        "lifelong_phase1": 65, "lifelong_phase2": 20, "lifelong_phase3": 20, "lifelong_phase4": 20,
    }  # fmt: skip
    assert set(envs.task_names()) <= set(published_tasks())


def test_published_tasks_are_those_of_the_facts(shared: Path) -> None:
    with (shared / "facts/tasks.csv").open() as file:
        rows = {row["task"]: (row["kind"], frozenset(row["sets"].split())) for row in csv.DictReader(file)}
    assert published_tasks() == rows


def test_facts_of_tasks_are_those_of_the_list_of_attributes_and_of_the_papers_tables(shared: Path) -> None:
    listed = {row["task"]: row for row in csv.DictReader((shared / "facts/tasks.csv").open())}
    line = r"^([A-Z][\w ]+?) & \\texttt\{(.*?)\} & (\d+) & (Yes|No) & "
    text = (shared / "facts/paper.txt").read_text()
    in_tables = {
        match[2].replace(r"\allowbreak{}", ""): (match[1].lower().replace(" ", "_"), int(match[3]), match[4] == "Yes")
        for match in re.finditer(line, text, re.MULTILINE)
    }
    assert set(in_tables) == set(published_task_sets()["target50"])
    facts = task_facts()
    renamed = {
        "sanitizing_cutting_board": "sanitizing_cutting_boards",
        "washing_fruits_and_vegetables": "washing_produce",
    }
    for name, one in facts.items():
        row = listed[name]
        if one.kind == "atomic":
            activity, own = "atomic", (one.activity or "atomic", one.subtasks, one.mobile)
        else:
            activity, own = renamed.get(row["activity"], row["activity"]), (one.activity, one.subtasks, one.mobile)
        assert own == in_tables.get(name, (activity, int(row["subtasks"]), row["mobile"] == "Yes")), name
        assert (one.family or "") == row["family"]
        assert (one.horizon or "", one.human_seconds) == (
            int(row["horizon"] or 0) or "",
            float(row["human_episode_seconds"]),
        )
    assert len({one.activity for one in facts.values()} - {None}) == 60
    assert len({one.family for one in facts.values()} - {None}) == 6
    # The list alone has 232 mobile tasks, the paper's text 220; with the three corrections of its tables 229 are left.
    assert sum(row["mobile"] == "Yes" for row in listed.values()) == 232
    assert sum(one.mobile for one in facts.values()) == 229


def test_published_folders_are_found_newest_first_and_old_formats_say_how_to_convert(tmp_path: Path) -> None:
    drawer = tmp_path / "v1.0/pretrain/atomic/OpenDrawer"
    info(drawer / "20250101/lerobot", "v3.0")
    info(drawer / "20250301/lerobot", "v2.1")
    info(drawer / "20250301/lerobot_v3", "v3.0")
    info(drawer / "20250301/mg/demo/2025-04-01/lerobot", "v2.1")
    info(tmp_path / "v1.0/target/composite/ArrangeTea/20250102/lerobot_cotraining_cams", "v3.0")
    published = PublishedDatasets(tmp_path)
    human, generated = published.find(["OpenDrawer"], "pretrain", None, "lerobot")[:2]
    assert (human.root, human.missing) == (drawer / "20250301/lerobot_v3", None)
    old = drawer / "20250301/mg/demo/2025-04-01/lerobot"
    assert generated.source == "mg"
    assert f"robocasa-lerobot convert {old} --out {old}_v3" in str(generated.missing)
    tea = published.find(["ArrangeTea"], None, None, "lerobot_cotraining_cams")
    assert [(e.split, e.source, e.missing) for e in tea] == [("target", "human", None)]
    assert "downloads" in str(published.find(["ArrangeTea"], None, None, "lerobot")[0].missing)
    assert published.find(["ArrangeTea"], "pretrain", None, "lerobot") == []


def test_any_source_is_what_is_there_or_can_be_downloaded(tmp_path: Path) -> None:
    task = min(published_task_sets()["diversity17"])
    dated = tmp_path / "pretrain" / published_tasks()[task][0] / task / "20250101"
    info(dated / "mg_5x1/demo/2025-04-01/lerobot", "v2.1")
    published = PublishedDatasets(tmp_path)
    assert [entry.source for entry in published.find([task], "pretrain", None, "lerobot")] == ["human", "mg", "mg_5x1"]
    (asked,) = published.find([task], "pretrain", "mg_5x5", "lerobot")
    assert "no download of mg_5x5 is known" in str(asked.missing)


@pytest.mark.parametrize(
    ("task_set", "split", "source", "count"),
    [
        ("pretrain300", "pretrain", "human", 300),
        ("lifelong_phase1", "pretrain", None, 65 + 60),  # of the two reduced sets no download is known
        ("lifelong_phase1", "pretrain", "mg_5x1", 17),
        ("lifelong_phase1", "pretrain", "mg", 60),
        ("atomic_seen", "target", None, 18),
        (None, None, None, 300 + 60 + 50),
    ],
)
def test_selections_list_what_is_published(
    task_set: str | None, split: str | None, source: str | None, count: int
) -> None:
    entries = select_datasets(SelectionConfig(task_set=task_set, split=split, source=source))
    assert len(entries) == len({(e.task, e.split, e.source) for e in entries}) == count


def test_missing_datasets_are_listed_with_what_to_do(tmp_path: Path) -> None:
    registry = registry_file(
        tmp_path,
        scheme="robocasa365",
        datasets=[{"path": "mine", "tasks": ["OpenDrawer"], "split": "target", "source": "own", "get": "run `x`"}],
    )
    config = MixtureConfig(
        [MemberConfig(str(tmp_path / "gone"))],
        select=[
            SelectionConfig(registry, task_set="composite_seen", split="target", source="human"),
            SelectionConfig(registry, tasks=["OpenDrawer"], source="own"),
        ],
    )
    with pytest.raises(MissingDatasetsError, match="17 dataset") as caught:
        resolve_mixture(config)
    assert "GetToastedBread (target, human)" in str(caught.value)
    assert "run `x`" in str(caught.value)
    assert str(tmp_path / "target/composite/<Task>/<date>/lerobot") in str(caught.value)
    assert [str(e.root) for e in missing_datasets(config)][16:] == [str(tmp_path / "mine"), str(tmp_path / "gone")]
    everything = MixtureConfig(select=[SelectionConfig(registry)])
    with pytest.raises(MissingDatasetsError) as caught:
        resolve_mixture(everything)
    assert len(str(caught.value).splitlines()) < 30


def test_registry_file_gives_one_member_for_each_task(fake: Path, tmp_path: Path) -> None:
    only = write_fake_dataset(tmp_path / "only", episodes=2, length=4, image_size=32, tasks=["OpenDrawer"])
    shutil.copytree(fake, tmp_path / "both")
    registry = registry_file(
        tmp_path,
        task_sets={"drawers": ["OpenDrawer", "CloseDrawer"]},
        datasets=[{"path": "both"}, {"path": "only", "tasks": ["OpenDrawer"], "split": "target", "source": "real"}],
    )
    config = MixtureConfig(
        select=[
            SelectionConfig(registry, task_set="drawers", split="pretrain", demos="50%", group="simulated"),
            SelectionConfig(registry, tasks=["OpenDrawer"], source="real", group="real"),
        ],
        shares={"real": 0.15, "simulated": 0.85},
    )
    members = resolve_mixture(config).members
    assert [(m.root, m.tasks, m.demos) for m in members] == [
        (str(tmp_path / "both"), ["OpenDrawer"], "50%"),
        (str(tmp_path / "both"), ["CloseDrawer"], "50%"),
        (str(only), None, None),
    ]
    dataset = MixtureDataset(config)
    assert dataset.config.members == members
    np.testing.assert_allclose(dataset.probabilities, [0.425, 0.425, 0.15])
    assert dataset.meta.total_episodes == 3 + 3 + 2


def test_mistakes_in_selections_and_registries_are_told(tmp_path: Path) -> None:
    registry = registry_file(tmp_path, datasets=[{"path": "a", "tasks": ["MyTask"], "source": "own"}])
    for selection, message in (
        (SelectionConfig(tasks=["OpenDraw"]), "Did you mean 'OpenDrawer'"),
        (SelectionConfig(task_set="atomic_sen"), "atomic_seen"),
        (SelectionConfig(split="targets"), "Did you mean 'target'"),
        (SelectionConfig(source="humans"), "Did you mean 'human'"),
        (SelectionConfig("robocasa"), "Did you mean 'robocasa365'"),
        (SelectionConfig(str(tmp_path / "registri.yaml")), r"registry\.yaml"),
        (SelectionConfig(tasks=["ArrangeTea"], split="pretrain"), "no data of ArrangeTea"),
        (SelectionConfig(registry, task_set="atomic_seen"), "has nothing"),
    ):
        with pytest.raises(UserError, match=message):
            select_datasets(selection)
    for content, message in (
        ({"dataset": []}, "Did you mean 'datasets'"),
        ({"datasets": [{"path": "a", "task": ["X"]}]}, "Did you mean 'tasks'"),
        ({"datasets": ["a"]}, "expected a mapping of settings: path"),
        ({"scheme": "robocasa"}, "Did you mean 'robocasa365'"),
    ):
        with pytest.raises(UserError, match=message):
            select_datasets(SelectionConfig(registry_file(tmp_path, **content)))
    (tmp_path / "v1.0/target/composite/ArrangeTea/1/lerobot/meta").mkdir(parents=True)
    (tmp_path / "v1.0/target/composite/ArrangeTea/1/lerobot/meta/info.json").write_text("{")
    with pytest.raises(UserError, match="not valid JSON"):
        select_datasets(SelectionConfig(registry_file(tmp_path, scheme="robocasa365"), tasks=["ArrangeTea"]))


@pytest.mark.parametrize("demos", ["0", "0%", "101%", "ten", "5-7", "-1", ""])
def test_demos_that_mean_nothing_are_refused(demos: str) -> None:
    with pytest.raises(UserError, match="expected a number"):
        MemberConfig("a", demos=demos)


@pytest.mark.parametrize(
    ("demos", "total", "count"),
    [("50", 500, 50), ("50_demos", 20, 20), ("10%", 500, 50), ("30%", 500, 150), ("1%", 20, 1), ("100%", 7, 7)],
)
def test_demos_are_counted(demos: str, total: int, count: int) -> None:
    assert demo_count(demos, total) == count


def test_demo_subset_is_the_benchmarks(fake: Path) -> None:
    # random.Random(0) shuffles range(6) to 4 2 1 0 5 3, written down from CPython 3.12.
    assert contract.demo_subset(6, 3) == (1, 2, 4)
    assert contract.demo_subset(6, 9) == tuple(range(6))
    source = DatasetSource(fake)  # tasks take turns: even episodes are of the one, odd ones of the other
    assert source.select(MemberConfig("-", ["OpenDrawer"], demos="3")).tolist() == [2, 4, 8]
    assert source.select(MemberConfig("-", demos="50%")).tolist() == [2, 3, 4, 5, 8, 9]
    assert source.select(MemberConfig("-", episodes=[0, 2, 4, 6, 8, 10], demos="3_demos")).tolist() == [2, 4, 8]


def test_episodes_are_chosen_by_kitchen(fake: Path, tmp_path: Path) -> None:
    source = DatasetSource(fake)  # kitchens change after each round of the two tasks

    def chosen(**fields: Any) -> list[int]:
        return source.select(MemberConfig("-", **fields)).tolist()

    assert chosen(layouts=[11]) == chosen(styles=[34, 28]) == [0, 1, 4, 5, 8, 9]
    assert chosen(layouts=[11, 15, 18], styles=[14], tasks=["CloseDrawer"]) == [3, 7, 11]
    # After the choice of kitchens, one of the three of each task: random.Random(0) shuffles range(3) to 0 2 1.
    assert chosen(layouts=[15], demos="1") == [2, 3]
    with pytest.raises(UserError, match=r"no episode is left with layouts=\[11\], styles=\[14\]"):
        chosen(layouts=[11], styles=[14])
    for fields in ({"layouts": []}, {"styles": [34, 34]}):
        with pytest.raises(UserError, match="is empty or has repeats"):
            MemberConfig("-", **fields)
    registry = registry_file(tmp_path, datasets=[{"path": str(fake), "tasks": ["OpenDrawer"]}])
    (member,) = resolve_mixture(MixtureConfig(select=[SelectionConfig(registry, layouts=[15], styles=[14])])).members
    assert (member.layouts, member.styles) == ([15], [14])
    dataset = MixtureDataset(MixtureConfig([member]))
    assert dataset.meta.total_episodes == 6
    assert "layouts 15; styles 14" in dataset.describe()
    without = tmp_path / "without"
    shutil.copytree(fake, without)
    table = without / "meta/robocasa/episodes.jsonl"
    rows = read_jsonl(table)
    write_jsonl(table, ({**row, "instruction": "open\u2028the\x85drawer"} for row in rows))  # ends of lines elsewhere
    assert DatasetSource(without).select(MemberConfig("-", layouts=[11])).tolist() == chosen(layouts=[11])
    write_jsonl(table, ({**row, "layout_id": None} for row in rows))
    with pytest.raises(UserError, match="no layout_id of episode 0, which `layouts` needs"):
        DatasetSource(without).select(MemberConfig("-", layouts=[11]))


def test_shares_need_groups() -> None:
    with pytest.raises(UserError, match="no `group`"):
        MixtureConfig([MemberConfig("a", group="x"), MemberConfig("b")], shares={"x": 1.0})
    with pytest.raises(UnknownNameError, match="group 'y'"):
        MixtureConfig([MemberConfig("a", group="x"), MemberConfig("b", group="y")], shares={"x": 1.0})
    with pytest.raises(UserError, match="which has a share"):
        MixtureConfig([MemberConfig("a", group="x")], shares={"x": 0.5, "z": 0.5})
    with pytest.raises(UserError, match="above 0"):
        MixtureConfig([MemberConfig("a", group="x")], shares={"x": 0.0})


def test_mixture_files_may_write_numbers_and_text() -> None:
    config = decode(
        MixtureConfig, {"select": [{"task_set": "target50", "demos": 50, "group": "a"}], "shares": {"a": 1}}
    )
    assert config.select[0].demos == "50"
    assert config.shares == {"a": 1.0}


@pytest.mark.parametrize("name", ["human300", "human300_mg60", "target_10"])
def test_mixture_files_of_the_benchmark_select_its_datasets(name: str) -> None:
    path = Path(__file__).parents[2] / f"configs/mixtures/robocasa365_{name}.yaml"
    config = decode(MixtureConfig, load_yaml(path))
    counts = {"human300": 300, "human300_mg60": 360, "target_10": 50}
    assert sum(len(select_datasets(selection)) for selection in config.select) == counts[name]


def test_datasets_of_the_hub_are_fetched_once_and_only_for_training(
    fake: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import huggingface_hub

    monkeypatch.chdir(tmp_path)
    mixture = MixtureConfig([MemberConfig(repo_id="owner/name", weight=1.0)])
    assert mixture.members[0].root == "datasets/hub/owner/name"
    (entry,) = missing_datasets(mixture)  # what a plan asks: nothing is fetched for it
    assert "training fetches owner/name" in str(entry.missing)
    asked = []

    def download(name: str, *, repo_type: str, local_dir: str) -> str:
        asked.append((name, repo_type))
        shutil.copytree(fake, local_dir, dirs_exist_ok=True)
        return local_dir

    monkeypatch.setattr(huggingface_hub, "snapshot_download", download)
    assert fetch_missing([mixture, mixture]) == [Path("datasets/hub/owner/name")]
    assert fetch_missing([mixture]) == []
    assert asked == [("owner/name", "dataset")]
    assert MixtureDataset(mixture).meta.total_episodes == 12
    assert [path.name for path in Path("datasets/hub/owner").iterdir()] == ["name"]


def test_what_the_hub_cannot_give_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from huggingface_hub import constants

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    with pytest.raises(UserError, match="hf download owner/name --repo-type dataset"):
        fetch_missing([MixtureConfig([MemberConfig(repo_id="owner/name")])])
    assert not Path("datasets/hub/owner/name").exists()
    for name in ("name", None):
        with pytest.raises(UserError, match="repo_id"):
            MemberConfig(repo_id=name)
