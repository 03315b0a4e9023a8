"""Files that are added to a dataset made from LeRobot v2 after its shards were joined: GR00T's and RoboCasa's files."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.lerobot_v2.dataset import EXTRAS, V2Dataset
from robocasa_lerobot.convert.lerobot_v2.plan import SOURCE_FORMAT, V2Plan

# Taken over as they are where the source has them.
_KEPT = ("meta/embodiment.json", f"{EXTRAS}/dataset_meta.json")


def finish_dataset(plan: V2Plan, merged: Path) -> None:
    """Keep `modality.json`, `embodiment.json` and the collection's description of the (first) source."""
    source = V2Dataset(Path(plan.sources[0].file))
    for name in _KEPT:
        if (source.root / name).is_file():
            (merged / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source.root / name, merged / name)
    if source.modality:
        text = json.dumps(_modality(plan, source), indent=4, ensure_ascii=False) + "\n"
        (merged / "meta" / "modality.json").write_text(text, encoding="utf-8")


def conversion_facts(plan: V2Plan, episodes: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What `conversion.json` says of a conversion from LeRobot v2, beyond what all conversions have."""
    reasons: dict[str, dict[str, int]] = {}
    for line in episodes:
        for camera, reason in line["reencoded"].items():
            counts = reasons.setdefault(camera, {})
            counts[reason] = counts.get(reason, 0) + 1
    return {
        "source_format": SOURCE_FORMAT,
        "source_versions": [V2Dataset(Path(source.file)).version for source in plan.sources],
        "notes": list(plan.notes),
        "videos": {
            camera.name: {
                "copied": len(episodes) - sum(reasons.get(camera.name, {}).values()),
                "reencoded": reasons.get(camera.name, {}),
            }
            for camera in plan.cameras
        },
    }


def _modality(plan: V2Plan, source: V2Dataset) -> dict[str, Any]:
    keys = {key: contract.image_key(camera) for camera, key in plan.camera_keys}
    modality = dict(source.modality)
    video = modality.get("video")
    if isinstance(video, dict):
        modality["video"] = {
            name: entry | {"original_key": keys[str(entry.get("original_key"))]}
            for name, entry in video.items()
            if isinstance(entry, dict) and str(entry.get("original_key")) in keys
        }
    for column in plan.columns:
        if column.order is not None:
            kind = "state" if column.name == contract.STATE_KEY else "action"
            parts = contract.STATE_PARTS if kind == "state" else contract.ACTION_PARTS
            modality[kind] = {name: modality[kind][name] | entry for name, entry in _slices(parts).items()}
    return modality


def _slices(parts: Sequence[Part]) -> dict[str, dict[str, int]]:
    return {name: {"start": where.start, "end": where.stop} for name, where in contract.slices(parts).items()}
