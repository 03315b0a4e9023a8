"""LeRobot's envs by their type: its RoboCasa env's own code over a stand-in for its simulator, which needs assets."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from serving_support import serving
from tiny_checkpoint import SIZE

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.run import engine
from robocasa_lerobot.evaluation.simulators.foreign_env import ForeignEnv
from robocasa_lerobot.evaluation.simulators.simulator import Simulator, simulator_of
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served

STAND_IN = Path(__file__).parents[1] / "support" / "robocasa_stand_in"


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "notes.jsonl"
    monkeypatch.setenv("PYTHONPATH", str(STAND_IN))
    monkeypatch.setenv("STAND_IN_NOTES", str(path))
    return path


def read(notes: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in notes.read_text().splitlines()]


def robocasa(**options: Any) -> Simulator:
    simulator = simulator_of(None, "lerobot:robocasa", "", options)
    assert simulator is not None
    assert simulator.python == sys.executable
    return simulator


def evaluate(out: Path, **changes: Any) -> list[TrialRecord]:
    values = {"env.type": "lerobot:robocasa", "trials": 2, "workers": 1, "report": "false", **changes}
    words = [f"--out={out}", *(f"--{name}={value}" for name, value in values.items())]
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, words)))


@pytest.mark.costly
def test_robocasa_gets_our_actions_in_its_parts_and_gives_our_state(notes: Path) -> None:
    env = ForeignEnv(robocasa(split="target"), "CloseDrawer", image_size=48)
    try:
        assert (env.horizon, env.fps) == (9, 20.0)
        assert env.action_space.shape == (contract.ACTION_SIZE,)
        seen, info = env.reset(seed=100123)
        assert info["instruction"] == "close the drawer no. 3"
        np.testing.assert_array_equal(seen["agent_pos"], np.arange(contract.STATE_SIZE))
        assert set(seen["pixels"]) == set(contract.CAMERAS)
        assert {picture.shape for picture in seen["pixels"].values()} == {(48, 48, 3)}
        action = np.linspace(-1, 1, contract.ACTION_SIZE).astype(np.float32)
        seen, _, terminated, _, info = env.step(action)
        assert (terminated, info["is_success"]) == (False, False)
        assert seen["pixels"]["robot0_eye_in_hand"][0, 0, 0] == 81
        np.testing.assert_array_equal(seen["agent_pos"], np.arange(contract.STATE_SIZE) + 1)
    finally:
        env.close()
    made, reset, step, *_ = read(notes)
    assert made == {"made": "CloseDrawer", "width": 48, "height": 48, "split": "target", "objects": ["lightwheel"]}
    assert reset == {"reset": 100123}
    sent = {name.removeprefix("action."): value for name, value in step["step"].items()}
    for name, part in contract.split_action(action).items():
        np.testing.assert_array_equal(np.float32(sent[name]), part, err_msg=name)
    assert sent.keys() == contract.ACTION_SLICES.keys()


@pytest.mark.slow
def test_a_checkpoint_of_our_kitchens_is_evaluated_there(notes: Path, tmp_path: Path, checkpoint: Path) -> None:
    records = evaluate(tmp_path / "out", policy=checkpoint, videos=1, **{"env.tasks": "CloseDrawer"})
    assert [(r.success, r.steps, r.error) for r in records] == [(True, 7, None)] * 2
    assert {r.instruction for r in records} == {f"close the drawer no. {r.seed % 10}" for r in records}
    said = read(notes)
    assert {(line["width"], line["height"]) for line in said if "made" in line} == {(SIZE, SIZE)}
    # LeRobot's env resets itself once more at the end of an episode; the seeds of the trials are ours.
    assert {r.seed for r in records} <= {line["reset"] for line in said if "reset" in line}


@pytest.mark.slow
def test_a_policy_behind_a_socket_takes_the_same_course_there(notes: Path, tmp_path: Path, checkpoint: Path) -> None:
    own = {"policy.label": "same", "env.tasks": "CloseDrawer", "videos": 0}
    here = evaluate(tmp_path / "here", policy=checkpoint, **own)
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "openpi") as port:
        there = evaluate(tmp_path / "there", policy=f"openpi://127.0.0.1:{port}", **own)
    assert [record.comparable() for record in there] == [record.comparable() for record in here]
    assert [record.error for record in here] == [None] * 2


@pytest.mark.slow
def test_mistakes_are_said(notes: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"(?s)cannot make its env.*No RoboCasa horizon is registered"):
        evaluate(tmp_path / "a", policy="zero", **{"env.tasks": "OpenDoor"})
    with pytest.raises(UserError, match=r"(?s)settings of 'robocasa' have no 'splitt'; they have .*split"):
        evaluate(tmp_path / "b", policy="zero", **{"env.tasks": "CloseDrawer", "env.options.splitt": "target"})
    with pytest.raises(UserError, match=r"(?s)cannot make its env.*'pushed'"):
        evaluate(tmp_path / "c", policy="zero", **{"env.tasks": "a", "env.type": "lerobot:pushed"})
    with pytest.raises(UserError, match="LeRobot's envs end at their first success"):
        evaluate(tmp_path / "d", policy="zero", **{"env.tasks": "CloseDrawer", "success.rule": "at_end"})
