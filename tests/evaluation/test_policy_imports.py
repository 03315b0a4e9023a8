"""Our own policies are evaluated with a LeRobot that has none of its extras, and act as with all of them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from robocasa_lerobot.evaluation.imports.policy_imports import POLICY_MODULES, policy_imports
from robocasa_lerobot.evaluation.records.results import TrialRecord, read_results

ROOT = Path(__file__).parents[2]
LEAN = ("robocasa_lerobot.evaluation.imports.lean_policies",)
EMBEDDED = (
    "import sys\nfrom robocasa_lerobot.cli import main\nif __name__ == '__main__': sys.exit(main(sys.argv[1:]))\n"
)
ENV = """
import json, os, pathlib, sys
from evaluation_env import SlideEnv

class Probe(SlideEnv):
    def reset(self, **arguments):
        pathlib.Path(os.environ["PROBE"]).write_text(json.dumps(sorted(sys.modules)))
        return super().reset(**arguments)
"""


def trial_of(program: Sequence[str], checkpoint: Path, folder: Path) -> tuple[set[str], TrialRecord]:
    """What a worker of an evaluation has imported, and the record of its trial."""
    folder.mkdir()
    (folder / "probe_env.py").write_text(ENV)
    paths = [str(ROOT), str(ROOT / "tests" / "support"), str(folder)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PROBE": str(folder / "modules.json")}
    options = ["--env.factory=probe_env:Probe", "--env.tasks=Slide", "--env.horizon=20", "--trials=1", "--workers=1"]
    command = [*program, f"--policy.path={checkpoint}", *options, "--videos=0", "--report=false", "--out=out"]
    subprocess.run([sys.executable, *command], cwd=folder, env=environment, capture_output=True, text=True, check=True)
    (record,) = read_results(folder / "out" / "trials.jsonl").trials
    return set(json.loads((folder / "modules.json").read_text())), record


def test_a_policy_acts_the_same_without_what_only_others_need(checkpoint: Path, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(EMBEDDED)
    lean, record = trial_of([str(ROOT / "eval.py")], checkpoint, tmp_path / "command")
    whole, other = trial_of([str(program), "eval"], checkpoint, tmp_path / "embedded")
    assert "lerobot.policies.factory" in lean & whole
    assert whole - lean >= {"transformers", "datasets"}
    assert record.error is None
    assert record.trajectory == other.trajectory


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
