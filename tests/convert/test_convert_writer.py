"""The writer: every codec through LeRobot's own decoder, statistics of all frames, modality.json, kept files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import av
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from convert_support import TEXTURE, moving_pictures, write_demos
from lerobot.datasets.aggregate import aggregate_datasets
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.sampler import EpisodeAwareSampler
from torch.utils.data import DataLoader

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.writing.dataset import DatasetWriter
from robocasa_lerobot.convert.writing.encoder import (
    CODECS,
    SAMPLED_FRAMES,
    channel_histogram,
    num_sampled_pixels,
    sampled_frames,
)
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess
from robocasa_lerobot.convert.writing.joining import join_datasets
from robocasa_lerobot.convert.writing.modality import modality
from robocasa_lerobot.convert.writing.statistics import column, dataset_statistics, vector_statistics

KEY = contract.image_key("front")
FEATURES: dict[str, dict[str, Any]] = {
    KEY: {"dtype": "video", "shape": (64, 48, 3), "names": ["height", "width", "channel"]},
    contract.STATE_KEY: {"dtype": "float64", "shape": (3,), "names": ["a", "b", "c"]},
    contract.ACTION_KEY: {"dtype": "float32", "shape": (2,), "names": ["x", "y"]},
    "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
}


def _episode(length: int, seed: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    rng = np.random.default_rng(seed)
    columns: dict[str, Any] = {
        contract.STATE_KEY: rng.normal(size=(length, 3)),
        contract.ACTION_KEY: rng.normal(size=(length, 2)).astype(np.float32),
        "next.reward": rng.normal(size=length).astype(np.float32),
    }
    return columns, moving_pictures(length, 64, seed)[:, :, :48]


def _write(root: Path, lengths: tuple[int, ...], codec: str = "h264", first: int = 0) -> DatasetWriter:
    with EncodingProcess() as encoder:
        writer = DatasetWriter(encoder, root, 30, "arm", FEATURES, codec)
        for number, length in enumerate(lengths, start=first):
            columns, pictures = _episode(length, number)
            writer.add(columns, f"task {number % 2}", length, ({KEY: picture} for picture in pictures))
        writer.finalize()
    return writer


def _open(root: Path) -> LeRobotDataset:
    return LeRobotDataset(f"local/{root.name}", root=root, video_backend="pyav", return_uint8=True)


@pytest.mark.parametrize("codec", CODECS)
def test_every_codec_is_decoded_by_lerobot_frame_by_frame(codec: str, tmp_path: Path) -> None:
    lengths = (7, 1, 30)
    parts = [tmp_path / "a", tmp_path / "b"]
    _write(parts[0], lengths[:2], codec)
    _write(parts[1], lengths[2:], codec, first=2)
    histograms = {KEY: np.zeros((3, 256), np.int64)}
    join_datasets(parts, tmp_path / "joined")
    stats = dataset_statistics(tmp_path / "joined", FEATURES | _indices(), histograms | _write_histograms(lengths))
    _save_stats(tmp_path / "joined", stats)
    dataset = _open(tmp_path / "joined")
    (video,) = (tmp_path / "joined" / "videos").glob("*/*/*.mp4")
    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.size]
        assert stream.time_base is not None
        times = [float(packet.pts * stream.time_base) for packet in packets if packet.pts is not None]
        keys = np.flatnonzero([packet.is_keyframe for packet in packets])
        assert stream.codec.canonical_name == {"av1": "av1"}.get(codec, codec)
    assert len(packets) == sum(lengths)
    np.testing.assert_allclose(times, np.arange(sum(lengths)) / 30, atol=1e-4)  # one file, no gap between episodes
    assert np.diff([*keys, len(packets)]).max() <= 2
    row = 0
    for number, length in enumerate(lengths):
        columns, pictures = _episode(length, number)
        for step in range(length):
            item = dataset[row]
            decoded = item[KEY].permute(1, 2, 0).numpy().astype(int)
            errors = [np.mean((decoded - picture.astype(int)) ** 2) for picture in pictures]
            assert errors[step] <= min(errors)  # equal where the square is out of the picture
            assert 10 * np.log10(255**2 / errors[step]) > 25
            assert item["task"] == f"task {number % 2}"
            assert item["index"] == row
            assert np.allclose(item[contract.STATE_KEY], columns[contract.STATE_KEY][step])
            row += 1
    loader: Any = DataLoader(dataset, batch_size=4, sampler=EpisodeAwareSampler([0, 7, 8], [7, 8, 38], shuffle=True))
    assert sum(len(batch["index"]) for batch in loader) == 38


def _indices() -> dict[str, Any]:
    return {key: {"dtype": "int64", "shape": (1,)} for key in ("frame_index", "episode_index", "index", "task_index")}


def _write_histograms(lengths: tuple[int, ...]) -> dict[str, Any]:
    pictures = [_episode(length, number)[1] for number, length in enumerate(lengths)]
    return {KEY: sum(channel_histogram(picture) for episode in pictures for picture in episode)}


def _save_stats(root: Path, stats: dict[str, Any]) -> None:
    plain = {key: {name: value.tolist() for name, value in values.items()} for key, values in stats.items()}
    (root / "meta" / "stats.json").write_text(json.dumps(plain))


def test_joined_entries_and_columns_are_those_of_one_dataset_written_at_once(tmp_path: Path) -> None:
    """What counts through is counted through, places and times are new, and the rest is copied."""
    parts = [tmp_path / "a", tmp_path / "b", tmp_path / "c"]
    for number, part in enumerate(parts):
        _write(part, (5, 4), first=2 * number)
    join_datasets(parts, tmp_path / "joined")
    _write(tmp_path / "once", (5, 4) * 3)
    for key in (contract.STATE_KEY, contract.ACTION_KEY, "next.reward", *_indices(), "timestamp"):
        one, other = column(tmp_path / "joined", key), column(tmp_path / "once", key)
        assert one.dtype == other.dtype
        assert one.tobytes() == other.tobytes(), key
    tables = [pq.read_table(tmp_path / name / "meta" / "episodes") for name in ("joined", "once")]
    assert tables[0].num_rows == 6
    assert tables[0].column_names == tables[1].column_names
    for name in tables[1].column_names:
        joined, once = (table[name].to_pylist() for table in tables)
        if name == "tasks":
            assert joined == once
        else:
            np.testing.assert_allclose(np.array(joined, float), np.array(once, float), atol=1e-12, err_msg=name)
    info, expected = (json.loads((tmp_path / name / "meta" / "info.json").read_text()) for name in ("joined", "once"))
    assert info == expected


def test_lerobots_own_aggregation_takes_what_was_written(tmp_path: Path) -> None:
    for name in ("a", "b"):
        _write(tmp_path / name, (5, 6))
    roots = [tmp_path / "a", tmp_path / "b"]
    aggregate_datasets(["local/a", "local/b"], "local/both", roots=roots, aggr_root=tmp_path / "both")
    dataset = _open(tmp_path / "both")
    assert (dataset.num_episodes, dataset.num_frames) == (4, 22)
    assert dataset[21][KEY].shape == (3, 64, 48)


def test_nothing_of_a_failed_episode_stays(tmp_path: Path) -> None:
    columns, pictures = _episode(6, 0)

    def failing() -> Any:
        yield from ({KEY: picture} for picture in pictures[:4])
        raise RuntimeError("torn cable")

    with EncodingProcess() as encoder:
        writer = DatasetWriter(encoder, tmp_path / "data", 30, "arm", FEATURES, "h264")
        with pytest.raises(RuntimeError, match="torn cable"):
            writer.add(columns, "task", 6, failing())
        with pytest.raises(RuntimeError, match="6 frames expected, 4 given"):
            writer.add(columns, "task", 6, ({KEY: picture} for picture in pictures[:4]))
        writer.add(columns, "task", 6, ({KEY: picture} for picture in pictures))
        writer.finalize()
    assert _open(tmp_path / "data").num_frames == 6
    assert {path.name for path in (tmp_path / "data").iterdir()} == {"data", "meta", "videos"}


def test_statistics_come_from_evenly_spaced_frames_and_pixels() -> None:
    assert sampled_frames(1) == {0}
    assert sampled_frames(SAMPLED_FRAMES) == set(range(SAMPLED_FRAMES))
    many = sorted(sampled_frames(1000))
    assert (len(many), many[0], many[-1]) == (SAMPLED_FRAMES, 0, 999)
    picture = np.random.default_rng(0).integers(0, 256, (256, 320, 3), dtype=np.uint8)
    histogram = channel_histogram(picture)
    assert histogram.sum() == 3 * num_sampled_pixels(256, 320) == 3 * 64 * 64
    assert np.abs(histogram @ np.arange(256) / (64 * 64) - picture.mean((0, 1))).max() < 6
    small = picture[:60, :60]
    assert channel_histogram(small).sum() == small.size


def test_statistics_of_a_column_need_only_one_component_in_memory(tmp_path: Path) -> None:
    _write(tmp_path / "data", (40, 30))
    stats = dataset_statistics(tmp_path / "data", {contract.STATE_KEY: FEATURES[contract.STATE_KEY]}, {})
    expected = vector_statistics(column(tmp_path / "data", contract.STATE_KEY))
    for name, values in stats[contract.STATE_KEY].items():
        np.testing.assert_allclose(values, expected[name], rtol=1e-12, atol=1e-14)
    assert {path.name for path in tmp_path.iterdir()} == {"data"}


def test_modality_names_every_part() -> None:
    features = contract.dataset_features((64, 64))
    names = modality(features, contract.STATE_PARTS, contract.ACTION_PARTS)
    assert names["state"]["gripper_qpos"] == {"original_key": "observation.state", "start": 14, "end": 16}
    assert names["action"]["end_effector_rotation"] == {"original_key": "action", "start": 8, "end": 11}
    for kind, size in (("state", contract.STATE_SIZE), ("action", contract.ACTION_SIZE)):
        covered = [i for part in names[kind].values() for i in range(part["start"], part["end"])]
        assert covered == list(range(size))
    assert names["video"] == {camera: {"original_key": contract.image_key(camera)} for camera in contract.CAMERAS}
    assert names["annotation"] == {"human.task_description": {"original_key": "task_index"}}
    unknown = modality(features, (Part("half", ("a",)),), ())
    assert unknown["state"] == {"state": {"original_key": "observation.state", "start": 0, "end": 16}}


@pytest.mark.parametrize("place", ["assets", "data/assets"])  # the second in files of earlier versions
def test_converted_datasets_keep_what_replaying_needs(place: str, tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    with h5py.File(source, "a") as file:
        file["assets"].create_dataset("../../escaped.txt".replace("/", "\\"), data=np.zeros(3, np.uint8))
        file["assets/numbers"] = np.zeros(3)
        texture = file[f"assets/{TEXTURE}"][:].tobytes()
        file.move("assets", place)
    convert([source], tmp_path / "data", ConversionSettings())
    record = json.loads((tmp_path / "data" / "meta" / "robocasa" / "conversion.json").read_text())
    kept = tmp_path / "data" / "extras" / "assets" / record["sources"][0]["sha256"][:12]
    assert (kept / TEXTURE).read_bytes() == texture
    assert not (kept / "numbers").exists()
    names = json.loads((tmp_path / "data" / "meta" / "modality.json").read_text())
    assert list(names["video"]) == list(contract.CAMERAS)
