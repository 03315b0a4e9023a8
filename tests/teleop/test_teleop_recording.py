"""What an operator drives is what the recorder would have kept: the whole way through the socket."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from teleop_support import SEED, TASK, WAIT_S, demonstration, drive, saved_demo, served, settings

from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.teleop.client import TeleopClient

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def shown() -> Recording:
    return demonstration()


def test_a_scripted_operator_records_what_the_recorder_does(tmp_path: Path, shown: Recording) -> None:
    with served(settings(tmp_path, operator="somebody")) as session, TeleopClient(session.address) as client:
        scene = client.until_told("scene", WAIT_S)
        assert scene["seed"] == SEED
        assert scene["instruction"] == shown.ep_meta["lang"]
        drive(client, shown.actions)
        assert client.until_phase("review")["review"]["success"]
        client.send("save")
        told = client.until_told("done", WAIT_S)
        assert told == {"type": "done", "path": f"{TASK}.hdf5", "saved": 1}
    found = saved_demo(tmp_path / f"{TASK}.hdf5")
    for name, expected in {
        "states": shown.states,
        "actions": shown.actions,
        "rewards": shown.rewards,
        "stage": shown.stages,
        "success_terms": shown.success_terms,
        **{f"obs/{key}": values for key, values in shown.observations.items()},
    }.items():
        assert np.array_equal(found[name], expected), name
    with h5py.File(tmp_path / f"{TASK}.hdf5") as file:
        demo = file["data/demo_0"]
        assert demo.attrs["model_file"] == shown.model_file
        meta = json.loads(demo.attrs["ep_meta"])
        assert sorted(name.removeprefix("assets/") for name in _names(file["assets"])) == sorted(shown.assets)
    assert {key: meta[key] for key in shown.ep_meta if key not in ("stages", "action_noise", "motion_style")} == {
        key: json.loads(json.dumps(value))
        for key, value in shown.ep_meta.items()
        if key not in ("stages", "action_noise", "motion_style")
    }
    told = meta["teleop"]
    assert (told["device"], told["operator"], told["undos"]) == ("script", "somebody", 0)
    assert replay(tmp_path / f"{TASK}.hdf5", "demo_0").deviation == 0.0
    stats = json.loads((tmp_path / "teleop-stats.json").read_text())[TASK]
    assert (stats["saved"], stats["success_share"], stats["sessions"]) == (1, 1.0, 1)
    assert stats["seconds_to_first_episode"] > 0


def _names(group: h5py.Group) -> list[str]:
    found: list[str] = []
    group.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
    return found
