"""LeRobot v2.0 and v2.1 datasets in RoboCasa365's layout: what is kept, what is copied, what is encoded again."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import v2_support as v2
from convert_support import leftovers, tree_hashes
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert.lerobot_v2.plan import V2Plan
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings, Shard
from robocasa_lerobot.convert.verify import verify
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.convert.writing.video import digests, probe
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_jsonl

LENGTHS = (24, 1, 31)
SETTINGS = ConversionSettings()


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A v2.1 dataset whose videos are in the target form."""
    return v2.write_dataset(tmp_path_factory.mktemp("v2") / "lerobot", LENGTHS)


@pytest.fixture(scope="module")
def converted(source: Path) -> Path:
    """The dataset made from it."""
    return convert([source], source.parent / "data", SETTINGS, workers=1).root


def record(root: Path) -> dict[str, Any]:
    """Its conversion.json."""
    return dict(json.loads((root / META_FOLDER / "conversion.json").read_text(encoding="utf-8")))


def packets(root: Path, camera: str) -> int:
    """Packets in all video files of a camera."""
    return sum(probe(file).num_packets for file in (root / "videos" / contract.image_key(camera)).glob("*/*.mp4"))


def test_verifies_against_its_source(converted: Path) -> None:
    report = verify(converted, pictures_per_episode=None)
    assert report.passed, report.as_json()
    assert (report.num_episodes, report.num_frames) == (3, sum(LENGTHS))
    compared = {check.name: check.compared for check in report.checks}
    assert compared["actions"] == sum(LENGTHS) * contract.ACTION_SIZE
    assert compared["copied frames"] == len(contract.CAMERAS) * (sum(LENGTHS) + len(LENGTHS))
    assert min(compared.values()) > 0
    assert all(camera.minimum == float("inf") for camera in report.cameras)


def test_videos_in_the_target_form_are_copied_packet_by_packet(source: Path, converted: Path) -> None:
    for camera in contract.CAMERAS:
        assert packets(converted, camera) == sum(LENGTHS)
        true = [digest for index in range(3) for digest in digests(v2.video(source, index, camera))]
        files = sorted((converted / "videos" / contract.image_key(camera)).glob("*/*.mp4"))
        assert [digest for file in files for digest in digests(file)] == true
        assert len(set(true)) > sum(LENGTHS) // 2
        assert record(converted)["videos"][camera] == {"copied": 3, "reencoded": {}}


def test_features_names_and_values_are_the_contracts(source: Path, converted: Path) -> None:
    dataset = LeRobotDataset("local/test", root=converted, video_backend="pyav")
    for key, feature in contract.dataset_features((v2.SIZE, v2.SIZE)).items():
        found = dataset.meta.features[key]
        assert (found["dtype"], tuple(found["shape"]), found["names"]) == tuple(feature.values())
    assert dataset.meta.robot_type == contract.ROBOT_TYPE
    assert dataset.meta.features["next.done"]["dtype"] == "bool"
    assert [dataset[i]["task"] for i in (0, 24, 25)] == [v2.INSTRUCTIONS[i] for i in (0, 1, 0)]
    columns = [v2.read_columns(source, index) for index in range(3)]
    for key in ("action", "observation.state"):
        true = np.concatenate([c[key].flatten().to_numpy() for c in columns])
        assert column(converted, key).tobytes() == true.tobytes()
    true = np.concatenate([c["next.reward"].to_numpy() for c in columns])
    assert column(converted, "next.reward").tobytes() == true.tobytes()


def test_task_rows_keep_their_numbers_and_the_task_name_is_no_instruction(converted: Path) -> None:
    dataset = LeRobotDataset("local/test", root=converted, video_backend="pyav")
    assert dict(dataset.meta.tasks["task_index"]) == {v2.INSTRUCTIONS[0]: 0, v2.INSTRUCTIONS[1]: 1, v2.TASK_NAME: 2}
    assert column(converted, "annotation.human.task_name").tolist() == [2] * sum(LENGTHS)
    assert [dataset.meta.episodes[i]["tasks"] for i in range(3)] == [[v2.INSTRUCTIONS[i]] for i in (0, 1, 0)]
    lines = read_jsonl(converted / META_FOLDER / "episodes.jsonl")
    assert {line["task_name"] for line in lines} == {v2.TASK_NAME}
    assert [line["instruction"] for line in lines] == [v2.INSTRUCTIONS[i] for i in (0, 1, 0)]
    assert [line["style_id"] for line in lines] == [5, 6, 7]


def test_extras_and_descriptions_are_kept_as_they_are(source: Path, converted: Path) -> None:
    true, kept = tree_hashes(source / "extras"), tree_hashes(converted / "extras")
    assert kept == true
    assert len(true) == 1 + 3 * 3
    for name in ("embodiment.json", "modality.json"):
        assert json.loads((converted / "meta" / name).read_text()) == json.loads((source / "meta" / name).read_text())


def test_statistics_are_those_of_all_frames(converted: Path) -> None:
    stats = json.loads((converted / "meta" / "stats.json").read_text())
    values = column(converted, "action")
    np.testing.assert_allclose(stats["action"]["q01"], np.quantile(values, 0.01, axis=0), rtol=1e-12)
    pictures = stats[contract.IMAGE_KEYS[0]]
    assert pictures["count"] == [sum(LENGTHS)]
    assert 0 <= np.min(pictures["q01"]) < np.max(pictures["q99"]) <= 1


@pytest.mark.parametrize("version", ["v2.0", "v2.1"])
def test_long_gops_are_encoded_again_unless_they_are_allowed(version: str, tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (30, 12), version=version, options=v2.ROBOCASA, extras=False)
    camera = contract.CAMERAS[0]
    assert probe(v2.video(source, 0, camera)).delay > 0, "the videos were to have B-frames"
    convert([source], tmp_path / "again", SETTINGS, workers=1)
    convert([source], tmp_path / "kept", ConversionSettings(max_gop=250), workers=1)
    reasons = record(tmp_path / "again")["videos"][camera]["reencoded"]
    assert list(reasons.values()) == [1, 1] or list(reasons.values()) == [2]
    assert all("between key frames" in reason for reason in reasons)
    assert record(tmp_path / "kept")["videos"][camera] == {"copied": 2, "reencoded": {}}
    for root, exact in ((tmp_path / "again", False), (tmp_path / "kept", True)):
        report = verify(root)
        assert report.passed, report.as_json()
        assert all((quality.minimum == float("inf")) == exact for quality in report.cameras)
        assert packets(root, camera) == 42
        assert record(root)["source_versions"] == [version]
    files = list((tmp_path / "again" / "videos" / contract.image_key(camera)).glob("*/*.mp4"))
    assert max(probe(file).longest_gop for file in files) == 2


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (ConversionSettings(reencode=True), "--reencode"),
        (ConversionSettings(image_size=32), "64x64 pixels, not 32x32"),
        (ConversionSettings(video_codec="hevc"), "codec h264, not hevc"),
        (ConversionSettings(max_gop=1), "up to 2 frames between key frames, more than 1"),
    ],
)
def test_what_is_not_in_the_target_form_is_encoded_again(
    settings: ConversionSettings, why: str, tmp_path: Path
) -> None:
    source = v2.write_dataset(tmp_path / "in", (9, 6), cameras=contract.CAMERAS[:1], extras=False)
    result = convert([source], tmp_path / "out", settings, workers=1)
    assert record(result.root)["videos"][contract.CAMERAS[0]] == {"copied": 0, "reencoded": {why: 2}}
    report = verify(result.root)
    assert report.passed, report.as_json()
    shape = LeRobotDataset("local/test", root=result.root, video_backend="pyav")[3][contract.IMAGE_KEYS[0]].shape
    assert tuple(shape) == (3, *[settings.image_size or v2.SIZE] * 2)


def test_copied_and_encoded_videos_and_other_headers_go_into_one_dataset(tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (12, 9, 10), cameras=contract.CAMERAS[:1], extras=False)
    pictures = v2.moving_pictures(9, v2.SIZE, 1)
    v2.write_video(v2.video(source, 1, contract.CAMERAS[0]), pictures, v2.ROBOCASA)
    other_header = v2.TARGET | {"profile": "baseline", "refs": "4"}
    v2.write_video(v2.video(source, 2, contract.CAMERAS[0]), v2.moving_pictures(10, v2.SIZE, 2), other_header)
    headers = [probe(v2.video(source, index, contract.CAMERAS[0])).header for index in (0, 2)]
    assert headers[0] != headers[1]
    result = convert([source], tmp_path / "out", ConversionSettings(max_gop=4), workers=1)
    assert record(result.root)["videos"][contract.CAMERAS[0]]["copied"] == 2
    report = verify(result.root, pictures_per_episode=None)
    assert report.passed, report.as_json()


def test_other_orders_of_components_become_the_contracts(source: Path, tmp_path: Path) -> None:
    changed = v2.clone(source, tmp_path / "in")
    turned = contract.slices(contract.ACTION_PARTS[::-1])

    def swap(columns: dict[str, Any]) -> None:
        actions = np.stack(columns["action"].to_pylist())
        columns["action"] = v2.vectors(np.concatenate([actions[:, contract.ACTION_SLICES[n]] for n in turned], axis=1))

    def rename(modality: dict[str, Any]) -> None:
        modality["action"] = {name: {"start": s.start, "end": s.stop} for name, s in turned.items()}

    for index in range(3):
        v2.edit_table(changed, index, swap)
    v2.edit_json(changed / "meta" / "modality.json", rename)
    result = convert([changed], tmp_path / "out", SETTINGS, workers=1)
    true = np.concatenate([v2.read_columns(source, index)["action"].flatten().to_numpy() for index in range(3)])
    assert column(result.root, "action").tobytes() == true.tobytes()
    written = json.loads((result.root / "meta" / "modality.json").read_text())["action"]
    assert {n: (part["start"], part["end"]) for n, part in written.items()} == {
        n: (where.start, where.stop) for n, where in contract.ACTION_SLICES.items()
    }
    assert verify(result.root).passed


def test_components_go_by_their_names_where_nothing_else_tells_their_order(source: Path, tmp_path: Path) -> None:
    names = contract.component_names(contract.ACTION_PARTS)
    true = np.concatenate([v2.read_columns(source, index)["action"].flatten().to_numpy() for index in range(3)])

    def converted(name: str, words: list[str], robot: str = contract.ROBOT_TYPE) -> Path:
        changed = v2.clone(source, tmp_path / name / "in")

        def describe(info: dict[str, Any]) -> None:
            info["robot_type"] = robot
            info["features"]["action"]["names"] = words
            info["features"]["observation.state"]["names"] = contract.component_names(contract.STATE_PARTS)

        (changed / "meta" / "modality.json").unlink()
        v2.edit_json(changed / "meta" / "info.json", describe)
        return convert([changed], tmp_path / name / "out", SETTINGS, workers=1).root

    turned = converted("turned", names[::-1])
    rows = column(turned, "action").reshape(-1, len(names))
    assert rows.tobytes() == np.ascontiguousarray(true.reshape(-1, len(names))[:, ::-1]).tobytes()
    assert v2_features(turned)["action"]["names"] == names
    # Ports of RoboCasa's HDF5 files: as many numbers, of another meaning.
    other = [f"arm_{i}" for i in range(len(names))]
    kept = converted("other", other)
    assert column(kept, "action").tobytes() == true.tobytes()
    assert v2_features(kept)["action"]["names"] == other
    with pytest.raises(UserError, match=r"does not say what the 12 numbers of 'action' are.*modality\.json"):
        converted("unnamed", ["action"])
    assert not (tmp_path / "unnamed" / "out").exists()


def v2_features(root: Path) -> dict[str, Any]:
    features: dict[str, Any] = json.loads((root / "meta" / "info.json").read_text())["features"]
    return features


def test_episodes_are_selected_by_the_benchmarks_rule(source: Path, tmp_path: Path) -> None:
    result = convert([source], tmp_path / "out", ConversionSettings(filter_key="2_demos"), workers=1)
    lines = read_jsonl(result.root / META_FOLDER / "episodes.jsonl")
    # random.Random(0).shuffle([0, 1, 2]) gives [0, 2, 1]
    assert [line["source_demo"] for line in lines] == ["episode_000000", "episode_000002"]
    assert verify(result.root).passed
    assert record(result.root)["sources"][0]["demos"] == ["episode_000000", "episode_000002"]


def _hashes(root: Path) -> dict[str, str]:
    hashes = tree_hashes(root)
    del hashes[f"{META_FOLDER}/conversion.json"]  # it names the output
    return hashes


def test_a_killed_conversion_goes_on_to_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = v2.write_dataset(tmp_path / "in", (20,) * 6, cameras=contract.CAMERAS[:2])
    monkeypatch.setattr("robocasa_lerobot.convert.lerobot_v2.plan.SHARD_FRAMES", 40)
    convert([source], tmp_path / "one", SETTINGS, workers=1)
    real = pipeline.convert_v2_shard
    done: list[tuple[str, ...]] = []

    def killed(plan: V2Plan, shard: Shard, *rest: Any) -> Any:
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(shard.demos)
        return real(plan, shard, *rest)

    monkeypatch.setattr(pipeline, "convert_v2_shard", killed)
    with pytest.raises(KeyboardInterrupt):
        convert([source], tmp_path / "two", SETTINGS, workers=1)
    assert not (tmp_path / "two").exists()

    def counted(plan: V2Plan, shard: Shard, *rest: Any) -> Any:
        done.append(shard.demos)
        return real(plan, shard, *rest)

    monkeypatch.setattr(pipeline, "convert_v2_shard", counted)
    convert([source], tmp_path / "two", SETTINGS, workers=1)
    assert done == [(f"episode_{i:06d}", f"episode_{i + 1:06d}") for i in (0, 2, 4)], "a finished shard was done again"
    assert _hashes(tmp_path / "one") == _hashes(tmp_path / "two")
    assert leftovers(tmp_path / "two") == ["two"]


@pytest.mark.slow
def test_result_does_not_depend_on_the_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = v2.write_dataset(tmp_path / "in", (20,) * 6, cameras=contract.CAMERAS[:2])
    monkeypatch.setattr("robocasa_lerobot.convert.lerobot_v2.plan.SHARD_FRAMES", 40)
    for workers in (1, 2):
        convert([source], tmp_path / f"out{workers}", SETTINGS, workers=workers)
    assert _hashes(tmp_path / "out1") == _hashes(tmp_path / "out2")


def test_touched_source_files_are_not_mixed_with_an_earlier_try(source: Path, tmp_path: Path) -> None:
    changed = v2.clone(source, tmp_path / "in")
    before = pipeline.make_v2_plan([changed], SETTINGS).fingerprint
    assert pipeline.make_v2_plan([changed], SETTINGS).fingerprint == before
    os.utime(v2.table(changed, 1), ns=(1, 1))
    assert pipeline.make_v2_plan([changed], SETTINGS).fingerprint != before


def test_several_datasets_become_one_with_one_table_of_tasks(source: Path, tmp_path: Path) -> None:
    second = v2.write_dataset(tmp_path / "second", (8,), seed=1)
    tasks = [{"task_index": 0, "task": "wave"}, {"task_index": 1, "task": v2.TASK_NAME}]
    (second / "meta" / "tasks.jsonl").write_text("".join(json.dumps(line) + "\n" for line in tasks))
    result = convert([source, second], tmp_path / "out", SETTINGS, workers=1)
    dataset = LeRobotDataset("local/test", root=result.root, video_backend="pyav")
    assert dict(dataset.meta.tasks["task_index"]) == {
        **{text: row for row, text in enumerate(v2.INSTRUCTIONS)}, v2.TASK_NAME: 2, "wave": 3,
    }  # fmt: skip
    assert set(column(result.root, "annotation.human.task_description")[-8:]) == {3}
    assert set(column(result.root, "annotation.human.task_name")) == {2}
    assert dataset[sum(LENGTHS)]["task"] == "wave"
    report = verify(result.root)
    assert report.passed, report.as_json()


def test_rows_of_texts_are_renumbered_and_numbers_of_stages_are_not(tmp_path: Path) -> None:
    """As RoboCasa's annotations of subtasks have them; its `modality.json` declares neither."""
    columns = {"annotation.human.subtask_name": np.zeros(6, int), "annotation.human.subtask_stage": np.arange(6) % 2}
    feature = {"dtype": "int64", "shape": [1], "names": None}
    folders = [tmp_path / name for name in ("one", "other")]
    for seed, folder in enumerate(folders):
        v2.write_dataset(folder, (6,), cameras=contract.CAMERAS[:1], extras=False, seed=seed)
        v2.edit_json(folder / "meta/info.json", lambda info: info["features"].update(dict.fromkeys(columns, feature)))
        v2.edit_table(folder, 0, lambda stored: stored.update(columns))
    tasks = folders[1] / "meta" / "tasks.jsonl"
    tasks.write_text(tasks.read_text(encoding="utf-8").replace(v2.INSTRUCTIONS[0], "wave"), encoding="utf-8")
    root = convert(folders, tmp_path / "out", SETTINGS, workers=1).root
    tasks_there = dict(LeRobotDataset("local/test", root=root, video_backend="pyav").meta.tasks["task_index"])
    assert tasks_there == {v2.INSTRUCTIONS[0]: 0, v2.TASK_NAME: 1, "wave": 2}
    assert column(root, "annotation.human.subtask_name").tolist() == [0] * 6 + [2] * 6
    assert column(root, "annotation.human.subtask_stage").tolist() == [0, 1] * 6
    assert column(root, "annotation.human.task_name").tolist() == [1] * 12
    assert verify(root).passed


def test_moved_source_is_found_by_option(source: Path, converted: Path, tmp_path: Path) -> None:
    moved = v2.clone(source, tmp_path / "elsewhere")
    copy = Path(shutil.copytree(converted, tmp_path / "copy"))
    assert verify(copy, sources=[moved], pictures_per_episode=1).passed


def test_command(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert (
        cli.main(["convert", str(source), "--out", str(out), "--cameras", contract.CAMERAS[2], "--workers", "1"]) == 0
    )
    assert f"3 episodes, {sum(LENGTHS)} frames, cameras {contract.CAMERAS[2]}" in capsys.readouterr().out
    assert cli.main(["verify", str(out)]) == 0
    assert "PASSED" in capsys.readouterr().out


@pytest.mark.costly
def test_isaac_groot_data_as_found_in_the_wild(shared: Path, tmp_path: Path) -> None:
    source = shared / "real" / "groot_picknplace"
    result = convert([source], tmp_path / "out", ConversionSettings(max_gop=250), workers=1)
    assert (result.num_episodes, result.num_frames, result.rejected) == (5, 2096, [])
    assert result.cameras == ("ego_view",)
    assert any("egoview is declared but has no video files" in note for note in result.notes)
    lines = read_jsonl(result.root / META_FOLDER / "episodes.jsonl")
    assert all(line["instruction"].startswith("pick the ") for line in lines)
    dataset = LeRobotDataset("local/test", root=result.root, video_backend="pyav")
    assert dataset.meta.features["action"]["shape"] == (44,)
    assert dataset.meta.tasks.loc["valid", "task_index"] == 1
    report = verify(result.root, pictures_per_episode=1)
    assert report.passed, report.as_json()
    compared = {check.name: check.compared for check in report.checks}
    assert (compared["actions"], compared["copied frames"]) == (2096 * 44, 2096 + 5)


@pytest.mark.parametrize(
    ("codec", "encoder", "options"),
    [
        ("hevc", "hevc", {"x265-params": "log-level=error:open-gop=0", "g": "4"}),
        ("av1", "libsvtav1", {"g": "4", "preset": "12"}),
    ],
)
def test_videos_of_other_codecs_are_copied_where_that_codec_is_wanted(
    codec: str, encoder: str, options: dict[str, str], tmp_path: Path
) -> None:
    source = v2.write_dataset(tmp_path / "in", (11, 7), cameras=contract.CAMERAS[:1], extras=False)
    for index, length in enumerate((11, 7)):
        pictures = v2.moving_pictures(length, v2.SIZE, index)
        v2.write_video(v2.video(source, index, contract.CAMERAS[0]), pictures, options, encoder)
    result = convert([source], tmp_path / "out", ConversionSettings(video_codec=codec), workers=1)
    assert record(result.root)["videos"][contract.CAMERAS[0]] == {"copied": 2, "reencoded": {}}
    report = verify(result.root, pictures_per_episode=None)
    assert report.passed, report.as_json()
    assert packets(result.root, contract.CAMERAS[0]) == 18


def test_open_gops_are_encoded_again_as_random_access_would_lose_pictures(tmp_path: Path) -> None:
    source = v2.write_dataset(tmp_path / "in", (11,), cameras=contract.CAMERAS[:1], extras=False)
    path = v2.video(source, 0, contract.CAMERAS[0])
    v2.write_video(
        path, v2.moving_pictures(11, v2.SIZE), {"x265-params": "log-level=error:open-gop=1", "g": "4"}, "hevc"
    )
    assert probe(path).open_gop
    result = convert([source], tmp_path / "out", ConversionSettings(video_codec="hevc"), workers=1)
    (reason,) = record(result.root)["videos"][contract.CAMERAS[0]]["reencoded"]
    assert "open GOP" in reason
    assert verify(result.root, pictures_per_episode=None).passed
