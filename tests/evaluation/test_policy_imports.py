"""Our own policies are evaluated with a LeRobot that has none of its extras, and act as with all of them."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny_checkpoint import SIZE

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ChunkRequest
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.imports.policy_imports import POLICY_MODULES, policy_imports

LEAN = ("robocasa_lerobot.evaluation.imports.lean_policies",)
PROGRAM = """
import json, sys
from robocasa_lerobot.evaluation.imports import lean_policies
sys.path += json.loads(sys.argv[2])
import test_policy_imports as this
actions = this.actions_of(this.Path(sys.argv[1]))
print(json.dumps([actions.tolist(), sorted(sys.modules)]))
"""


def actions_of(checkpoint: Path) -> np.ndarray:
    policy = ChunkPolicy(LoadedCheckpoint(read_source(str(checkpoint)), "cpu", None), width=1)
    rng = np.random.default_rng(0)
    observations = tuple(
        {
            "pixels": {c: rng.integers(0, 255, (SIZE, SIZE, 3), dtype=np.uint8) for c in contract.CAMERAS},
            "agent_pos": rng.normal(size=contract.STATE_SIZE),
        }
        for _ in range(policy.shape.history)
    )
    (reply,) = policy.predict([ChunkRequest("label", observations, "open the drawer", seed=3, number=0)])
    return np.asarray(reply.actions)


def test_a_policy_acts_the_same_without_what_only_others_need(checkpoint: Path) -> None:
    assert all(map(importlib.util.find_spec, ("transformers", "datasets", "scipy")))  # else nothing is compared
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(checkpoint), json.dumps(sys.path)],
        capture_output=True,
        text=True,
        check=True,
    )
    actions, modules = json.loads(done.stdout.splitlines()[-1])
    assert not {"transformers", "peft", "datasets"} & set(modules)
    assert "lerobot.policies.factory" in modules
    np.testing.assert_array_equal(np.asarray(actions), actions_of(checkpoint))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, LEAN),
        ({"text_encoder": "clip"}, POLICY_MODULES),
        ({"use_peft": True}, POLICY_MODULES),
        ({"type": "flow_vla"}, POLICY_MODULES),
        ({"type": "act"}, POLICY_MODULES),
        ({"type": None}, POLICY_MODULES),
    ],
)
def test_what_is_left_out_depends_on_the_policy(
    checkpoint: Path, tmp_path: Path, changes: dict[str, Any], expected: tuple[str, ...]
) -> None:
    changed = tmp_path / "pretrained_model"
    shutil.copytree(checkpoint, changed)
    config = json.loads((changed / "config.json").read_text())
    (changed / "config.json").write_text(json.dumps({**config, **changes}))
    assert policy_imports([changed]) == expected
    assert policy_imports([checkpoint, changed]) == expected
    assert policy_imports([tmp_path]) == expected  # as a user gives it
    assert policy_imports([]) == ()


def test_lerobots_tokenizers_need_what_would_be_left_out(checkpoint: Path, tmp_path: Path) -> None:
    changed = tmp_path / "pretrained_model"
    shutil.copytree(checkpoint, changed)
    file = changed / "policy_preprocessor.json"
    saved = json.loads(file.read_text())
    file.write_text(json.dumps({**saved, "steps": [*saved["steps"], {"registry_name": "tokenizer_processor"}]}))
    assert policy_imports([changed]) == POLICY_MODULES


@pytest.mark.parametrize("text", ["", "[]", "{}"])
def test_a_folder_that_is_no_checkpoint_leaves_nothing_out(tmp_path: Path, text: str) -> None:
    assert policy_imports([tmp_path]) == POLICY_MODULES
    (tmp_path / "config.json").write_text(text)
    (tmp_path / "model.safetensors").write_bytes(b"")
    assert policy_imports([tmp_path]) == POLICY_MODULES
