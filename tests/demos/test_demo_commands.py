"""What is typed after `demos`, `generate` and `prepare` is what is made: every option reaches the settings."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.corrections.disturbances import DisturbedSettings
from robocasa_lerobot.demos import recording, replay
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.generate.mimicgen.template import read_json_template
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources import prepare
from robocasa_lerobot.demos.generate.sources.rules import CutRules
from robocasa_lerobot.errors import UserError

TASK = "CloseDrawer"
KITCHENS = (
    f"--tasks={TASK} --episodes=3 --split=pretrain --layouts=-1,12 --styles=4,5 --seed=9 --action-noise=0.05 "
    "--start-within=0.3 --images --image-size=64 --workers=2 --keep-failures"
).split()
ASKED = {
    "task": TASK, "episodes": 3, "split": "pretrain", "layouts": (-1, 12), "styles": (4, 5), "seed": 9,
    "action_noise": 0.05, "start_within_m": 0.3, "images": True, "image_size": 64, "varied": False,
}  # fmt: skip

Recorded = Callable[..., tuple[RecordingSettings, dict[str, Any]]]


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> Recorded:
    """Runs a command up to the recording; its settings, and what `record_tasks` is told besides."""
    calls: list[tuple[RecordingSettings, dict[str, Any]]] = []

    def note(settings: list[RecordingSettings], out: Path, **others: Any) -> None:
        (one,) = settings
        calls.append((one, {"out": out, **others}))
        raise UserError("as far as this test goes")

    monkeypatch.setattr(recording, "record_tasks", note)

    def run(*line: str) -> tuple[RecordingSettings, dict[str, Any]]:
        assert cli.main(list(line)) == 2
        return calls.pop()

    return run


def usual_fields(settings: RecordingSettings) -> set[str]:
    """Fields that have their defaults: which a test would leave out."""
    return {field.name for field in dataclasses.fields(settings) if getattr(settings, field.name) == field.default}


def test_demos_takes_every_option(tmp_path: Path, recorded: Recorded) -> None:
    settings, others = recorded("demos", *KITCHENS, "--plain", f"--out={tmp_path}")
    assert settings == RecordingSettings(**ASKED)
    assert usual_fields(settings) == set()
    assert others == {"out": tmp_path, "workers": 2, "keep_failures": True}
    disturbed, _ = recorded("demos", *KITCHENS, "--disturbances=2", f"--out={tmp_path}")
    assert disturbed == DisturbedSettings(**{**ASKED, "varied": True}, disturbances=2)
    plain, _ = recorded("demos", f"--tasks={TASK}", f"--out={tmp_path}")
    assert plain == RecordingSettings(TASK, 20)


def test_generate_takes_every_option(tmp_path: Path, recorded: Recorded, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        GenerationSettings, "of", lambda source, **values: GenerationSettings(source=str(source), **values)
    )
    rules, template = tmp_path / "rules.yaml", tmp_path / "template.json"
    rules.write_text("drawers open: {near_m: 0.1, frame: handle}")
    template.write_text(json.dumps({"task": {"task_spec": {"subtask_1": {"object_ref": "drawer"}}}}))
    cut = json.dumps({"drawers open": dataclasses.asdict(CutRules(near_m=0.1, frame="handle"))})
    line = ["generate", "--source=sources", *KITCHENS, f"--out={tmp_path / 'out'}", "--first-sources=4"]
    contacts = ["--base=copy", "--bridge=line", "--select=random", "--spread=0.7", "--cap=0.5"]
    settings, others = recorded(*line, *contacts, f"--rules={rules}")
    assert settings == GenerationSettings(
        **ASKED, source="sources", base="copy", bridge="line", select="random", spread=0.7, cap=0.5, first_sources=4,
        rules=cut,
    )  # fmt: skip
    # The sources are not looked at here; the others are of another method.
    assert usual_fields(settings) == {"sources", "method", "template"}
    assert others == {"out": tmp_path / "out", "workers": 2, "keep_failures": True}
    settings, _ = recorded(*line, "--method=mimicgen", f"--template={template}")
    own = {"method": "mimicgen", "template": json.dumps(read_json_template(template))}
    assert settings == GenerationSettings(**ASKED, source="sources", first_sources=4, **own)


@pytest.mark.parametrize("fresh", [False, True])
def test_prepare_takes_every_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: bool) -> None:
    calls: list[dict[str, Any]] = []
    monkeypatch.setattr(replay, "demonstrations", lambda paths: [(path, "demo_0") for path in paths])
    monkeypatch.setattr(
        prepare, "prepare_files", lambda paths, **others: calls.append({"paths": paths, **others}) or []
    )
    words = ["--fresh"] if fresh else []
    assert cli.main(["prepare", str(tmp_path), "other", "--workers=3", *words]) == 1  # none is a source
    assert calls == [{"paths": [tmp_path, Path("other")], "workers": 3, "fresh": fresh}]
