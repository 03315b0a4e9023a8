"""What a mixture draws: frequencies under every weighting, the same samples for any number of processes, resuming."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset, StepBatches
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.sampler import FramePool, MixtureSampler, mixture_probabilities
from robocasa_lerobot.errors import UnknownNameError

SIZES = ((1, 4), (2, 8), (4, 16))  # episodes, frames of each
DRAWS = 40_000
SIGNIFICANCE = 1e-3  # seeds are fixed: a passing test passes always

# Each weighting as settings of the mixture, and the probabilities of its three datasets worked out by hand.
FRAMES = np.array([4.0, 16.0, 64.0])
WEIGHTINGS: dict[str, tuple[dict[str, Any], Any]] = {
    "equal datasets": ({"alpha": 0.0}, [1 / 3, 1 / 3, 1 / 3]),
    "benchmark": ({}, FRAMES**0.4 / (FRAMES**0.4).sum()),
    "equal frames": ({"alpha": 1.0}, [4 / 84, 16 / 84, 64 / 84]),
    "gr00t": ({"alpha": 1.4}, FRAMES**1.4 / (FRAMES**1.4).sum()),
    "weights": ({"weights": (1.0, 2.0, 5.0)}, [1 / 8, 2 / 8, 5 / 8]),
    "classes": (
        {"groups": ("real", "same_views", "other"), "shares": {"real": 0.15, "same_views": 0.3, "other": 0.55}},
        [0.15, 0.30, 0.55],
    ),
    "two in a class": ({"groups": ("a", "b", "a"), "shares": {"a": 0.3, "b": 0.7}}, [0.15, 0.7, 0.15]),
    "weights in a class": (
        {"groups": ("a", "b", "a"), "shares": {"a": 3, "b": 7}, "weights": (1.0, 1.0, 2.0)},
        [0.1, 0.7, 0.2],
    ),
}


@pytest.fixture(scope="module")
def roots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("data")
    return [
        write_fake_dataset(folder / f"dataset{number}", episodes, length, image_size=32, seed=number)
        for number, (episodes, length) in enumerate(SIZES)
    ]


def open_datasets(
    roots: list[Path],
    weights: tuple[float, ...] | None = None,
    groups: tuple[str, ...] | None = None,
    loader: LoaderConfig | None = None,
    **settings: Any,
) -> MixtureDataset:
    nothing = (None,) * len(roots)
    members = [
        MemberConfig(str(root), weight=weight, group=group)
        for root, weight, group in zip(roots, weights or nothing, groups or nothing, strict=True)
    ]
    return MixtureDataset(MixtureConfig(members, **settings), loader=loader)


def p_value(counts: np.ndarray, expected: np.ndarray) -> float:
    """Of Pearson's chi-square test: the probability of counts at least so far from the expected ones."""
    assert counts[expected == 0].sum() == 0
    counts, expected = counts[expected > 0], expected[expected > 0]
    assert expected.min() > 5  # where the approximation by the chi-square distribution holds
    statistic = ((counts - expected) ** 2 / expected).sum()
    half = torch.tensor([(len(counts) - 1) / 2, statistic / 2], dtype=torch.float64)
    return float(torch.special.gammaincc(half[0], half[1]))


def frame_counts(sampler: MixtureSampler, position: int = 0) -> np.ndarray:
    members, frames = sampler.draw(position, DRAWS)
    return np.bincount(members * 64 + frames, minlength=3 * 64).reshape(3, 64)


def expected_counts(probabilities: Any) -> np.ndarray:
    out = np.zeros((3, 64))
    for member, (episodes, length) in enumerate(SIZES):
        out[member, : episodes * length] = DRAWS * probabilities[member] / (episodes * length)
    return out


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_frequencies_of_datasets_and_frames_are_those_of_the_weighting(name: str, roots: list[Path]) -> None:
    settings, probabilities = WEIGHTINGS[name]
    dataset = open_datasets(roots, **settings)
    np.testing.assert_allclose(dataset.probabilities, probabilities, rtol=1e-12)
    counts = frame_counts(dataset.sampler(seed=3))
    expected = expected_counts(probabilities)
    assert p_value(counts, expected) > SIGNIFICANCE
    assert p_value(counts.sum(axis=1), expected.sum(axis=1)) > SIGNIFICANCE


def test_the_chi_square_test_tells_one_weighting_from_another(roots: list[Path]) -> None:
    counts = frame_counts(open_datasets(roots, weights=(1.0, 2.0, 5.0)).sampler(seed=3))
    assert p_value(counts.sum(axis=1), DRAWS * np.array([0.14, 0.25, 0.61])) < SIGNIFICANCE
    counts[2, :8] -= 40  # a tenth of what is there
    counts[2, 8:16] += 40
    assert p_value(counts, expected_counts([1 / 8, 2 / 8, 5 / 8])) < SIGNIFICANCE


@pytest.mark.parametrize("position", [2**24 - DRAWS // 2, 2**32 - DRAWS // 2, 2**53])
def test_frequencies_hold_at_late_samples(position: int, roots: list[Path]) -> None:
    sampler = open_datasets(roots, weights=(1.0, 2.0, 5.0)).sampler(seed=0)
    assert p_value(frame_counts(sampler, position), expected_counts([1 / 8, 2 / 8, 5 / 8])) > SIGNIFICANCE


@pytest.mark.parametrize("size", [2**24 + 7, 2**33 - 1])
def test_every_frame_of_more_than_float32_can_count_is_as_likely(size: int) -> None:
    """Remainders and ranges of the frames: a float32 would leave out all odd frames above 2^24."""
    runs = FramePool(np.array([0, size + 5]), np.array([size - 3, 3]))  # frame numbers jump after the first episode
    _, frames = MixtureSampler([runs], np.array([1.0]), seed=1).draw(0, DRAWS)
    assert p_value(np.bincount(frames % 7, minlength=7), np.full(7, DRAWS / 7)) > SIGNIFICANCE
    assert p_value(np.bincount(frames * 16 // size, minlength=16)[:16], np.full(16, DRAWS / 16)) > SIGNIFICANCE


def test_a_member_of_hundreds_is_found_by_its_probability() -> None:
    generator = np.random.default_rng(0)
    lengths = generator.integers(10_000, 3_000_000, 550)
    probabilities = mixture_probabilities(lengths.tolist(), alpha=0.4)
    pools = [FramePool(np.array([0]), np.array([n])) for n in lengths]
    members, frames = MixtureSampler(pools, probabilities, seed=0).draw(0, 200_000)
    assert p_value(np.bincount(members, minlength=550), 200_000 * probabilities) > SIGNIFICANCE
    assert (frames < lengths[members]).all()


def test_an_episode_first_makes_the_frames_of_short_ones_count_more() -> None:
    """Episodes of 2, 30 and, in two runs with a gap, 8 frames; and a dataset that begins elsewhere."""
    runs = FramePool(np.array([0, 2, 32, 40]), np.array([2, 30, 5, 3]), np.array([2, 30, 8]))
    other = FramePool(np.array([10, 14]), np.array([4, 1]))
    expected = np.zeros((2, 64))
    expected[0, 0:2], expected[0, 2:32], expected[0, [*range(32, 37), 40, 41, 42]] = 1 / 6, 1 / 90, 1 / 24
    expected[1, 10:14], expected[1, 14] = 1 / 8, 1 / 2
    sampler = MixtureSampler([runs, other], np.array([0.6, 0.4]), seed=5, episodes_first=True)
    members, frames = sampler.draw(0, DRAWS)
    counts = np.bincount(members * 64 + frames, minlength=2 * 64).reshape(2, 64)
    expected *= DRAWS * np.array([[0.6], [0.4]])
    assert p_value(counts, expected) > SIGNIFICANCE
    together = np.concatenate([sampler.draw(at, 7)[1] for at in range(0, 70, 7)])
    np.testing.assert_array_equal(together, frames[:70])  # any position alone


def test_a_mixture_draws_episodes_first_where_it_says_so(roots: list[Path]) -> None:
    frames, episodes = open_datasets(roots), open_datasets(roots, draw="episodes")
    assert episodes.sampler(seed=0).episodes_first
    assert not frames.sampler(seed=0).episodes_first
    assert frames.selection_fingerprint != episodes.selection_fingerprint
    assert "an episode first" in episodes.describe()
    with pytest.raises(UnknownNameError, match="Did you mean 'episodes'"):
        MixtureConfig([MemberConfig("x")], draw="episode")


@given(
    batch=st.sampled_from([12, 24]),
    processes=st.sampled_from([1, 2, 3, 4, 6]),
    first=st.integers(0, 2**40),
    seed=st.integers(0, 2**62),
)
def test_any_number_of_processes_draws_the_same_samples(batch: int, processes: int, first: int, seed: int) -> None:
    pools = [FramePool(np.array([0]), np.array([n])) for n in (5, 70, 2**30)]
    sampler = MixtureSampler(pools, np.array([0.2, 0.3, 0.5]), seed)

    class Numbers(MixtureDataset):
        def __init__(self) -> None: ...

        def batch(self, members: Any, frames: Any) -> dict[str, Any]:
            return {"drawn": list(zip(members.tolist(), frames.tolist(), strict=True))}

    alone = StepBatches(Numbers(), sampler, batch)
    shares = [StepBatches(Numbers(), sampler, batch, rank, processes) for rank in range(processes)]
    for step in range(first, first + 3):
        assert [pair for share in shares for pair in share[step]["drawn"]] == alone[step]["drawn"]


def test_resuming_reads_the_samples_that_were_due(roots: list[Path]) -> None:
    """Also with another number of processes, and after other batches were read."""
    dataset = open_datasets(roots)
    whole = [StepBatches(dataset, dataset.sampler(seed=7), 6)[step] for step in range(6)]
    again = open_datasets(roots)
    for step in (5, 3, 4):
        shares = [StepBatches(again, again.sampler(seed=7), 6, rank, 2)[step] for rank in range(2)]
        for key, value in whole[step].items():
            if isinstance(value, torch.Tensor):
                assert torch.equal(torch.cat([share[key] for share in shares]), value), key
            else:
                assert [entry for share in shares for entry in share[key]] == value
    other = StepBatches(again, again.sampler(seed=8), 6)[3]
    assert not torch.equal(other["action"], whole[3]["action"])
