"""Generation that goes on: only with what it began with, and what an attempt that raised had begun is known."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.corrections.disturbances import DisturbedSettings
from robocasa_lerobot.corrections.settings import CorrectionSettings
from robocasa_lerobot.demos.attempts import BrokenAttemptError, Parts, RecordingSettings
from robocasa_lerobot.demos.generate.replays import check_scenes
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.frames import parts_of, possible_parts
from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
from robocasa_lerobot.demos.generate.sources.rules import rules_from
from robocasa_lerobot.demos.generate.sources.segments import PART
from robocasa_lerobot.demos.generate.sources.source import sources_of
from robocasa_lerobot.demos.hdf5 import recorded_otherwise, versions
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.recording import record_task, record_tasks
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import LackingMachineError, UserError

TASK = "CloseDrawer"


@dataclass(frozen=True)
class Raising(RecordingSettings):
    """Attempts that raise."""

    def record(self, env: KitchenEnv, seed: int) -> Recording:
        raise BrokenAttemptError(IndexError("no pose"), 77, (("drawer.box", "demo_3"),))


def test_sources_that_are_gone_end_the_run_and_are_no_failed_attempt(tmp_path: Path) -> None:
    settings = GenerationSettings(TASK, 1, split="pretrain", source=str(tmp_path / "gone"), sources="0123")
    parts = Parts(tmp_path, settings)
    parts.prepare()
    env = settings.make_env()
    with pytest.raises(LackingMachineError, match=r"cannot be read any more: .*the same command goes on"):
        parts.attempt(0, env)
    env.close()
    assert not parts.tally().done


def test_what_an_attempt_that_raised_had_begun_is_noted(tmp_path: Path) -> None:
    parts = Parts(tmp_path, Raising(TASK, 1))
    parts.prepare()
    env = parts.settings.make_env()
    parts.attempt(0, env)
    env.close()
    (failure,) = parts.tally().failures
    assert (failure.reason, failure.scene_seed) == ("IndexError: no pose", 77)
    assert failure.segments == (("drawer.box", "demo_3"),)


def test_recorded_and_generated_ones_are_not_mixed() -> None:
    plain = RecordingSettings(TASK, 1, varied=False)
    generated = GenerationSettings(TASK, 1, varied=False)
    software = versions()
    found = {**generated.identity(), **software}
    assert "method: 'contacts', now None" in recorded_otherwise(found, plain.identity(), software)
    assert not recorded_otherwise(found, generated.identity(), software)
    assert not recorded_otherwise({**plain.identity(), **software}, plain.identity(), software)


def test_other_kinds_of_recordings_are_not_mixed() -> None:
    software = versions()
    plain = RecordingSettings(TASK, 1, varied=False)
    kinds = [
        plain,
        DisturbedSettings(TASK, 1, varied=False, disturbances=2),
        CorrectionSettings(TASK, 1, varied=False, policy="random", fingerprint="random"),
        GenerationSettings(TASK, 1, varied=False),
    ]
    for found in kinds:
        for now in kinds:
            others = recorded_otherwise({**found.identity(), **software}, now.identity(), software)
            assert bool(others) == (found is not now), (found, now, others)


@pytest.mark.parametrize("content", [b"hello", b"", None])
def test_a_file_that_holds_no_demonstrations_is_named(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / f"{TASK}.hdf5"
    if content is None:
        with h5py.File(path, "w") as file:
            file["other"] = 1
    else:
        path.write_bytes(content)
    with pytest.raises(UserError, match=rf"{TASK}\.hdf5 (is no HDF5 file|holds no demonstrations).*choose another"):
        record_task(RecordingSettings(TASK, 1), tmp_path, show_progress=False)


def test_replays_take_groups_of_kitchens_as_their_sources_do() -> None:
    env = KitchenEnv(TASK, split="pretrain", layouts=[-2], cameras=())
    source: Any = SimpleNamespace(task=TASK, split="pretrain", meta={"layouts": env.layouts})
    env.close()
    settings = GenerationSettings(TASK, 1, split="pretrain", layouts=(-2,), action_noise=0.05)
    check_scenes([source], settings)
    with pytest.raises(UserError, match="layouts of one of them"):
        check_scenes([source], GenerationSettings(TASK, 1, split="pretrain", layouts=(11,), action_noise=0.05))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--method mimicgen --select random", "--select is of --method contacts"),
        ("--method replay --action-noise 0.1 --cap 0.5", "--cap is of --method contacts"),
        ("--out sources", "--out is the folder of the sources"),
    ],
)
def test_options_that_would_do_nothing_are_refused(
    options: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = f"generate --source sources --tasks {TASK} --episodes 1 --out made {options}"
    assert cli.main(words.split()) == 2
    assert message in capsys.readouterr().err


def test_a_rule_that_leaves_no_segment_is_refused() -> None:
    with pytest.raises(UserError, match="use_near_m is 0, expected a number of metres above 0"):
        rules_from({"pick_place pour": {"use_near_m": 0}})


def test_all_burners_knobs_are_watched_where_the_burner_follows_from_the_pan() -> None:
    env = KitchenEnv("KettleBoiling", split="pretrain", cameras=())
    env.reset(seed=100_000)
    stage = next(stage for stage in env.declaration.stages if stage.skill == "knobs")
    possible = {part.name for part in possible_parts(env, stage)}
    assert len(possible) > 1
    assert {part.name for part in parts_of(env, stage)} <= possible
    env.close()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_knob_that_was_turned_is_a_segment(tmp_path: Path) -> None:
    record_tasks([RecordingSettings("KettleBoiling", 1, split="pretrain", seed=100_000)], tmp_path, show_progress=False)
    assert not any(outcome.dropped for outcome in prepare_files([tmp_path]))
    (source,) = sources_of(tmp_path, "KettleBoiling")
    stages = source.data.about["stages"]
    (knob,) = (one for one in source.segments if stages[one.stage]["skill"] == "knobs")
    assert knob.kind == PART
    moved = source.data.joints[knob.ref]
    assert abs(moved[knob.end - 1] - moved[knob.begin]) > 0.3
    assert {name for name in source.data.joints if ".knob" in name} == {knob.ref}, "others are not kept"


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_button_that_was_pressed_is_not_pressed_in_vain(tmp_path: Path) -> None:
    record_tasks([RecordingSettings("TurnOnMicrowave", 2, split="pretrain", seed=100_000)], tmp_path / "sources")
    assert not any(outcome.dropped for outcome in prepare_files([tmp_path / "sources"]))
    words = f"generate --source {tmp_path / 'sources'} --tasks TurnOnMicrowave --episodes 3 --split pretrain"
    assert cli.main([*words.split(), "--seed", "200900", "--workers", "1", "--out", str(tmp_path / "made")]) == 0
    with h5py.File(tmp_path / "made" / "TurnOnMicrowave.hdf5") as file:
        kept = [json.loads(demo.attrs["ep_meta"])["generation"]["segments"] for demo in file["data"].values()]
    assert not any(rows[-1]["in_vain"] for rows in kept), "the last one has done it"
