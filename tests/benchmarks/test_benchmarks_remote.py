"""The benchmark of remote policies runs, and its ratios are those of what it measured."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.costly
def test_the_command_measures_all_protocols_and_four_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    bench = importlib.import_module("remote_overhead")
    monkeypatch.setattr(bench, "COMPUTE_MS", 20.0)
    file = tmp_path / "remote_overhead.json"
    assert bench.main(["--quick", "--output", str(file)]) == 0
    result = json.loads(file.read_text())
    assert {"machine", "versions", "date", "ratios"} <= set(result)
    assert set(result["overhead_ms"]) == {"openpi", "gr00t", "vla_eval"}
    for protocol, found in result["overhead_ms"].items():
        median = found["as_rendered"]["milliseconds"]["median"]
        assert 0 < median
        assert result["ratios"][f"10 ms over a request of {protocol}"] == pytest.approx(10 / median)
    rates = {name: values["median"] for name, values in result["requests_per_second"].items()}
    assert set(rates) == {"own", "one_worker", "4_workers"}
    assert result["ratios"]["4 workers over the server's own rate"] == pytest.approx(rates["4_workers"] / rates["own"])
    assert 0 < rates["own"] <= 50
