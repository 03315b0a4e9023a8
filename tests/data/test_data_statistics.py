"""Exact pooled statistics, out of memory and in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocasa_lerobot import contract
from robocasa_lerobot.data import statistics
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.quantiles import QuantileSearch
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.statistics import QUANTILES, Part, pooled_statistics
from robocasa_lerobot.errors import UserError

LEVELS = [0.01, 0.1, 0.5, 0.9, 0.99]
LENGTHS = {"first": (4, 9), "second": (3, 25), "third": (5, 6)}  # episodes, frames of each


@pytest.fixture(scope="module")
def roots(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("data")
    return [
        write_fake_dataset(folder / name, episodes, length, image_size=32, seed=seed)
        for seed, (name, (episodes, length)) in enumerate(LENGTHS.items())
    ]


def mixture(roots: list[Path], weights: tuple[float, ...] | None = None, **loader: object) -> MixtureDataset:
    each = weights or (None,) * len(roots)
    members = [MemberConfig(str(root), weight=weight) for root, weight in zip(roots, each, strict=True)]
    return MixtureDataset(MixtureConfig(members), loader=LoaderConfig(**loader))  # type: ignore[arg-type]


def search(parts: list[tuple[np.ndarray, float]], dtype: type, blocks: int = 1) -> np.ndarray:
    found = QuantileSearch(parts[0][0].shape[1], LEVELS, np.dtype(dtype))
    for _ in range(found.passes):
        for values, weight in parts:
            for block in np.array_split(values, blocks):
                found.add(block, weight)
        found.narrow()
    return found.result()


def expected(parts: list[tuple[np.ndarray, float]]) -> np.ndarray:
    """By sorting: the smallest value that at least the level of the weight does not exceed."""
    values = np.concatenate([v for v, _ in parts])
    weights = np.concatenate([np.full(len(v), w) for v, w in parts])
    out = np.empty((len(LEVELS), values.shape[1]), values.dtype)
    for column in range(values.shape[1]):
        order = np.argsort(values[:, column], kind="stable")
        reached = np.cumsum(weights[order])
        places = [np.flatnonzero(reached >= (level - 1e-10) * reached[-1])[0] for level in LEVELS]
        out[:, column] = values[order[places], column]
    return out


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.lists(st.integers(1, 60), min_size=1, max_size=3),
    scale=st.sampled_from([1e-30, 1e-3, 1.0, 1e6, 1e30]),
    repeats=st.booleans(),
)
def test_quantiles_are_those_of_sorting(dtype: type, seed: int, sizes: list[int], scale: float, repeats: bool) -> None:
    generator = np.random.default_rng(seed)
    parts: list[tuple[np.ndarray, float]] = []
    for size in sizes:
        values = generator.normal(0, 1, (size, 3))
        values[:, 2] = 0.0 if repeats else values[:, 2]
        parts.append(((np.round(values) if repeats else values * scale).astype(dtype), generator.uniform(0.01, 5)))
    np.testing.assert_array_equal(search(parts, dtype, blocks=2), expected(parts))


def test_quantiles_agree_with_numpys() -> None:
    generator = np.random.default_rng(0)
    values, weights = generator.normal(0, 1, (4001, 2)).astype(np.float32), (1.0, 3.0)
    parts = [(values[:1500], weights[0]), (values[1500:], weights[1])]
    each = np.repeat(weights, (1500, 2501))
    for number, level in enumerate(LEVELS):
        wanted = [np.quantile(values[:, c], level, weights=each, method="inverted_cdf") for c in range(2)]
        assert search(parts, np.float32)[number].tolist() == wanted


def test_pooled_statistics_are_those_of_all_frames_at_once(roots: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(statistics, "_BLOCK", 4)  # frames: so that episodes are cut apart
    shares = (0.2, 0.5, 0.3)
    sources = [DatasetSource(root) for root in roots]
    episodes = [np.array([0, 1, 3]), np.array([2]), np.arange(5)]
    parts = [Part(*each) for each in zip(sources, episodes, shares, strict=True)]
    found = pooled_statistics(parts)
    chosen = [np.isin(s.columns["episode_index"], e) for s, e in zip(sources, episodes, strict=True)]
    weights = np.concatenate([np.full(c.sum(), share / c.sum()) for c, share in zip(chosen, shares, strict=True)])
    for key in (contract.STATE_KEY, contract.ACTION_KEY):
        values = np.concatenate([s.columns[key][c] for s, c in zip(sources, chosen, strict=True)]).astype(np.float64)
        mean = weights @ values
        np.testing.assert_allclose(found[key]["mean"], mean, rtol=0, atol=1e-15)
        np.testing.assert_allclose(found[key]["std"], np.sqrt(weights @ (values - mean) ** 2), atol=1e-12)
        np.testing.assert_array_equal(found[key]["min"], values.min(0))
        np.testing.assert_array_equal(found[key]["max"], values.max(0))
        for name, level in QUANTILES.items():
            wanted = [np.quantile(v, level - 1e-12, weights=weights, method="inverted_cdf") for v in values.T]
            np.testing.assert_array_equal(found[key][name], wanted, err_msg=name)
        assert found[key]["count"].tolist() == [27 + 25 + 30]


def test_standard_deviation_survives_a_large_offset() -> None:
    class Offset(DatasetSource):
        def __init__(self) -> None:
            self.features = {"x": {"dtype": "float32", "shape": (1,)}}
            self.starts, self.ends = np.array([0]), np.array([200_000])
            self.columns = {"x": np.tile(np.array([1e6, 1e6 + 1], np.float32), 100_000)}

    found = pooled_statistics([Part(Offset(), np.array([0]), 1.0)])["x"]
    assert found["mean"] == pytest.approx(1e6 + 0.5, abs=1e-6)
    assert found["std"] == pytest.approx(0.5, abs=1e-6)


def test_integers_keep_all_their_bits() -> None:
    big = 2**40
    values = np.array([[big], [big + 1], [big + 2], [big + 3]], np.float64)
    assert search([(values, 1.0)], np.float64)[:, 0].tolist() == [big, big, big + 1, big + 3, big + 3]


def test_values_that_are_not_finite_are_told(roots: list[Path]) -> None:
    source = DatasetSource(roots[0])
    source.columns[contract.ACTION_KEY][5, 2] = np.nan
    with pytest.raises(UserError, match="action has values that are not finite"):
        pooled_statistics([Part(source, np.arange(4), 1.0)])


def test_statistics_are_the_same_from_mapped_columns_and_from_the_cache(roots: list[Path], tmp_path: Path) -> None:
    plain = mixture(roots).statistics()
    settings: dict[str, Any] = {"cache_dir": str(tmp_path), "cache_columns_above_gb": 0.0, "cache_open_files": 1}
    for _ in range(2):
        stored = mixture(roots, **settings).statistics()
        assert stored.keys() == plain.keys()
        for key, values in plain.items():
            assert stored[key].keys() == values.keys()
            for name, value in values.items():
                np.testing.assert_array_equal(stored[key][name], value)
                assert stored[key][name].dtype == value.dtype
    assert len(list(tmp_path.glob("statistics_*.json"))) == 1
    other = mixture(roots, (1.0, 2.0, 3.0), **settings).statistics()
    assert len(list(tmp_path.glob("statistics_*.json"))) == 2
    assert not np.array_equal(other["action"]["mean"], plain["action"]["mean"])
    assert contract.IMAGE_KEYS[0] not in mixture(roots, **settings).statistics(images=False)
