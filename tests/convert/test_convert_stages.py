"""Stages of recordings in datasets: every frame has its stage, and LeRobot's own loader says what it is called."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from convert_support import INSTRUCTION, tree_hashes, write_demos
from lerobot.datasets.aggregate import aggregate_datasets
from lerobot.datasets.language_render import active_at
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.utils.collate import lerobot_collate_fn
from lerobot.utils.feature_utils import dataset_to_policy_features

from robocasa_lerobot import contract
from robocasa_lerobot.convert.export import export
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.rerender.plan import RenderSettings
from robocasa_lerobot.convert.rerender.work import render_dataset
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.stages import SUBTASKS_FILE, read_subtasks
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

SETTINGS = ConversionSettings()
# In the second episode the first stage has come undone and is carried out again; two of its stages say the same.
TEXTS = (
    ("open the door of the fridge", "put the apple on the counter"),
    ("put the pear on the plate",) * 2 + ("wait",),
)
INDICES = ([0] * 7 + [1] * 5, [0] * 3 + [1] * 2 + [0] * 2 + [2] * 2)


def add_stages(path: Path, texts: Sequence[Sequence[str]] = TEXTS, indices: Sequence[Sequence[int]] = INDICES) -> Path:
    with h5py.File(path, "r+") as file:
        for number, (said, index) in enumerate(zip(texts, indices, strict=True)):
            demo = file[f"data/demo_{number}"]
            demo["stage"] = np.array(index, np.int32)
            rows = [{"text": text, "skill": "pick_place"} for text in said]
            demo.attrs["ep_meta"] = json.dumps(json.loads(demo.attrs["ep_meta"]) | {"stages": rows})
    return path


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A file whose demos have stages, and the dataset made from it."""
    folder = tmp_path_factory.mktemp("staged")
    source = add_stages(write_demos(folder / "Fetch.hdf5", tuple(map(len, INDICES)), images=32))
    return source, convert([source], folder / "data", SETTINGS, workers=1).root


def opened(root: Path) -> LeRobotDataset:
    return LeRobotDataset(f"local/{root.name}", root=root, video_backend="pyav")


def said(dataset: LeRobotDataset) -> list[str]:
    """The subtask of each frame as LeRobot resolves it."""
    rows = dataset.hf_dataset
    found = (
        active_at(float(row["timestamp"]), persistent=row[contract.LANGUAGE_KEY], style="subtask")
        for row in (rows[i] for i in range(len(rows)))
    )
    return [row["content"] for row in found if row is not None]


TRUE = [texts[stage] for texts, index in zip(TEXTS, INDICES, strict=True) for stage in index]


def test_lerobots_loader_says_the_text_of_every_frame(staged: tuple[Path, Path]) -> None:
    dataset = opened(staged[1])
    assert dataset.meta.has_language_columns
    assert said(dataset) == TRUE
    item = dataset[8]
    assert item["task"] == INSTRUCTION
    assert (int(item[contract.STAGE_KEY]), int(item[contract.SUBTASK_KEY])) == (1, 1)
    rows = [int(row) for row in dataset.hf_dataset[:][contract.SUBTASK_KEY]]
    texts = read_subtasks(staged[1])
    assert texts == [*TEXTS[0], "put the pear on the plate", "wait"]
    assert [texts[row] for row in rows] == TRUE
    stages = [int(stage) for stage in dataset.hf_dataset[:][contract.STAGE_KEY]]
    assert stages == [stage for index in INDICES for stage in index]
    batch = next(iter(torch.utils.data.DataLoader(dataset, batch_size=4, collate_fn=lerobot_collate_fn)))
    assert batch[contract.SUBTASK_KEY].tolist() == [0] * 4
    assert contract.LANGUAGE_KEY not in json.loads((staged[1] / "meta/stats.json").read_text())


def test_the_table_is_the_one_that_earlier_loaders_read(staged: tuple[Path, Path]) -> None:
    import pandas as pd

    table = pd.read_parquet(staged[1] / "meta" / "subtasks.parquet")
    assert table.index.name == "subtask"
    assert table[contract.SUBTASK_KEY].tolist() == list(range(len(table)))
    assert table.iloc[1].name == "put the apple on the counter"


def test_a_policy_gets_no_stage_as_input(staged: tuple[Path, Path]) -> None:
    features = dataset_to_policy_features(opened(staged[1]).meta.features)
    assert not set(contract.STAGE_KEYS) & set(features)


def test_training_mixes_datasets_with_and_without_stages(staged: tuple[Path, Path], tmp_path: Path) -> None:
    plain = convert([write_demos(tmp_path / "plain.hdf5", (5,), images=32, seed=3)], tmp_path / "plain", SETTINGS).root
    members = [MemberConfig(str(staged[1])), MemberConfig(str(plain))]
    mixture = MixtureDataset(MixtureConfig(members))
    assert set(mixture.meta.features) == set(opened(plain).meta.features)
    assert not set(contract.STAGE_KEYS) & (set(mixture[2]) | set(mixture.statistics()))
    both = mixture.batch(np.array([0, 1]), np.array([3, 2]))
    assert both[contract.ACTION_KEY].shape == (2, contract.ACTION_SIZE)


def test_verification_compares_stages(staged: tuple[Path, Path]) -> None:
    report = verify(staged[1])
    assert report.passed, report.as_json()
    assert {check.name: check.compared for check in report.checks}["stages"] >= len(TRUE)


def _other_rows(root: Path) -> None:
    _column(root, contract.SUBTASK_KEY, lambda values: values[::-1])


def _other_stages(root: Path) -> None:
    _column(root, contract.STAGE_KEY, lambda values: [0] * len(values))


def _other_texts(root: Path) -> None:
    table = pq.ParquetFile(root / SUBTASKS_FILE).read()
    texts = pa.array(list(reversed(table["subtask"].to_pylist())))
    pq.write_table(table.set_column(table.schema.get_field_index("subtask"), "subtask", texts), root / SUBTASKS_FILE)


def _other_language(root: Path) -> None:
    file = next((root / "data").glob("*/*.parquet"))
    table = pq.ParquetFile(file).read()
    at = table.schema.get_field_index(contract.LANGUAGE_KEY)
    column = table[contract.LANGUAGE_KEY].combine_chunks()
    shuffled = column.take(pa.array(list(range(len(column)))[::-1]))
    pq.write_table(table.set_column(at, table.schema.field(at), shuffled), file)


def _column(root: Path, key: str, change: Callable[[list[int]], list[int]]) -> None:
    file = next((root / "data").glob("*/*.parquet"))
    table = pq.ParquetFile(file).read()
    at = table.schema.get_field_index(key)
    changed = pa.array(change(table[key].to_pylist()), pa.int64())
    pq.write_table(table.set_column(at, table.schema.field(at), changed), file)


@pytest.mark.parametrize("spoil", [_other_rows, _other_stages, _other_texts, _other_language])
def test_verification_notices(spoil: Callable[[Path], None], staged: tuple[Path, Path], tmp_path: Path) -> None:
    root = Path(shutil.copytree(staged[1], tmp_path / "copy"))
    spoil(root)
    report = verify(root)
    assert [check.name for check in report.checks if not check.passed] == ["stages"]


def test_the_workers_make_no_difference_and_rows_are_joined(tmp_path: Path) -> None:
    lengths = (251, 251, 251)
    texts = (("a", "b"), ("c", "a"), ("b",))
    indices = [[0] * 100 + [1] * 151, [0] * 50 + [1] * 201, [0] * 251]
    source = add_stages(write_demos(tmp_path / "a.hdf5", lengths, images=16), texts, indices)
    roots = [convert([source], tmp_path / f"out{n}", SETTINGS, workers=n).root for n in (1, 2)]
    hashes = [tree_hashes(root) for root in roots]
    record = f"{META_FOLDER}/conversion.json"
    assert {k: v for k, v in hashes[0].items() if k != record} == {k: v for k, v in hashes[1].items() if k != record}
    true = [texts[i][stage] for i, index in enumerate(indices) for stage in index]
    assert said(opened(roots[0])) == true
    assert read_subtasks(roots[0]) == ["a", "b", "c"]
    entries = pq.read_table(next((roots[0] / "meta" / "episodes").glob("*/*.parquet")))
    assert entries[f"stats/{contract.SUBTASK_KEY}/max"].to_pylist() == [[1], [2], [1]]
    assert verify(roots[0], min_psnr_db=10).passed


def test_export_and_back(staged: tuple[Path, Path], tmp_path: Path) -> None:
    path = export(staged[1], tmp_path / "again.hdf5").path
    with h5py.File(staged[0]) as source, h5py.File(path) as again:
        for number in range(len(INDICES)):
            before, after = source[f"data/demo_{number}"], again[f"data/demo_{number}"]
            assert after["stage"].dtype == before["stage"].dtype
            assert after["stage"][:].tolist() == before["stage"][:].tolist()
            rows = json.loads(before.attrs["ep_meta"])["stages"]
            assert json.loads(after.attrs["ep_meta"])["stages"] == rows
    assert said(opened(convert([path], tmp_path / "back", SETTINGS, workers=1).root)) == TRUE


def test_lerobots_own_merging_keeps_what_its_loader_reads(staged: tuple[Path, Path], tmp_path: Path) -> None:
    ids = ["local/one", "local/two"]
    aggregate_datasets(ids, "local/both", roots=[staged[1]] * 2, aggr_root=tmp_path / "both")
    assert said(opened(tmp_path / "both")) == TRUE * 2


@pytest.mark.render
def test_rendering_again_keeps_stages(staged: tuple[Path, Path], tmp_path: Path) -> None:
    settings = RenderSettings(cameras=contract.CAMERAS[:1], image_size=48)
    render_dataset(staged[1], tmp_path / "out", settings, workers=1)
    assert said(opened(tmp_path / "out")) == TRUE
    assert verify(tmp_path / "out", min_psnr_db=10).passed
    (tmp_path / "out" / SUBTASKS_FILE).unlink()
    assert not verify(tmp_path / "out", min_psnr_db=10).passed


def test_a_demo_without_stages_is_one_that_is_called_as_its_instruction(tmp_path: Path) -> None:
    staged = add_stages(write_demos(tmp_path / "a.hdf5", tuple(map(len, INDICES)), images=16))
    plain = write_demos(tmp_path / "b.hdf5", (4,), images=16, seed=7)
    for order in ([staged, plain], [plain, staged]):
        root = convert(order, tmp_path / f"out_{order[0].stem}", SETTINGS).root
        expected = {staged: TRUE, plain: [INSTRUCTION] * 4}
        assert said(opened(root)) == [text for path in order for text in expected[path]]
        assert verify(root, min_psnr_db=10).passed


def _without_text(meta: dict[str, Any]) -> None:
    for row in meta["stages"]:
        del row["text"]


def _empty_text(meta: dict[str, Any]) -> None:
    meta["stages"][0]["text"] = " "


def _no_table(meta: dict[str, Any]) -> None:
    meta["stages"] = {"a": 1}


@pytest.mark.parametrize("change", [_without_text, _empty_text, _no_table])
def test_recordings_that_do_not_name_their_stages_convert_as_if_they_had_none(
    change: Callable[[dict[str, Any]], None], tmp_path: Path
) -> None:
    root = convert([write_demos(tmp_path / "plain.hdf5", (4,), images=16)], tmp_path / "plain", SETTINGS).root
    older = add_stages(write_demos(tmp_path / "older.hdf5", (4,), images=16), (("x", "y"),), [[0, 0, 1, 1]])
    with h5py.File(older, "r+") as file:
        demo = file["data/demo_0"]
        meta = json.loads(demo.attrs["ep_meta"])
        change(meta)
        demo.attrs["ep_meta"] = json.dumps(meta)
    other = convert([older], tmp_path / "older", SETTINGS).root
    before, after = tree_hashes(root), tree_hashes(other)
    same = [
        name for name in before if name.startswith(("data/", "videos/")) or name.endswith(("info.json", ".parquet"))
    ]
    assert {name: after[name] for name in same} == {name: before[name] for name in same}
    assert not (root / SUBTASKS_FILE).exists()
    assert not (other / SUBTASKS_FILE).exists()


@pytest.mark.parametrize("index", [[0, 0, 2, 0], [0, -1, 0, 0], [0, 0, 0]])
def test_a_step_of_no_stage_rejects_the_episode(index: list[int], tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (4, 4), images=16)
    add_stages(source, (("x", "y"), ("x", "y")), [[0, 0, 1, 1], index])
    result = convert([source], tmp_path / "out", SETTINGS)
    assert result.num_episodes == 1
    (line,) = read_jsonl(tmp_path / "out" / META_FOLDER / "rejected.jsonl")
    assert line["source_demo"] == "demo_1"
    assert "stage" in line["reason"]


def test_an_only_episode_with_wrong_stages_is_an_error(tmp_path: Path) -> None:
    source = add_stages(write_demos(tmp_path / "a.hdf5", (4,), images=16), (("x",),), [[0, 0, 0, 9]])
    with pytest.raises(UserError, match="step 3 belongs to stage"):
        convert([source], tmp_path / "out", SETTINGS)
