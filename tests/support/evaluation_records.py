"""A run's header and a trial's record, made up."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.records.results import (
    PolicyInfo,
    RunHeader,
    Seconds,
    StageSummary,
    TermSummary,
    TrialRecord,
)


def header(label: str = "finetune-000400", **policy: Any) -> RunHeader:
    values = {"path": "p", "type": "t", "fingerprint": "f", "phase": "finetune", "step": 400, **policy}
    return RunHeader(
        protocol="custom",
        task_sets={},
        tasks=["OpenDrawer"],
        missing_tasks=[],
        trials=10,
        seed=0,
        split="target",
        render_preset="fast",
        image_size=64,
        horizon_rule="task",
        horizon_multiplier=1.0,
        success_rule="any_step",
        success_hold_steps=1,
        executed_steps=None,
        perturbations={"none": {}},
        settings={"seed": 0, "split": "target"},
        policies={label: PolicyInfo(label=label, **values)},
        versions={"robocasa_lerobot": "0"},
        git_commit=None,
        device="cpu",
        machine={"cores": "2"},
        started="2026-01-01T00:00:00+00:00",
    )


def record(**changes: object) -> TrialRecord:
    values: dict[str, object] = {
        "run": header().id,
        "label": "finetune-000400",
        "task": "OpenDrawer",
        "perturbation": "none",
        "trial": 0,
        "seed": 1,
        "policy_seed": 2,
        "split": "target",
        "layout_id": 1,
        "style_id": 1,
        "instruction": "Open the drawer.",
        "horizon": 100,
        "horizon_multiplier": 1.0,
        "success": True,
        "first_success_step": 80,
        "steps": 80,
        "terms": {"drawer_open": TermSummary(80, 0.0125, True)},
        "stages": StageSummary(total=1, met=1, given=0, next=None),
        "outcome": "finished",
        "error": None,
        "attempts": 1,
        "first_outcome": None,
        "first_error": None,
        "warnings": {},
        "trajectory": "00",
        "video": None,
        "seconds": Seconds(total=1.5),
        "finished": "2026-01-01T00:00:00+00:00",
    }
    return TrialRecord(**{**values, **changes})  # type: ignore[arg-type]


def write_results(folder: Path, trials: list[dict[str, Any]]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for changes in trials:
        changes = dict(changes)
        one = header(str(changes.get("label", "finetune-000400")), **changes.pop("policy", {}))
        trials_file.append(folder / results.TRIALS_FILE, one)
        trials_file.append(folder / results.TRIALS_FILE, record(run=one.id, **changes))
    return folder


def make_checkpoint(folder: Path, size: int = 64, weights: bytes = b"w") -> Path:
    folder.mkdir(parents=True)
    features = {key: {"type": "VISUAL", "shape": [3, size, size]} for key in contract.IMAGE_KEYS}
    (folder / "config.json").write_text(json.dumps({"type": "act", "input_features": features}))
    (folder / "model.safetensors").write_bytes(weights)
    return folder
