"""Which demos are taken: filter keys, the benchmark's own sampling rule, names and ranges."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from convert_layouts import stored_actions, write_robocasa_v01
from convert_support import write_demos

from robocasa_lerobot import cli
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.selection import sample, select
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.errors import UserError

NAMES = tuple(f"demo_{i}" for i in range(12))


@pytest.fixture(scope="module")
def masked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_robocasa_v01(tmp_path_factory.mktemp("masked") / "demo_im128.hdf5", size=32)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_demos(tmp_path_factory.mktemp("plain") / "demos.hdf5", [2] * len(NAMES), images=16)


def test_a_sample_is_the_benchmarks() -> None:
    # The rule as the benchmark's loader has it: seed the module's generator, shuffle the episodes' numbers, take N.
    state = random.getstate()
    random.seed(0)
    numbers = list(range(100))
    random.shuffle(numbers)
    random.setstate(state)
    names = [f"demo_{i}" for i in range(100)]
    for count in (1, 10, 30, 99):
        assert set(sample(names, count, 0)) == {f"demo_{i}" for i in numbers[:count]}
    assert sample(names, 10, 1) != sample(names, 10, 0)
    assert sample(names, 100, 0) == tuple(names)
    assert sample(names, 500, 0) == tuple(names)
    assert random.getstate() == state


@pytest.mark.parametrize(
    ("filter_key", "demos", "expected"),
    [
        (None, None, NAMES[:4]),
        ("2_demos", None, ("demo_1", "demo_3")),  # the file's own list, not a sample
        ("train", None, NAMES[:3]),
        ("valid", None, ("demo_3",)),
        ("3_demos", None, sample(NAMES[:4], 3, 0)),
        ("10_demos", None, NAMES[:4]),
        ("train", "2", sample(NAMES[:3], 2, 0)),
        (None, "50%", sample(NAMES[:4], 2, 0)),
        (None, "1%", sample(NAMES[:4], 1, 0)),
    ],
)
def test_filter_keys(masked: Path, filter_key: str | None, demos: str | None, expected: tuple[str, ...]) -> None:
    with DemoFile(masked) as file:
        assert select(file, filter_key, demos) == expected


@pytest.mark.parametrize(
    ("demos", "expected"),
    [
        ("demo_3", (3,)),
        ("demo_10,demo_2", (2, 10)),
        ("3-5", (3, 4, 5)),
        ("9-40,demo_0", (0, 9, 10, 11)),
        (" demo_1 , 1-2 ", (1, 2)),
    ],
)
def test_names_and_ranges(plain: Path, demos: str, expected: tuple[int, ...]) -> None:
    with DemoFile(plain) as file:
        assert select(file, None, demos) == tuple(f"demo_{i}" for i in expected)


@pytest.mark.parametrize(
    ("filter_key", "demos", "message"),
    [
        ("trian", None, "'train'"),
        ("0_demos", None, "filter key"),
        ("gone", None, "demo_77"),
        (None, "demo_9", "unknown demo 'demo_9'. Did you mean"),
        (None, "7-9", "no demo"),
        (None, "0", "at least one"),
        (None, "0%", "0 %"),
        (None, "demo_1,,demo_2", "cannot be read"),
        ("train", "demo_1", "exclude each other"),
    ],
)
def test_mistakes_are_named(masked: Path, filter_key: str | None, demos: str | None, message: str) -> None:
    with pytest.raises(UserError, match=message):
        make_plan([masked], ConversionSettings(filter_key=filter_key, demos=demos))


def test_every_file_is_sampled_by_itself_and_the_record_says_which(
    masked: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from robocasa_lerobot.convert.verify import verify
    from robocasa_lerobot.convert.writing.statistics import column

    other = write_robocasa_v01(tmp_path / "b.hdf5", (5, 6, 3, 2, 4), size=32)
    out = tmp_path / "out"
    assert cli.main(["convert", str(masked), str(other), "--out", str(out), "--demos", "2", "--demos-seed", "3"]) == 0
    record = json.loads((out / "meta" / "robocasa" / "conversion.json").read_text())
    expected = [list(sample(NAMES[:4], 2, 3)), list(sample(NAMES[:5], 2, 3))]
    assert [source["demos"] for source in record["sources"]] == expected
    actions = column(out, "action")
    parts = [stored_actions(path, names) for path, names in zip((masked, other), expected, strict=True)]
    assert actions.tobytes() == b"".join(part.tobytes() for part in parts)
    assert verify(out).passed
