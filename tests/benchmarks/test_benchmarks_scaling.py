"""The benchmark of several processes: what limits them is told right, and the command runs."""

from __future__ import annotations

import importlib
import json
import time
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("scaling_limits")


@pytest.fixture
def scaling(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("scaling")


@pytest.mark.parametrize(
    ("processes", "times_one", "cores", "processor_s", "memory_share", "said"),
    [
        (4, 3.9, 4.0, 0.010, 0.3, ""),
        (8, 7.6, 8.0, 0.010, 0.3, "as many processes as cores"),
        (8, 5.0, 7.9, 0.016, 0.3, "1.60x the processor: caches, memory or threads are shared; all cores are busy"),
        (4, 3.0, 4.0, 0.013, 0.3, "1.30x the processor"),
        (6, 4.0, 7.9, 0.010, 0.3, "all 8 cores are busy: one process uses 1.9"),
        (8, 2.0, 2.5, 0.010, 0.3, "waiting: 2.5 of 8 cores are busy"),
        (8, 7.9, 8.0, 0.010, 0.9, "memory: 90% in use"),
    ],
)
def test_the_nearest_wall_is_named(
    limits: ModuleType,
    processes: int,
    times_one: float,
    cores: float,
    processor_s: float,
    memory_share: float,
    said: str,
) -> None:
    use = limits.Use(cores, processor_s, 1.0, memory_share)
    found = limits.limit(processes, 8, times_one, use, limits.Use(1.9, 0.010, 1.0, 0.1))
    assert said in found
    assert bool(said) == bool(found)


def test_a_watch_sees_work_and_memory(limits: ModuleType) -> None:
    with limits.Watch() as watch:
        block = bytearray(300 * 2**20)
        block[::4096] = b"x" * len(block[::4096])
        end = time.perf_counter() + 1.0
        while time.perf_counter() < end:
            pass
    use = watch.use(100.0)
    assert use.cores > 0.5
    assert use.processor_s > 0.004
    assert 0.0 < use.memory_share < 1.0
    assert limits.Use.median([use, use, limits.Use(0.0, 0.0, 0.0, 0.0)]) == use
    assert len(block) > 0


def test_unknown_kinds_and_counts_are_refused(scaling: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert scaling.parse(["--processes", "8,2"]).processes == [1, 2, 8]
    with pytest.raises(SystemExit):
        scaling.parse(["--kinds", "stepping"])
    assert "steps_no_cameras, steps_three_cameras, evaluating, converting" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        scaling.parse(["--processes", "0"])


def check(scaling: ModuleType, kinds: tuple[str, ...], out: Path) -> None:
    """Run the command with one process and two, and look at what it writes."""
    options = ["--processes", "1,2", "--kinds", ",".join(kinds), "--repetitions", "1", "--seconds", "0.3"]
    assert scaling.main([*options, "--out", str(out)]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert set(result["ratios"]) == {f"{kind}_2" for kind in kinds}
    assert {"machine", "versions", "date"} <= set(result)
    for kind in kinds:
        one, two = result["kinds"][kind]["1"], result["kinds"][kind]["2"]
        assert two["times_one"] == pytest.approx(two["per_second"]["median"] / one["per_second"]["median"], abs=1e-3)
        assert one["times_one"] == 1.0
        assert one["processor_s"] > 0
        assert one["cores"] > 0


@pytest.mark.costly
def test_the_command_measures_steps(scaling: ModuleType, tmp_path: Path) -> None:
    check(scaling, ("steps_no_cameras",), tmp_path / "scaling.json")


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.timeout(1200)
def test_the_command_measures_every_kind(scaling: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scaling, "EVALUATED", ["CloseDrawer"])
    monkeypatch.setattr(scaling, "EPISODES", 1)
    check(scaling, scaling.KINDS, tmp_path / "scaling.json")
