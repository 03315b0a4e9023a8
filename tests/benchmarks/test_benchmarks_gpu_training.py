"""The benchmark of training steps on a GPU: its ratios, what it does where a variant fails, and that it runs."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from robocasa_lerobot.errors import UserError

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def gpu_training(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("gpu_training")


def measured(rate: float, loss: float) -> dict[str, Any]:
    return {
        "samples_per_second": rate,
        "seconds_per_step": 64 / rate,
        "data_share": 0.0,
        "peak_gib": 1.0,
        "loss": loss,
    }


def test_variants_have_names_of_their_own_and_the_plain_ones_come_first(gpu_training: ModuleType) -> None:
    found = gpu_training.variants(["demo", "compact"])
    assert [variant.name for variant in found[:2]] == ["demo_64_float32", "compact_64_float32"]
    assert len({variant.name for variant in found}) == len(found)
    assert "demo_512_bf16_compiled" in {variant.name for variant in found}


def test_rates_are_told_by_the_plain_one_and_losses_by_the_same_batch(gpu_training: ModuleType) -> None:
    found = gpu_training.ratios(
        {
            "demo_64_float32": measured(1000.0, 0.02),
            "demo_512_float32": measured(6000.0, 0.01),
            "demo_512_bf16": measured(8000.0, 0.011),
            "demo_64_float32_x2": measured(1500.0, 0.02),
        }
    )
    assert found == {
        "samples_demo_512_float32": 6.0,
        "samples_demo_512_bf16": 8.0,
        "loss_demo_512_bf16": 1.1,
        "samples_demo_64_float32_x2": 1.5,
    }


@pytest.mark.slow
def test_it_runs_and_goes_on_after_a_variant_that_fails(
    gpu_training: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = gpu_training.measure

    def measure(variant: Any, *rest: Any) -> Any:
        if variant.together > 1:
            raise UserError("the card is full")
        return real(variant, *rest)

    monkeypatch.setattr(gpu_training, "measure", measure)
    out = tmp_path / "result.json"
    words = ["--device=cpu", "--presets=demo", "--variants=demo_64_float32,demo_64_float32_x2", "--window=1"]
    assert gpu_training.main([*words, f"--output={out}"]) == 0
    result = json.loads(out.read_text())
    assert set(result["variants"]) == {"demo_64_float32"}
    assert result["variants"]["demo_64_float32"]["samples_per_second"] > 0
    assert result["failed"] == {"demo_64_float32_x2": "the card is full"}
    assert "demo_64_float32" in capsys.readouterr().out
    assert gpu_training.main(["--presets=demo", "--variants=demo_65", f"--output={out}"]) == 2
