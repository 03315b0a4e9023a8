"""Reading with bounded memory and file handles: videos, mapped columns, and bad files."""

from __future__ import annotations

import json
import pickle
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.video_utils import decode_video_frames
from torchvision.transforms import v2

from robocasa_lerobot import contract
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.column_file import map_columns
from robocasa_lerobot.data.reading.pictures import PictureReader
from robocasa_lerobot.data.reading.resize import AT_ONCE, resize_images
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.reading.video_reader import VideoReader
from robocasa_lerobot.errors import UnknownNameError, UserError

KEY = contract.IMAGE_KEYS[0]
COPIES, OPEN = 9, 4
WINDOWS = {
    KEY: [-0.05, 0.0],
    contract.IMAGE_KEYS[1]: [-0.05, 0.0],
    contract.IMAGE_KEYS[2]: [0.0],
    contract.STATE_KEY: [-0.05, 0.0],
    contract.ACTION_KEY: [i / 20 for i in range(10)],
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=30, image_size=32)


@pytest.fixture(scope="module")
def many(root: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("many")
    return [Path(shutil.copytree(root, folder / f"copy{number}")) for number in range(COPIES)]


def open_many(roots: list[Path], **loader: object) -> MixtureDataset:
    config = MixtureConfig([MemberConfig(str(path)) for path in roots], alpha=0.0)
    dataset = MixtureDataset(config, loader=LoaderConfig(**loader))  # type: ignore[arg-type]
    dataset.set_windows(WINDOWS)
    return dataset


def video_of(root: Path, episode: int = 0) -> tuple[Path, float]:
    return DatasetSource(root).video(episode, KEY)


def open_files_under(folder: Path) -> int:
    """Number of files in the folder that this process has open or mapped."""
    handles = {path.resolve() for path in Path("/proc/self/fd").iterdir() if path.exists()}
    mapped = {line.split(maxsplit=5)[5] for line in Path("/proc/self/maps").read_text().splitlines() if "/" in line}
    return sum(folder in path.parents for path in handles | {Path(name) for name in mapped})


def test_pictures_equal_lerobots_in_any_order(root: Path) -> None:
    reader, (path, start) = VideoReader(2), video_of(root, 2)
    for frames in ([0], [29], [0], [7, 3, 3, 28], list(range(30)), [29], [12]):
        times = start + np.array(frames) / 20
        wanted = decode_video_frames(path, times.tolist(), 1e-4, backend="pyav", return_uint8=True)
        assert torch.equal(reader.frames(path, times), wanted)
    assert len(reader) == 1


def test_pictures_of_the_end_of_the_video_do_not_end_reading(root: Path) -> None:
    """A decoder that has been drained gives nothing more unless it is reset."""
    reader, (path, start) = VideoReader(1), video_of(root, 3)
    last = start + np.array([29]) / 20
    first = reader.frames(path, last)
    for _ in range(3):
        assert torch.equal(reader.frames(path, last), first)
    assert not torch.equal(reader.frames(path, start + np.array([0.0])), first)


def test_frames_of_several_episodes_come_as_asked(root: Path) -> None:
    source, reader = DatasetSource(root), PictureReader(2)
    indices = np.array([119, 0, 30, 29, 0, 65, 31])
    pictures = reader.frames(source, KEY, indices, (32, 32))
    assert pictures.is_contiguous()
    for index, picture in zip(indices, pictures, strict=True):
        episode = int(index) // 30
        path, start = source.video(episode, KEY)
        at = start + (int(index) - 30 * episode) / 20
        assert torch.equal(picture, decode_video_frames(path, [at], 1e-4, backend="pyav", return_uint8=True)[0])


@pytest.mark.parametrize("size", [(16, 16), (24, 20), (48, 48), (32, 32)])
def test_pictures_are_resized_alike_one_by_one_and_together(size: tuple[int, int]) -> None:
    """As torchvision does, to the byte, in whichever order the bytes of a picture lie."""
    pictures = torch.randint(
        0, 256, (2 * AT_ONCE + 1, 3, 32, 32), dtype=torch.uint8, generator=torch.Generator().manual_seed(0)
    )
    wanted = v2.functional.resize(pictures.float(), list(size), antialias=True).round().clamp(0, 255).to(torch.uint8)
    last = pictures.permute(0, 2, 3, 1).contiguous().permute(0, 3, 1, 2)
    for images in (pictures, last):
        assert torch.equal(resize_images(images, size), wanted)
        assert torch.equal(torch.stack([resize_images(one, size) for one in images]), wanted)
    together = resize_images(pictures[None], size)
    assert torch.equal(together[0], wanted)


def test_damaged_and_short_videos_are_told(root: Path, tmp_path: Path) -> None:
    reader, (path, _) = VideoReader(2), video_of(root)
    with pytest.raises(UserError, match=r"no picture at 500\.0000 s"):
        reader.frames(path, np.array([500.0]))
    with pytest.raises(UserError, match="cannot be decoded"):
        reader.frames(tmp_path / "gone.mp4", np.array([0.0]))
    for kept in (1000, 300):  # of so few bytes PyAV opens a file without a stream
        (tmp_path / "damaged.mp4").write_bytes(path.read_bytes()[:kept])
        with pytest.raises(UserError, match="cannot be decoded"):
            reader.frames(tmp_path / "damaged.mp4", np.array([0.0]))
    assert reader.frames(path, np.array([0.0])).shape == (1, 3, 32, 32)


def test_open_files_are_bounded_and_samples_are_the_same(many: list[Path], tmp_path: Path) -> None:
    plain = open_many(many)
    bounded = open_many(many, cache_open_files=OPEN, cache_columns_above_gb=0.0, cache_dir=str(tmp_path))
    wanted, batches = (StepBatches(d, d.sampler(seed=0), 8) for d in (plain, bounded))
    for step in range(6):
        batch = batches[step]
        for key, value in wanted[step].items():
            assert torch.equal(batch[key], value) if isinstance(value, torch.Tensor) else batch[key] == value, key
        assert len(bounded._pictures.videos) <= OPEN
        assert sum("columns" in source.__dict__ for source in bounded.sources.values()) <= OPEN
    assert 1 <= open_files_under(tmp_path) <= OPEN
    plain._pictures.videos.close()
    assert 1 <= open_files_under(many[0].parent) <= OPEN


def test_open_frame_caches_are_bounded_and_pictures_are_the_same(many: list[Path], tmp_path: Path) -> None:
    plain, bounded = open_many(many), open_many(many, cache_open_files=OPEN)
    assert bounded.cache_frames(tmp_path)
    for _ in range(2):  # what was closed is opened again
        for number in range(COPIES):
            wanted, item = plain[120 * number + 31], bounded[120 * number + 31]
            assert all(torch.equal(item[key], wanted[key]) for key in contract.IMAGE_KEYS)
            assert sum("_arrays" in cache.__dict__ for cache in bounded._caches.values()) <= OPEN
            assert 1 <= open_files_under(tmp_path) <= OPEN * len(contract.IMAGE_KEYS)


def test_workers_get_a_dataset_without_open_files(many: list[Path], tmp_path: Path) -> None:
    dataset = open_many(many, cache_open_files=OPEN, cache_columns_above_gb=0.0, cache_dir=str(tmp_path))
    first = dataset[31]
    copy = pickle.loads(pickle.dumps(dataset))
    assert len(copy._pictures.videos) == 0
    assert not any("columns" in source.__dict__ for source in copy.sources.values())
    assert all(torch.equal(copy[31][key], first[key]) for key in WINDOWS)


def test_mapped_columns_need_a_folder_and_are_made_once(root: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"loader\.cache_dir"):
        open_many([root], cache_columns_above_gb=0.0)[0]
    source = DatasetSource(root)
    plain = source.columns
    source.close()
    source.column_cache = tmp_path
    mapped = source.columns
    assert mapped.keys() == plain.keys()
    for key, column in plain.items():
        assert mapped[key].dtype == column.dtype
        np.testing.assert_array_equal(mapped[key], column)
    (file,) = tmp_path.glob("*.npy")
    made = file.stat().st_mtime_ns
    source.close()
    assert source.columns["index"][-1] == 119
    assert file.stat().st_mtime_ns == made


def test_a_killed_mapping_is_made_again(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = DatasetSource(root)
    source.column_cache = tmp_path

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        _ = source.columns
    monkeypatch.undo()
    assert [path.name for path in tmp_path.glob("*.npy") if ".partial" not in path.name] == []
    assert source.columns["index"].tolist() == list(range(120))
    assert not list(tmp_path.glob("*.partial*"))


def test_missing_frames_are_told(root: Path, tmp_path: Path) -> None:
    source = DatasetSource(root)
    row = np.dtype([("index", np.int64), ("action", np.float32, (12,))])
    for total in (119, 121):
        with pytest.raises(UserError, match="missing or out of order"):
            map_columns(source.root, row, total, f"total{total}", tmp_path)
    assert not [path for path in tmp_path.glob("*.npy") if ".partial" not in path.name]
    broken = shutil.copytree(root, tmp_path / "broken")
    file = next((broken / "data").glob("*/*.parquet"))
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(UserError, match=r"\.parquet: cannot be read: .* Get or convert the dataset again"):
        DatasetSource(broken).columns["action"]


def test_pictures_that_are_stored_singly_equal_lerobots(tmp_path: Path) -> None:
    feature = {"dtype": "image", "shape": (16, 16, 3), "names": ["height", "width", "channel"]}
    features = {KEY: feature, "action": {"dtype": "float32", "shape": (2,), "names": ["x", "y"]}}
    written = LeRobotDataset.create(
        "single", 20, features, root=tmp_path / "single", use_videos=False, video_backend="pyav"
    )
    generator = np.random.default_rng(0)
    for _ in range(2):
        for _ in range(5):
            picture = generator.integers(0, 256, (16, 16, 3), dtype=np.uint8)
            written.add_frame({KEY: picture, "action": np.zeros(2, np.float32), "task": "look"})
        written.save_episode()
    written.finalize()
    windows = {KEY: [-0.05, 0.0]}
    dataset = MixtureDataset(MixtureConfig([MemberConfig(str(tmp_path / "single"))]))
    dataset.set_windows(windows)
    reference = LeRobotDataset(
        "single", root=tmp_path / "single", delta_timestamps=windows, return_uint8=True, video_backend="pyav"
    )
    for index in (0, 4, 5, 9):
        wanted = reference[index]
        assert dataset[index][KEY].dtype == torch.uint8
        assert torch.equal(dataset[index][KEY].float() / 255, wanted[KEY])  # which are floats from 0 to 1
        assert torch.equal(dataset[index][f"{KEY}_is_pad"], wanted[f"{KEY}_is_pad"])


def test_pictures_of_some_cameras_only(root: Path, tmp_path: Path) -> None:
    whole = open_many([root])
    wrist = "robot0_eye_in_hand"
    some = open_many([root], cameras=[wrist], cache_dir=str(tmp_path))
    assert some.meta.camera_keys == [contract.image_key(wrist)]
    one, other = whole[3], some[3]
    unseen = tuple(contract.IMAGE_KEYS[:2])
    assert set(one) - set(other) == {key for key in one if key.startswith(unseen)}
    assert torch.equal(one[contract.image_key(wrist)], other[contract.image_key(wrist)])
    assert some.cache_frames(tmp_path)
    assert torch.equal(some[3][contract.image_key(wrist)], other[contract.image_key(wrist)])
    assert set(whole.statistics()) - set(some.statistics()) == set(unseen)
    with pytest.raises(UnknownNameError, match="robot0_eye_in_hand"):
        open_many([root], cameras=["robot0_eye_in_hnad"])
    with pytest.raises(UserError, match="cameras"):
        LoaderConfig(cameras=[])


def test_datasets_with_different_cameras_go_together_in_those_that_both_have(root: Path, tmp_path: Path) -> None:
    left = contract.IMAGE_KEYS[0]
    other = Path(shutil.copytree(root, tmp_path / "other"))
    info = json.loads((other / "meta/info.json").read_text())
    del info["features"][left]
    (other / "meta/info.json").write_text(json.dumps(info))
    for path in other.glob("meta/episodes/*/*.parquet"):
        table = pq.read_table(path)
        pq.write_table(table.drop_columns([name for name in table.column_names if left in name]), path)
    for roots in ([root, other], [other, root]):
        with pytest.raises(UserError, match=f"feature '{left}' is missing in {other}"):
            open_many(roots)
        with pytest.raises(UserError, match=f"feature '{left}' is missing in {other}"):
            open_many(roots, cameras=[contract.CAMERAS[0]])
        both = open_many(roots, cameras=list(contract.CAMERAS[1:]))
        assert both.meta.camera_keys == list(contract.IMAGE_KEYS[1:])
        assert set(both.statistics()) & set(contract.IMAGE_KEYS) == set(contract.IMAGE_KEYS[1:])
        batch = both.batch(np.array([0, 1]), np.array([3, 3]))
        assert torch.equal(*batch[contract.IMAGE_KEYS[2]])
        assert left not in batch
