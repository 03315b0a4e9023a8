"""Recorded demonstrations replay from their actions and from their states, and what is not theirs does not."""

from __future__ import annotations

import itertools
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from idle_demonstration import write_idle
from PIL import Image

from robocasa_lerobot import cli
from robocasa_lerobot.demos.film_strip import STRIP_PICTURES, STRIP_SIZE
from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks
from robocasa_lerobot.demos.replay import Replayed, demonstrations, read_demonstration, replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("demos")
    kitchens: dict[str, Any] = {"layouts": (2, 4), "styles": (3,)}
    settings = [RecordingSettings("CloseDrawer", 1, seed=2), RecordingSettings("OpenDrawer", 1, seed=2, **kitchens)]
    record_tasks(settings, out, show_progress=False)
    return out


@pytest.mark.slow
def test_all_of_them_replay_bit_for_bit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["replay", str(folder), "--workers", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["actions"], found["states"]) == (1.0, 1.0)
    for one in found["demonstrations"]:
        assert one["same_start"]
        assert one["deviation"] == 0.0


@pytest.mark.slow
def test_a_robot_that_starts_elsewhere_drives_there_and_is_replayed_from_there(tmp_path: Path) -> None:
    command = f"demos --tasks OpenDrawer --episodes 1 --seed 3 --start-within 1.5 --workers 1 --out {tmp_path}"
    assert cli.main(command.split()) == 0
    found = replay(tmp_path / "OpenDrawer.hdf5", "demo_0")
    assert found.actions
    assert found.same_start
    with h5py.File(tmp_path / "OpenDrawer.hdf5") as file:
        meta = json.loads(file["data/demo_0"].attrs["ep_meta"])
    assert meta["initial_noise"]["base_within_m"] == 1.5
    env = KitchenEnv("OpenDrawer", cameras=())
    env.reset(seed=meta["seed"])
    own, drawn = env.scene.robot_pose, meta["init_robot_base_pos"]
    assert 0.05 < np.hypot(own.x - drawn[0], own.y - drawn[1]) <= 1.5


@pytest.mark.slow
def test_what_was_changed_does_not_replay(folder: Path, tmp_path: Path) -> None:
    def changed(name: str, change: Callable[[h5py.Group], None]) -> Replayed:
        path = tmp_path / f"{name}.hdf5"
        path.write_bytes((folder / "CloseDrawer.hdf5").read_bytes())
        with h5py.File(path, "r+") as file:
            change(file["data/demo_0"])
        return replay(path, "demo_0")

    def no_actions(demo: h5py.Group) -> None:
        demo["actions"][:] = 0.0

    def unfinished(demo: h5py.Group) -> None:
        states = demo["states"][()]
        del demo["states"]
        demo["states"] = np.repeat(states[:1], len(states), axis=0)

    def other_kitchen(demo: h5py.Group) -> None:
        meta = json.loads(demo.attrs["ep_meta"])
        demo.attrs["ep_meta"] = json.dumps({**meta, "seed": meta["seed"] + 1})

    still = changed("still", no_actions)
    assert (still.actions, still.states, still.same_start) == (False, True, True)
    assert still.deviation > 0.01
    first = changed("first", unfinished)
    assert (first.actions, first.states) == (True, False)
    other = changed("other", other_kitchen)
    assert not other.same_start
    assert not other.actions


@pytest.mark.slow
@pytest.mark.render
def test_a_film_strip_shows_the_way_from_the_first_state_to_the_last(folder: Path, tmp_path: Path) -> None:
    assert cli.main(["replay", str(folder / "CloseDrawer.hdf5"), "--workers", "1", "--strips", str(tmp_path)]) == 0
    with Image.open(tmp_path / "CloseDrawer_demo_0.png") as picture:
        strip = np.asarray(picture, dtype=float)
    assert strip.shape[1] == STRIP_PICTURES * STRIP_SIZE
    columns = np.split(strip[-4 * STRIP_SIZE :], STRIP_PICTURES, axis=1)
    assert all(np.abs(a - b).mean() > 1.0 for a, b in itertools.pairwise(columns[:-1]))


@pytest.fixture
def mixed(tmp_path: Path) -> list[str]:
    """Two files of one name, a third whose states the kitchen as it is made now has no room for, and a foreign one."""
    files = [tmp_path / folder / "CloseDrawer.hdf5" for folder in ("a", "b", "c")]
    write_idle(files[0])
    for other in files[1:]:
        other.parent.mkdir()
        shutil.copy(files[0], other)
    with h5py.File(files[2], "r+") as file:
        states = file["data/demo_0/states"][()]
        del file["data/demo_0/states"]
        file["data/demo_0/states"] = states[:, :-1]
    with h5py.File(tmp_path / "lift.hdf5", "w") as file:
        file.create_dataset("data/demo_0/actions", data=np.zeros((3, 7)))
    return [str(path) for path in (*files, tmp_path / "lift.hdf5")]


def test_what_cannot_be_replayed_costs_nothing_of_the_rest(
    mixed: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn: list[str] = []
    module = "robocasa_lerobot.demos.film_strip.film_strip"
    monkeypatch.setattr(module, lambda path, demo, out: drawn.append(out.name) or print("a strip"))
    assert cli.main(["replay", *mixed, "--workers", "1", "--strips", str(tmp_path / "strips")]) == 1
    said = capsys.readouterr().out
    assert "recorded by other software" in said
    assert "numbers in a state" in said
    assert said.index("4 demonstrations, 2 of them") < said.index("a strip")
    assert drawn == ["1_CloseDrawer_demo_0.png", "2_CloseDrawer_demo_0.png"]
    assert cli.main(["replay", *mixed, "--workers", "1", "--json"]) == 1
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)  # no `Infinity`, which is no JSON
    assert [row["deviation"] for row in found["demonstrations"]] == [0.0, 0.0, None, None]
    assert cli.main(["replay", *mixed, "--every", "0"]) == 2
    assert "--every 0: expected 1" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_hundred_demonstrations_replay(tmp_path: Path) -> None:
    """Twenty each of five tasks with different skills: at least 95 from actions, all from states."""
    tasks = ("OpenDrawer", "TurnOnSinkFaucet", "TurnOnStove", "PickPlaceCounterToSink", "CloseMicrowave")
    record_tasks([RecordingSettings(task, 20) for task in tasks], tmp_path, workers=2, show_progress=False)
    results = [replay(*one) for one in demonstrations([tmp_path])]
    assert len(results) == 100
    assert all(result.states for result in results)
    assert sum(result.actions for result in results) >= 95


def test_mistakes_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file"):
        demonstrations([tmp_path / "none.hdf5"])
    with pytest.raises(UserError, match="no demonstrations"):
        demonstrations([tmp_path])
    with h5py.File(tmp_path / "lift.hdf5", "w") as file:  # as robomimic writes them
        for name in ("demo_2", "demo_10", "demo_1_old", "mask"):
            file.create_dataset(f"data/{name}/actions", data=np.zeros((3, 7)))
    found = demonstrations([tmp_path])
    assert [name for _, name in found] == ["demo_2", "demo_10"]
    with pytest.raises(UserError, match="other software"):
        read_demonstration(*found[0])
    (tmp_path / "text.hdf5").write_text("text")
    with pytest.raises(UserError, match="no HDF5 file"):
        demonstrations([tmp_path])
