"""Our own policies are evaluated with a LeRobot that has none of its extras, and act as with all of them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.evaluation.imports.policy_imports import POLICY_MODULES, policy_imports
from robocasa_lerobot.evaluation.records.results import TrialRecord, read_results

ROOT = Path(__file__).parents[2]
LEAN = ("robocasa_lerobot.evaluation.imports.lean_policies",)
ENV = """
import json, os, pathlib, sys
from evaluation_env import SlideEnv

class Probe(SlideEnv):
    def reset(self, **arguments):
        pathlib.Path(os.environ["PROBE"]).write_text(json.dumps(sorted(sys.modules)))
        return super().reset(**arguments)
"""


def trial_in(folder: Path) -> tuple[set[str], TrialRecord]:
    """What the worker of an evaluation had imported, and the record of its trial."""
    (record,) = read_results(folder / "out" / "trials.jsonl").trials
    return set(json.loads((folder / "modules.json").read_text())), record


def test_a_policy_acts_the_same_without_what_only_others_need(
    checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "probe_env.py").write_text(ENV)
    monkeypatch.syspath_prepend(tmp_path)
    options = ["--env.factory=probe_env:Probe", "--env.tasks=Slide", "--env.horizon=20", "--trials=1", "--workers=1"]
    options += [f"--policy.path={checkpoint}", "--videos=0", "--report=false"]
    found = {}
    for name in ("command", "embedded"):
        folder = tmp_path / name
        folder.mkdir()
        monkeypatch.setenv("PROBE", str(folder / "modules.json"))
        arguments = [*options, f"--out={folder / 'out'}"]
        if name == "command":
            environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
            subprocess.run([sys.executable, str(ROOT / "eval.py"), *arguments], env=environment, check=True)
        else:
            assert cli.main(["eval", *arguments]) == 0
        found[name] = trial_in(folder)
    (lean, record), (whole, other) = found["command"], found["embedded"]
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
