"""The benchmark of driving by hand: the command runs, and says how a step and the clock did."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "teleop_step.py"


@pytest.mark.slow
@pytest.mark.render
def test_a_driven_step_is_measured(tmp_path: Path) -> None:
    out = tmp_path / "result.json"
    done = subprocess.run(
        [sys.executable, str(BENCHMARK), "--seconds", "3", "--out", str(out)],
        cwd=BENCHMARK.parents[1],
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(out.read_text())
    for name in ("three_pictures", "four_pictures"):
        assert result[name]["step_ms"]["median"] > 0
        assert 0 < result["ratios"][f"real_time_{name}"] < 1.5
        assert name in done.stdout
    assert result["four_pictures"]["bytes_per_step"] > result["three_pictures"]["bytes_per_step"]
