"""What demonstrations are worth: measures of known motions, and the page of real ones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from idle_demonstration import write_idle

from robocasa_lerobot import cli, contract
from robocasa_lerobot.demos.hdf5 import Failure, read_summary, segments_of
from robocasa_lerobot.demos.quality.measure import FULL, Measures, Start, _idle, _jerk, _saturated, _speed
from robocasa_lerobot.demos.quality.summary import BIN_M, Quality
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.inventory import worth

ARM = ("position", "rotation")


def one(seed: int, ahead: float, *, path: float = 0.0, sources: tuple[int, ...] = ()) -> Measures:
    """A demonstration whose hand keeps at a distance from a line."""
    line = np.full((20, 3), [path, 0.0, 0.0])
    return Measures(Start(seed, ahead, 0.0), 10.0, 1.0, 0.0, 0.0, 0.0, 1.0, line, np.zeros(3), sources)


def test_a_set_of_demonstrations() -> None:
    kept = (one(0, 0.1, sources=(0, 1)), one(1, 0.1 + BIN_M, path=0.3, sources=(0, 0)), one(2, 0.15, path=0.1))
    found = Quality("OpenDrawer", kept, (Start(3, 0.12, 0.0), Start(4, 0.1, 5 * BIN_M)))
    assert found.rate == pytest.approx(3 / 5)
    assert found.covered == pytest.approx(2 / 3)
    assert found.most_used_source == pytest.approx(3 / 4)
    assert found.path_spread_m == pytest.approx((0.3 + 0.1 + 0.2) / 3)
    assert found.most_alike_m == pytest.approx(0.1)
    assert Quality("OpenDrawer", kept[2:], ()).most_used_source is None


def test_what_is_kept_by_segment_and_by_source() -> None:
    pull, push = ("part drawer.box", "OpenDrawer/demo_0"), ("part drawer.box", "OpenDrawer/demo_1")
    kept = (
        replace(one(0, 0.1, sources=(0,)), segments=(pull,)),
        replace(one(1, 0.1, sources=(0, 1)), segments=(pull, push)),
    )
    found = Quality("OpenDrawer", kept, (Start(2, 0.1, 0.0),), ((push, push),))
    assert found.kept_with(0) == {"part drawer.box": (2, 3)}
    assert found.kept_with(1) == {"OpenDrawer/demo_0": (2, 2), "OpenDrawer/demo_1": (1, 2)}
    assert found.effective_sources == pytest.approx(1 / ((2 / 3) ** 2 + (1 / 3) ** 2))
    printed = worth.text({"generated": [found]})
    assert "Kept by segment" in printed
    assert "OpenDrawer/demo_1" in printed
    assert "Kept by source" not in worth.text({"scripted": [Quality("OpenDrawer", (one(0, 0.1),), ())]})
    assert segments_of({"generation": {"segments": [{"kind": "part", "ref": "drawer.box", "source": "a"}]}}) == (
        ("part drawer.box", "a"),
    )


def test_motion() -> None:
    seconds = np.arange(60) / contract.CONTROL_HZ
    cubic = np.column_stack([seconds**3, np.zeros(60), np.zeros(60)])
    assert _jerk(cubic) == pytest.approx(6.0, rel=1e-6)  # the third derivative of t^3
    base = np.zeros((60, 3))
    assert _idle(np.zeros((60, 3)), base) == 1.0
    assert _idle(np.column_stack([seconds, seconds, seconds]), base) == 0.0
    base[:, 0] = seconds
    assert _idle(np.zeros((60, 3)), base) == 0.0
    actions = np.zeros((4, 12))
    actions[1, contract.ACTION_SLICES["end_effector_rotation"]] = [0.0, -1.0, 0.0]
    actions[2, contract.ACTION_SLICES["base_motion"]] = 1.0
    assert _saturated(actions) == 0.25


def test_commands_of_a_varied_demonstration_are_at_the_bound_of_its_style() -> None:
    """Its free paths go as fast as its style lets them, of which none is a full command; its turns may be full."""
    env = KitchenEnv("OpenDrawer", cameras=(), terminate_on_success=False)
    try:
        recording = record_episode(env, 3, varied=True)
    finally:
        env.close()
    speed = recording.ep_meta["motion_style"]["speed"]
    actions = contract.hdf5_to_stored(recording.actions)
    position, rotation = (np.abs(actions[:, contract.ACTION_SLICES[f"end_effector_{what}"]]) for what in ARM)
    assert position.max() == pytest.approx(speed)
    assert speed < FULL
    bound = np.isclose(position, speed).any(axis=1)
    assert bound.mean() > 0.1
    assert _saturated(actions, _speed(recording.ep_meta)) >= bound.mean()
    assert _saturated(actions) == (rotation > FULL).any(axis=1).mean()
    assert (_speed({}), _speed({"motion_style": None})) == (1.0, 1.0)


def test_drives_to_objects_and_kitchens_that_cannot_be_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nowhere = Failure(-5, "ValueError: expected non-negative integer", segments=(("part drawer.box", "a"),))
    path = write_idle(tmp_path / "AlignSilverware.hdf5", [nowhere])
    assert cli.main(["inspect", str(path), "--worth", "--workers", "1", "--report", "json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)[str(path)]
    assert (found["kept"], found["rate"], found["covered"]) == (1, 0.5, 1.0)
    assert found["segments"] == {"part drawer.box": [0, 1]}
    printed = worth.text({"set": [Quality("AlignSilverware", (one(0, 0.1),), (), ((),), nowhere=1)]})
    assert "50%" in printed


def test_files_of_other_software_are_refused_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "CloseDrawer.hdf5"
    with h5py.File(path, "w") as file:
        file.create_dataset("data/demo_0/actions", data=np.zeros((3, 7)))
    assert (read_summary(path).episodes, read_summary(path).steps) == (1, 3)
    assert cli.main(["inspect", str(path), "--worth", "--workers", "1"]) == 2
    assert "other software" in capsys.readouterr().err
    with pytest.raises(UserError, match="was recorded with other settings"):
        record_tasks([RecordingSettings("CloseDrawer", 1)], tmp_path, show_progress=False)


@pytest.mark.slow
def test_the_command_measures_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record_tasks([RecordingSettings("CloseDrawer", 2, seed=2)], tmp_path, show_progress=False)
    page = tmp_path / "worth.html"
    command = ["inspect", str(tmp_path), "--worth", "--beside", str(tmp_path), "--workers", "1", "--out", str(page)]
    assert cli.main(["inspect", str(tmp_path), "--beside", str(tmp_path)]) == 2
    assert "--worth" in capsys.readouterr().err
    assert cli.main(command) == 0
    assert "target in view" in capsys.readouterr().out
    assert "Paths, stands, lengths" in page.read_text()
    assert cli.main([*command[:-2], "--report", "json"]) == 0
    found = json.loads(capsys.readouterr().out)[str(tmp_path)][0]
    assert (found["task"], found["kept"], found["rate"], found["covered"]) == ("CloseDrawer", 2, 1.0, 1.0)
    assert 0.0 < found["in_view"] <= 1.0
    assert found["saturated"] > 0.1, "each has a style, by whose speed its commands are bound"
    assert 0.0 <= found["other_contacts"] < 0.5
    assert found["path_spread_m"] > 0.01
