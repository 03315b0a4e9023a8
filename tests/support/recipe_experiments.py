"""Experiments of a step or two whose data our demonstrators make by recipes of their own registry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]


def made_dataset(source: str, task: str = "CloseDrawer", **make: Any) -> dict[str, Any]:
    """One demonstration of a task at 64 pixels in a registry's words; `make` is the rest of its recipe."""
    recipe = {"episodes": "few", "image_size": 64, **make}
    return {"path": source + "/{task}", "tasks": [task], "split": "pretrain", "source": source, "make": recipe}


def experiment_of(folder: Path, datasets: list[dict[str, Any]], phases: list[dict[str, Any]]) -> Path:
    """File of an experiment that trains the demo's policy for a step in each phase, beside its registry in `folder`."""
    registry = {"root": str(folder / "data"), "episodes": {"few": 1}, "datasets": datasets}
    (folder / "registry.yaml").write_text(yaml.safe_dump(registry))
    content = {
        "name": "made",
        "output_dir": str(folder / "out"),
        "registry": str(folder / "registry.yaml"),
        "policy": str(ROOT / "configs/policies/diffusion_transformer_demo.yaml"),
        "device": "cpu",
        "defaults": {"steps": 1, "batch_size": 4, "statistics": "keep"},
        "phases": phases,
    }
    (folder / "made.yaml").write_text(yaml.safe_dump(content))
    return folder / "made.yaml"
