"""Columns of LeRobot v2 datasets beyond state and action: their names, and what becomes of them in HDF5."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import v2_support as v2

from robocasa_lerobot import contract
from robocasa_lerobot.convert.export import ExportSettings, export
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.settings import ConversionSettings

JOINTS = ["waist", "shoulder", "elbow"]


@pytest.fixture(scope="module")
def converted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset whose arm also tells its efforts and says its mode in words."""
    folder = tmp_path_factory.mktemp("columns")
    source = v2.write_dataset(folder / "in", (6,), cameras=contract.CAMERAS[:1])

    def measure(columns: dict[str, Any]) -> None:
        columns["observation.effort"] = v2.vectors(np.ones((6, 3), np.float32))
        columns["mode"] = ["careful"] * 6

    v2.edit_table(source, 0, measure)

    def declare(info: dict[str, Any]) -> None:
        info["features"]["observation.effort"] = {"dtype": "float32", "shape": [3], "names": {"motors": JOINTS}}
        info["features"]["mode"] = {"dtype": "string", "shape": [1], "names": None}

    v2.edit_json(source / "meta" / "info.json", declare)
    return convert([source], folder / "out", ConversionSettings(), workers=1).root


def test_every_column_keeps_the_names_of_its_components(converted: Path) -> None:
    features = json.loads((converted / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    assert features["observation.effort"] == {"dtype": "float32", "shape": [3], "names": JOINTS}
    assert features["mode"]["names"] is None


def test_export_says_which_columns_it_leaves_out(converted: Path, tmp_path: Path) -> None:
    notes = export(converted, tmp_path / "out.hdf5", ExportSettings(images=False)).notes
    assert notes == ("columns observation.effort, mode have no place in HDF5 files of this kind: left out",)
