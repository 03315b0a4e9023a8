"""Sampling, mixtures, statistics and the frame cache, on a tiny dataset made for the tests."""

from __future__ import annotations

import json
import pickle
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import contract
from robocasa_lerobot.data import mixture as mixtures
from robocasa_lerobot.data.fake import INSTRUCTIONS, write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading import frame_cache
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.sampler import FramePool, MixtureSampler, mixture_probabilities
from robocasa_lerobot.errors import UserError

WINDOWS = {
    **{key: [-0.05, 0.0] for key in (*contract.IMAGE_KEYS, contract.STATE_KEY)},
    contract.ACTION_KEY: [i / 20 for i in range(-1, 9)],
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=9, image_size=32)


def mixture(root: Path, **changes: object) -> MixtureDataset:
    first = MemberConfig(str(root), tasks=["OpenDrawer"])
    second = MemberConfig(str(root), tasks=["CloseDrawer"])
    dataset = MixtureDataset(MixtureConfig([first, second], **changes))  # type: ignore[arg-type]
    dataset.set_windows(WINDOWS)
    return dataset


def pools(*lengths: int) -> list[FramePool]:
    return [FramePool(np.array([100 * i]), np.array([n])) for i, n in enumerate(lengths)]


def test_pool_enumerates_the_frames_of_its_runs() -> None:
    pool = FramePool(np.array([3, 10, 20]), np.array([2, 1, 3]))
    assert pool.frame(np.arange(pool.size)).tolist() == [3, 4, 10, 20, 21, 22]


@given(position=st.integers(0, 2**60), count=st.integers(1, 40), split=st.integers(0, 40), seed=st.integers(0, 2**63))
def test_samples_follow_from_their_position_alone(position: int, count: int, split: int, seed: int) -> None:
    sampler = MixtureSampler(pools(7, 50), np.array([0.3, 0.7]), seed)
    members, frames = sampler.draw(position, count)
    split = min(split, count - 1)
    again_members, again_frames = sampler.draw(position + split, count - split)
    assert members[split:].tolist() == again_members.tolist()
    assert frames[split:].tolist() == again_frames.tolist()
    assert ((frames >= 100 * members) & (frames < 100 * members + np.array([7, 50])[members])).all()


def test_sample_frequencies_are_those_of_the_mixture() -> None:
    """Chi-square over (member, frame) cells: below the 99.9 % point of its distribution, about df + 3.3 sqrt(2 df)."""
    weights, lengths, draws = np.array([0.2, 0.5, 0.3]), (5, 20, 1), 20_000
    members, frames = MixtureSampler(pools(*lengths), weights, seed=1).draw(0, draws)
    cells = np.bincount(members * 100 + frames % 100, minlength=300).reshape(3, 100)
    expected = np.zeros((3, 100))
    for member, (weight, length) in enumerate(zip(weights, lengths, strict=True)):
        expected[member, :length] = draws * weight / length
    assert cells[expected == 0].sum() == 0
    freedom = (expected > 0).sum() - 1
    chi_square = ((cells - expected)[expected > 0] ** 2 / expected[expected > 0]).sum()
    assert chi_square < freedom + 3.3 * np.sqrt(2 * freedom)


def test_more_frames_than_float32_can_count() -> None:
    size = 2**40
    sampler = MixtureSampler([FramePool(np.array([0]), np.array([size]))], np.array([1.0]), seed=0)
    _, frames = sampler.draw(0, 1000)
    assert frames.max() > 0.99 * size
    assert len(set((frames % 2).tolist())) == 2


@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0, 1.4])
def test_probabilities_are_frames_to_a_power(alpha: float) -> None:
    probabilities = mixture_probabilities([10, 1000], alpha=alpha)
    assert probabilities.sum() == pytest.approx(1)
    assert probabilities[1] / probabilities[0] == pytest.approx(100**alpha)


def test_weights_win_over_alpha() -> None:
    assert mixture_probabilities([10, 1000], [1, 3]).tolist() == [0.25, 0.75]


def test_config_mistakes_are_told() -> None:
    with pytest.raises(UserError, match="no members"):
        MixtureConfig([])
    with pytest.raises(UserError, match="give all or none"):
        MixtureConfig([MemberConfig("a", weight=1.0), MemberConfig("b")])
    with pytest.raises(UserError, match="above 0"):
        MemberConfig("a", weight=0.0)


def test_items_equal_those_of_lerobot_with_and_without_cache(root: Path, tmp_path: Path) -> None:
    reference = LeRobotDataset("fake", root=root, delta_timestamps=WINDOWS, return_uint8=True, video_backend="pyav")
    plain, cached = mixture(root), mixture(root)
    assert cached.cache_frames(tmp_path)
    for index in (0, 1, 8, 9, 20, 35):
        wanted = reference[index]
        for dataset in (plain, cached):
            for item in (dataset[index], dataset[len(reference) + index]):  # the dataset is there for each member
                assert item.keys() == wanted.keys()
                assert item["task"] == wanted["task"] == dataset.meta.tasks[int(item["task_index"])]
                for key in wanted.keys() - {"task", "task_index"}:
                    assert item[key].dtype == wanted[key].dtype, key
                    assert torch.equal(item[key], wanted[key]), key


def test_batch_keeps_the_order_asked_for(root: Path) -> None:
    dataset = mixture(root)
    members, frames = np.array([1, 0, 1, 0]), np.array([5, 30, 11, 2])
    batch = dataset.batch(members, frames)
    assert batch["index"].tolist() == frames.tolist()
    assert batch["task"] == [dataset[int(f)]["task"] for f in frames]
    assert batch["action_is_pad"].shape == (4, 10)


def test_sampler_draws_each_member_only_from_its_episodes(root: Path) -> None:
    dataset = mixture(root)
    members, frames = dataset.sampler(seed=0, drop_last_frames=2).draw(0, 500)
    episodes, places = frames // 9, frames % 9
    assert set(episodes[members == 0].tolist()) == {0, 2}
    assert set(episodes[members == 1].tolist()) == {1, 3}
    assert places.max() == 6
    assert dataset.sampler(0, drop_last_frames=50).draw(0, 50)[1].max() % 9 == 0


def test_processes_see_the_samples_of_one(root: Path) -> None:
    dataset = mixture(root)
    sampler = dataset.sampler(seed=0)
    alone = StepBatches(dataset, sampler, 8)[3]["index"].tolist()
    together = [StepBatches(dataset, sampler, 8, rank, 2)[3]["index"].tolist() for rank in range(2)]
    assert together[0] + together[1] == alone
    with pytest.raises(UserError, match="multiple"):
        StepBatches(dataset, sampler, 8, 0, 3)


def test_pictures_can_be_handed_out_smaller(root: Path, tmp_path: Path) -> None:
    plain, cached = mixture(root), mixture(root)
    for dataset in (plain, cached):
        dataset.set_picture_size((16, 16))
    assert cached.cache_frames(tmp_path)
    key = contract.IMAGE_KEYS[0]
    assert plain[3][key].shape == (2, 3, 16, 16)
    assert torch.equal(plain[3][key], cached[3][key])
    assert plain.meta.features[key]["shape"] == (32, 32, 3)
    resized = MixtureDataset(plain.config, image_size=16)
    assert resized.meta.features[key]["shape"] == (16, 16, 3)
    assert resized[3][key].shape == (3, 16, 16)


def test_dataset_travels_to_worker_processes(root: Path, tmp_path: Path) -> None:
    dataset = mixture(root)
    dataset.cache_frames(tmp_path)
    sent = pickle.dumps(dataset)
    assert len(sent) < 200_000
    copy = pickle.loads(sent)
    assert torch.equal(copy[2][contract.IMAGE_KEYS[0]], dataset[2][contract.IMAGE_KEYS[0]])


def kill_filling(source: DatasetSource, folder: Path, videos: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin a cache that is killed after so many videos of episodes."""
    real, decoded = frame_cache._decode, list[str]()

    def counting(source: DatasetSource, key: str, *rest: Any) -> torch.Tensor:
        if len(decoded) >= videos:
            raise KeyboardInterrupt
        decoded.append(key)
        return real(source, key, *rest)

    with monkeypatch.context() as patched:
        patched.setattr(frame_cache, "_decode", counting)
        patched.setattr(frame_cache, "cores_here", lambda: 2)  # one episode after the other
        with pytest.raises(KeyboardInterrupt):
            frame_cache.open_or_build(source, list(contract.IMAGE_KEYS), (32, 32), folder)


def test_cache_is_reused_continued_and_tied_to_the_data(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, keys, decoded = DatasetSource(root), list(contract.IMAGE_KEYS), []
    real = frame_cache._decode
    kill_filling(source, tmp_path / "c", 6, monkeypatch)
    assert not [p for p in (tmp_path / "c").iterdir() if p.is_dir() and not p.name.endswith(".partial")]
    monkeypatch.setattr(frame_cache, "_decode", lambda s, k, e, *r: decoded.append(e) or real(s, k, e, *r))
    cache = frame_cache.open_or_build(source, keys, (32, 32), tmp_path / "c")
    assert set(decoded) == {2, 3}  # the first two episodes were kept
    monkeypatch.setattr(frame_cache, "cores_here", lambda: 8)  # several episodes at once
    whole = frame_cache.open_or_build(source, keys, (32, 32), tmp_path / "whole")
    assert torch.equal(cache.frames(keys[0], np.arange(36)), whole.frames(keys[0], np.arange(36)))
    decoded.clear()
    frame_cache.open_or_build(source, keys, (32, 32), tmp_path / "c")
    assert not decoded
    other = write_fake_dataset(tmp_path / "fake", episodes=2, length=4, image_size=32, seed=1)
    frame_cache.open_or_build(DatasetSource(other), keys, (32, 32), tmp_path / "c")
    assert decoded


def test_a_killed_filling_needs_no_disk_for_what_it_has_already(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, keys, size = DatasetSource(root), list(contract.IMAGE_KEYS), (32, 32)
    kill_filling(source, tmp_path, 9, monkeypatch)  # three of four episodes
    free = SimpleNamespace(free=frame_cache.cache_bytes(source, keys, size) // 2)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: free)
    with pytest.raises(UserError, match=r"the frame cache needs .* GB but"):
        frame_cache.open_or_build(source, keys, size, tmp_path / "other")
    frame_cache.open_or_build(source, keys, size, tmp_path)


def test_cache_that_does_not_fit_is_left_out(root: Path, tmp_path: Path) -> None:
    dataset = mixture(root)
    assert not dataset.cache_frames(tmp_path, budget_bytes=36 * 3 * 3 * 32 * 32 - 1)
    assert dataset.cache_frames(tmp_path, budget_bytes=36 * 3 * 3 * 32 * 32)


@pytest.mark.skipif(not Path("/proc/self/smaps").is_file(), reason="only Linux tells how a file is mapped")
def test_a_cache_larger_than_memory_is_read_frame_by_frame(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    indices, key = np.array([[35, 0], [7, 7]]), contract.IMAGE_KEYS[1]
    read = []
    for memory in (2 * 36 * 3 * 3 * 32 * 32, 2 * 36 * 3 * 3 * 32 * 32 - 2):
        monkeypatch.setattr(mixtures, "memory_bytes", lambda memory=memory: memory)
        dataset = mixture(root)
        assert dataset.cache_frames(tmp_path)
        (cache,) = pickle.loads(pickle.dumps(list(dataset._caches.values())))
        read.append((cache.scattered, cache.frames(key, indices)))
        maps = Path("/proc/self/smaps").read_text(encoding="utf-8")
        flags = re.findall(rf"{re.escape(str(cache.folder))}/{key}\.npy\n(?:.*\n)*?VmFlags:(.*)", maps)
        cache.close()
        assert any("rr" in one.split() for one in flags) == cache.scattered, "as the system was told"
    (at_once, whole), (singly, parts) = read
    assert (at_once, singly) == (False, True)
    assert torch.equal(whole, parts)


def test_statistics_are_those_of_the_frames_weighted_by_the_mixture(root: Path) -> None:
    stats = mixture(root, alpha=1.0).statistics()
    reference = LeRobotDataset("fake", root=root, video_backend="pyav")
    actions = np.stack([reference[i]["action"] for i in range(36)])
    for name, value in (("mean", actions.mean(0)), ("std", actions.std(0)), ("min", actions.min(0))):
        np.testing.assert_allclose(stats["action"][name], value, atol=1e-6)
    for name, level in (("q01", 0.01), ("q50", 0.5), ("q99", 0.99)):
        wanted = np.quantile(actions, level, axis=0, method="inverted_cdf")
        np.testing.assert_allclose(stats["action"][name], wanted, atol=1e-6)
    uneven = MixtureDataset(
        MixtureConfig(
            [
                MemberConfig(str(root), tasks=["OpenDrawer"], weight=3.0),
                MemberConfig(str(root), tasks=["CloseDrawer"], weight=1.0),
            ]
        )
    ).statistics()["action"]
    gripper = contract.ACTION_SLICES["gripper_close"].start  # +1 to open and -1 to close the drawer, in this dataset
    assert uneven["mean"][gripper] == pytest.approx(0.5)
    assert uneven["std"][gripper] == pytest.approx(np.sqrt(1 - 0.25))
    assert (uneven["min"][gripper], uneven["max"][gripper], uneven["q50"][gripper]) == (-1, 1, 1)


def test_image_statistics_pool_the_episodes(root: Path) -> None:
    key = contract.IMAGE_KEYS[0]
    pooled = mixture(root, alpha=1.0).statistics()[key]
    whole = LeRobotDataset("fake", root=root, video_backend="pyav").meta.stats[key]
    for name in ("mean", "std", "min", "max"):
        assert pooled[name].shape == (3, 1, 1)
        np.testing.assert_allclose(pooled[name], whole[name], rtol=1e-4)
    single = MixtureDataset(MixtureConfig([MemberConfig(str(root), episodes=[2])])).statistics()[key]
    dataset = mixture(root)
    pictures = np.stack([np.asarray(dataset[i][key][1]) for i in range(18, 27)]) / 255
    np.testing.assert_allclose(single["mean"].ravel(), pictures.mean((0, 2, 3)), atol=0.02)  # lossy video


def test_wrong_datasets_are_told(root: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no dataset at"):
        MixtureDataset(MixtureConfig([MemberConfig(str(tmp_path / "nothing"))]))
    assert not (tmp_path / "nothing").exists()
    with pytest.raises(UserError, match="Did you mean 'OpenDrawer'"):
        MixtureDataset(MixtureConfig([MemberConfig(str(root), tasks=["OpenDraw"])]))
    with pytest.raises(UserError, match="no episode 7"):
        MixtureDataset(MixtureConfig([MemberConfig(str(root), episodes=[1, 7])]))
    other = write_fake_dataset(tmp_path / "other", episodes=1, length=4, image_size=16)
    members = [MemberConfig(str(root)), MemberConfig(str(other))]
    with pytest.raises(UserError, match=r"loader\.image_size"):
        MixtureDataset(MixtureConfig(members))
    assert len(MixtureDataset(MixtureConfig(members), image_size=16)) == 40
    old = shutil.copytree(other, tmp_path / "old")
    info = json.loads((old / "meta/info.json").read_text())
    (old / "meta/info.json").write_text(json.dumps({**info, "codebase_version": "v2.1"}))
    with pytest.raises(UserError, match=r"expected v3\.0"):
        DatasetSource(old)
    named = json.dumps(info).replace("robot0_eye_in_hand", "chest")
    (old / "meta/info.json").write_text(named)
    with pytest.raises(UserError, match=r"chest' is missing in .*other, and not in .*old\. Name .*`loader\.cameras`"):
        MixtureDataset(MixtureConfig([MemberConfig(str(other)), MemberConfig(str(old))]))
    (old / "meta/info.json").write_text(named[:50])
    with pytest.raises(UserError, match=r"info\.json: not valid JSON"):
        DatasetSource(old)
    shutil.rmtree(other / "meta/robocasa")
    with pytest.raises(UserError, match="Leave `tasks` out"):
        DatasetSource(other).select(MemberConfig(str(other), ["OpenDrawer"]))


def test_fake_dataset_is_the_same_for_a_seed_and_holds_the_contract(root: Path, tmp_path: Path) -> None:
    again = write_fake_dataset(tmp_path / "fake", episodes=4, length=9, image_size=32)
    first, second = DatasetSource(root), DatasetSource(again)
    np.testing.assert_array_equal(first.columns["action"], second.columns["action"])
    assert set(first.instructions) == {INSTRUCTIONS[task] for task in ("OpenDrawer", "CloseDrawer")}
    for key, feature in contract.dataset_features((32, 32)).items():
        assert tuple(first.features[key]["shape"]) == tuple(feature["shape"])


def test_batch_over_two_datasets_is_put_together_in_order(root: Path, tmp_path: Path) -> None:
    other = write_fake_dataset(tmp_path / "other", episodes=1, length=4, image_size=32, seed=5, tasks=["CloseDrawer"])
    dataset = MixtureDataset(MixtureConfig([MemberConfig(str(root)), MemberConfig(str(other))]))
    members, frames = np.array([1, 0, 1, 0]), np.array([3, 12, 0, 1])
    batch = dataset.batch(members, frames)
    for i, (member, frame) in enumerate(zip(members, frames, strict=True)):
        item = dataset[int(frame) + 36 * int(member)]
        assert batch["task"][i] == item["task"] == dataset.meta.tasks[int(item["task_index"])]
        assert torch.equal(batch["action"][i], item["action"])
        assert torch.equal(batch[contract.IMAGE_KEYS[1]][i], item[contract.IMAGE_KEYS[1]])
