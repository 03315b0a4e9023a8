"""What computes policies, and the envs beside them: imported once, by the process that workers are forked from."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

from robocasa_lerobot.evaluation.actors.checkpoint import CheckpointError, find_pretrained
from robocasa_lerobot.policies.needs import needs_no_others

LEROBOT_MODULES = ("lerobot.policies.factory", "lerobot.envs.utils")
POLICY_MODULES = (
    *LEROBOT_MODULES,
    *("torch", "onnx", "onnxruntime"),
    "robocasa_lerobot.policies.diffusion_transformer.modeling_diffusion_transformer",
    "robocasa_lerobot.envs.kitchen_env",
)
# A folder that is no checkpoint, or has other files than LeRobot writes: whoever loads it says so.
_UNREADABLE = (CheckpointError, OSError, ValueError, LookupError, AttributeError, TypeError)
_LEAN_POLICIES = "robocasa_lerobot.evaluation.imports.lean_policies"


def policy_imports(checkpoints: Collection[Path]) -> tuple[str, ...]:
    """Names of the modules that the policies in these folders need: none for none, and fewer for our own."""
    if not checkpoints:
        return ()
    return (_LEAN_POLICIES,) if all(map(_is_lean, checkpoints)) else POLICY_MODULES


def _is_lean(checkpoint: Path) -> bool:
    try:
        folder = find_pretrained(checkpoint)
        saved = [json.loads(file.read_text(encoding="utf-8")) for file in folder.glob("policy_*processor.json")]
        steps = [step.get("registry_name") or "" for processor in saved for step in processor["steps"]]
        return needs_no_others(json.loads((folder / "config.json").read_text(encoding="utf-8")), steps)
    except _UNREADABLE:
        return False
