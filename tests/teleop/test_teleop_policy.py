"""A policy drives, a person corrects it; the file says who decided each step, and conversion keeps that."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from policy_sockets import OpenpiServer
from teleop_desk import desk
from teleop_support import SPLIT, TASK, WAIT_S, saved_demo, served, settings
from tiny_checkpoint import SIZE

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors import policy_runner
from robocasa_lerobot.evaluation.remote.failures import LostError
from robocasa_lerobot.teleop.client import TeleopClient
from robocasa_lerobot.teleop.driving.pilot import load_pilot
from robocasa_lerobot.teleop.telling import header

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def corrected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of one episode: the demonstrator as policy, corrected for a while, undone, and given back to."""
    out = tmp_path_factory.mktemp("corrected")
    with served(settings(out), policy="demonstrator") as session, TeleopClient(session.address) as client:
        client.until_phase("ready", seconds=WAIT_S)
        assert client.said[0]["policy"] == client.frame["policy"]["name"] == "demonstrator"
        client.send("start")
        client.until(lambda: client.frame["step"] >= 20)
        assert client.frame["policy"]["state"] == "AUTONOMOUS"
        for _ in range(10):  # any input takes over
            client.send("input", device="keyboard", arm=[0, 0.5, 0.5, 0, 0, 0])
            client.receive(WAIT_S)
        client.until(lambda: client.frame["step"] >= 35)
        assert client.frame["policy"] == {"name": "demonstrator", "state": "CORRECTING", "interventions": 1}
        client.send("rewind", steps=2)
        assert client.until_phase("paused")["policy"]["state"] == "PAUSED"
        client.send("give_back")
        client.until_phase("running")
        client.until(lambda: client.frame["policy"]["state"] == "AUTONOMOUS")
        client.until_phase("review", seconds=WAIT_S)
        client.send("save")
        client.until_told("done", WAIT_S)
    return out / f"{TASK}.hdf5"


def test_the_file_says_who_decided_each_step(corrected: Path) -> None:
    found = saved_demo(corrected)
    steps = len(found["actions"])
    intervention, policy = found["intervention"], found["policy_action"]
    assert intervention.shape == (steps, 1)
    assert policy.shape == (steps, 12)
    changes = np.flatnonzero(np.diff(intervention[:, 0].astype(int))) + 1
    assert len(changes) == 2  # taken over once, given back once
    assert 20 <= changes[0] < changes[1] < steps - 20
    assert np.isfinite(policy).all()
    asked = intervention[:, 0] == 0
    binary = [6, 11]  # gripper and mode, HDF5 order, as executed -1 or 1
    others = [index for index in range(12) if index not in binary]
    executed = np.clip(policy, -1, 1).astype(np.float32)
    assert np.array_equal(executed[asked][:, others], found["actions"][asked][:, others].astype(np.float32))
    assert not found["assisted"].any()
    with h5py.File(corrected) as file:
        meta = json.loads(file["data/demo_0"].attrs["ep_meta"])["teleop"]
    assert meta["policy"] == "demonstrator"
    assert meta["intervention_steps"] == intervention.sum()
    assert (meta["interventions"], meta["undos"]) == (1, 1)
    outcome = replay(corrected, "demo_0")
    assert (outcome.actions, outcome.states, outcome.deviation) == (True, True, 0.0)


@pytest.mark.slow
def test_conversion_keeps_who_decided_and_verifies(corrected: Path, tmp_path: Path) -> None:
    data, back = tmp_path / "data", tmp_path / "back.hdf5"
    assert cli.main(["convert", str(corrected), "--out", str(data), "--image-size", "48"]) == 0
    assert cli.main(["verify", str(data)]) == 0
    table = pq.read_table(next(data.glob("data/**/*.parquet"))).to_pydict()
    found = saved_demo(corrected)
    for key in ("intervention", "policy_action", "assisted"):
        values = np.array(table[f"extra.{key}"], dtype=np.float64).reshape(len(found[key]), -1)
        assert np.array_equal(values, found[key]), key
    assert cli.main(["export", str(data), "--out", str(back)]) == 0
    again = saved_demo(back)
    assert np.array_equal(again["intervention"], found["intervention"][:, 0])


def test_files_of_which_some_say_nothing_convert_without(corrected: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.hdf5"
    other.write_bytes(corrected.read_bytes())
    with h5py.File(other, "r+") as file:
        del file["data/demo_0/intervention"]
        file["data/demo_0/rewards"][0] = 0.5  # else it is the same demonstration twice
    plan = make_plan([corrected, other], ConversionSettings(image_size=48))
    assert plan.settings.extra_columns == ("policy_action", "assisted")
    assert "extra.intervention" not in plan.features


@pytest.mark.parametrize("order", ["start", "give_back"])
def test_a_policy_begins_from_the_start_though_a_person_drove_before_it_was_undone(tmp_path: Path, order: str) -> None:
    pilot, size = load_pilot("random", TASK)
    env = KitchenEnv(TASK, split=SPLIT, image_size=size, terminate_on_success=False)
    with desk(tmp_path, env, pilot=pilot) as table:
        table.say("start")
        table.tick(3)
        table.hold(2, arm=[0, 0, 1, 0, 0, 0])
        table.say("rewind", steps=100)
        assert (table.session.phase, pilot.state) == ("ready", "CORRECTING")
        table.say(order)
        table.tick(4)
        origins = table.session.driven.origins
        assert (pilot.state, [origin.device for origin in origins]) == ("AUTONOMOUS", ["policy"] * 4)
        assert not any(origin.intervention for origin in origins)
    env.close()


@pytest.mark.parametrize("policy", ["", "random"])
def test_a_click_whose_planning_fails_is_told_and_leaves_episode_and_policy(tmp_path: Path, policy: str) -> None:
    def broken() -> Iterator[np.ndarray]:
        yield np.zeros(contract.ACTION_SIZE)
        raise ZeroDivisionError("no such way")

    pilot, size = load_pilot(policy, TASK) if policy else (None, SIZE)
    env = KitchenEnv(TASK, split=SPLIT, image_size=size, terminate_on_success=False)
    with desk(tmp_path, env, pilot=pilot) as table:
        table.say("start")
        table.tick(3)
        table.session.driver.assist("drive_to", broken())
        table.tick(4)  # told, one step of it, its failure and zeros, zeros
        assert (table.session.phase, len(table.session.driven)) == ("running", 6)
        assert [origin.assisted for origin in table.session.driven.origins[3:]] == [True, False, False]
        assert "the planned motion failed (ZeroDivisionError: no such way)" in table.notes()[-1]
        assert not any("policy" in note for note in table.notes())
        assert pilot is None or pilot._actor is not None
    env.close()


@pytest.mark.slow
def test_a_checkpoint_acts_as_it_does_elsewhere_and_anew_after_a_correction(tmp_path: Path, checkpoint: Path) -> None:
    pilot, size = load_pilot(str(checkpoint), TASK, "cpu")
    assert size == SIZE
    env = KitchenEnv(TASK, split=SPLIT, image_size=SIZE, terminate_on_success=False)
    with desk(tmp_path, env, pilot=pilot) as table:
        table.say("start")
        table.tick(12)
        table.hold(3, arm=[0, 0, 1, 0, 0, 0])
        table.say("give_back")
        table.session.draw(table.now)  # pictures for people are of another size
        table.tick(12)
        episode = table.session.driven
        driven, states = episode.actions(), list(episode.states)
        by_person = [origin.intervention for origin in episode.origins]
    first = by_person.index(True)
    assert by_person == [False] * 12 + [True] * 3 + [False] * 12
    actor = pilot._actor  # the same policy, asked directly
    assert actor is not None
    for turn, (start, end) in enumerate([(0, first), (15, 27)]):
        env.render_observations = True
        observation, info = env.set_state(states[start])
        noise = np.random.SeedSequence([env.scene.seed, turn]).generate_state(1)[0]
        actor.reset(int(noise), env)
        for step in range(start, end):
            action = np.clip(actor.act(observation, info["instruction"]), -1, 1)
            assert np.array_equal(contract.binarize(action.astype(np.float64)), driven[step]), (turn, step)
            observation, _, _, _, info = env.step(action)
    env.close()


def push(request: Any) -> dict[str, Any]:
    """A policy behind a socket that lifts the hand, closed."""
    actions = np.zeros((50, 12), np.float32)
    actions[:, contract.ACTION_SLICES_HDF5["gripper_close"]] = 1.0
    actions[:, contract.ACTION_SLICES_HDF5["end_effector_position"]] = (0.0, 0.0, 0.5)
    return {"actions": actions}


def test_a_policy_behind_a_socket_drives_and_its_end_is_no_end(tmp_path: Path) -> None:
    with OpenpiServer(push) as server:
        pilot, size = load_pilot(server.url, TASK, keys="robocasa365_pi0")
        env = KitchenEnv(TASK, split=SPLIT, image_size=size, terminate_on_success=False)
        with desk(tmp_path, env, pilot=pilot) as table:
            table.say("start")
            table.tick(7)
            assert not any(origin.intervention for origin in table.session.driven.origins)
            up = contract.ACTION_SLICES["end_effector_position"].start + 2
            assert np.allclose(table.session.driven.actions()[:, up], 0.5)
            server.stop()
            table.tick(10)  # what it has answered already is carried out first
            assert (table.session.phase, pilot.state) == ("paused", "CORRECTING")
            assert "the policy failed" in table.notes()[-1]
            steps = len(table.session.driven)
            assert header(table.session, 1, table.now)["gripper"] == "closed"
            table.say("resume")
            table.hold(2, arm=[1, 0, 0, 0, 0, 0])
            assert len(table.session.driven) == steps + 2
            gripper = contract.ACTION_SLICES["gripper_close"]
            assert (table.session.driven.actions()[:, gripper] == 1.0).all()  # what the policy held is not let go
            with OpenpiServer(push, port=server.port):
                table.say("give_back")
                table.tick(3)
                assert (table.session.phase, pilot.state) == ("running", "AUTONOMOUS")
                assert len(table.session.driven) == steps + 5
        env.close()


def test_a_server_that_is_gone_again_is_a_mistake_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*arguments: Any) -> Any:
        raise LostError("openpi://127.0.0.1:8000: refused")

    monkeypatch.setattr(policy_runner, "load_actor", gone)
    with pytest.raises(UserError, match=r"refused\. Start the server"):
        load_pilot("zero", TASK)


def test_a_policy_that_is_none_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such folder"), served(settings(tmp_path), policy=str(tmp_path / "none")):
        pass


def test_an_action_that_is_not_finite_is_a_failure_of_the_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a person drives, as with any other: it must not end the session."""
    env = KitchenEnv(TASK, cameras=())
    observation, _ = env.reset(seed=0)
    pilot, _ = load_pilot("zero", TASK)
    assert np.isfinite(pilot.act(env, observation, "")).all()
    monkeypatch.setattr(type(pilot._actor), "act", lambda *_: np.full(contract.ACTION_SIZE, np.nan))
    with pytest.raises(UserError, match="not finite"):
        pilot.act(env, observation, "")
