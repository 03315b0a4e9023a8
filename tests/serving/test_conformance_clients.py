"""Our clients ask our servers, and servers of other projects' code: trials go as with the same policy in process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import peer_servers
import pytest
import yaml
from evaluation_env import SlideEnv
from peer_environments import peer, prepared
from serving_support import SIZE, serving

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.planning.trials import make_plan
from robocasa_lerobot.evaluation.records.results import TrialRecord, read_results
from robocasa_lerobot.evaluation.run.rollout import run_trial
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served

SEED, TRIALS = 100_123, 4
OPENPI_STATE = (
    *("end_effector_position_relative", "end_effector_rotation_relative", "base_position", "base_rotation"),
    "gripper_qpos",
)
VLA_EVAL_STATE = (
    *("end_effector_position_relative", "end_effector_rotation_relative", "gripper_qpos"),
    *("base_position", "base_rotation"),
)
STORED_STATE = tuple(part.name for part in contract.STATE_PARTS)


def evaluate(policy: str, out: Path, size: int, *more: str) -> list[TrialRecord]:
    fixed = ["--env.factory=evaluation_env:SlideEnv", f"--env.image_size={size}", "--videos=0", "--workers=1"]
    fixed += [f"--seed={SEED}", "--env.tasks=Slide", f"--trials={TRIALS}", "--policy.label=x", "--report=false"]
    assert main(["eval", f"--policy={policy}", f"--out={out}", *fixed, *more]) == 0
    records = sorted(read_results(out).trials, key=lambda record: record.key)
    assert [record.error for record in records] == [None] * TRIALS
    return records


def outcomes(records: list[Any]) -> list[tuple[Any, ...]]:
    return [(record.success, record.steps, record.trajectory) for record in records]


GROOT_KEYS = {
    "protocol": "gr00t",
    "cameras": [{"camera": name, "key": f"video > {name}", "resize": "none"} for name in contract.CAMERAS],
    "state": [{"key": f"state > {name}", "parts": [name], "dtype": "float64"} for name in STORED_STATE],
    "prompt": {"key": "language > annotation.human.task_description", "form": "lists"},
    "actions": [{"key": part.name, "parts": [part.name]} for part in contract.ACTION_PARTS],
    "executed_steps": 8,
    "picture_offsets": [-1, 0],
    "axes": "batch_time",
    "image_size": SIZE,
    "seed": "seed",
    "number": "number",
}


@pytest.mark.slow
def test_a_key_map_of_ones_own_takes_seed_and_number_to_gr00ts_wire(checkpoint: Path, tmp_path: Path) -> None:
    """(Our servers recognised by themselves: `tests/evaluation/test_remote_and_served.py`.)"""
    ours = evaluate(str(checkpoint), tmp_path / "ours", SIZE, "--policy.device=cpu")
    (tmp_path / "keys.yaml").write_text(yaml.safe_dump(GROOT_KEYS))
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "gr00t") as port:
        address, keys = f"gr00t://127.0.0.1:{port}", f"--policy.keys={tmp_path / 'keys.yaml'}"
        theirs = evaluate(address, tmp_path / "theirs", SIZE, keys)
    assert outcomes(theirs) == outcomes(ours)
    assert len({record.trajectory for record in ours}) == TRIALS


@pytest.mark.costly
@pytest.mark.parametrize(
    ("protocol", "keys", "version"),
    [
        ("openpi", "robocasa365_pi05", "1.6"),
        ("gr00t", "auto", "1.5"),
        ("gr00t", "auto", "1.6"),
        ("gr00t", "gr00t_n15", "1.5"),
        ("gr00t", "gr00t_n16", "1.6"),
        ("vla_eval", "vla_eval", "1.6"),
    ],
)
def test_servers_understand_the_published_names(
    checkpoint: Path, tmp_path: Path, protocol: str, keys: str, version: str
) -> None:
    """With pictures of 256 or 224 and, but for those that know the offsets, one observation for all of the history."""
    host = Host(load_served(read_source(str(checkpoint)), "cpu"), resize=True, repeat_history=True)
    more = [f"--policy.keys={keys}", *(["--executed_steps=8"] if keys == "gr00t_n15" else [])]  # its preset executes 16
    with serving(host, protocol, groot_version=version) as port:
        records = evaluate(f"{protocol}://127.0.0.1:{port}", tmp_path / "run", contract.IMAGE_SIZE, *more)
    assert len({record.trajectory for record in records}) == TRIALS


def test_a_token_is_sent_where_the_server_wants_one(
    checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    host = Host(load_served(read_source(str(checkpoint)), "cpu"))
    command = ["eval", "--env.factory=evaluation_env:SlideEnv", "--env.tasks=Slide", "--trials=1", "--workers=1"]
    command += ["--videos=0", "--policy.label=x", "--remote.connect_seconds=2"]
    with serving(host, "vla_eval", "0123456789abcdef") as port:
        address = f"--policy=vla_eval://127.0.0.1:{port}"
        assert main([*command, address, f"--out={tmp_path / 'without'}"]) == 2
        assert "ROBOCASA_LEROBOT_POLICY_TOKEN" in capsys.readouterr().err
        monkeypatch.setenv("ROBOCASA_LEROBOT_POLICY_TOKEN", "0123456789abcdef")
        assert main([*command, address, f"--out={tmp_path / 'with'}"]) == 0


def in_process(size: int, state: tuple[str, ...], dtype: type, order: Callable[[Any], Any]) -> list[Any]:
    """The outcomes of the peers' policy without a socket."""

    def predict(request: ChunkRequest) -> ChunkReply:
        (seen,) = request.observations
        parts = contract.split_state(seen["agent_pos"])
        numbers = np.concatenate([parts[name] for name in state]).astype(dtype)
        actions = peer_servers.actions(numbers, seen["pixels"][contract.CAMERAS[0]])
        return ChunkReply(order(actions), 0.0)

    found = []
    for spec in make_plan(["x"], {"Slide": None}, TRIALS, SEED, videos=0):
        actor = ChunkActor("x", ChunkShape(executed=peer_servers.CHUNK), predict)
        found.append(run_trial(SlideEnv("Slide", image_size=size), actor, spec))
    return found


OPENPI_KEYS = {
    "protocol": "openpi",
    "cameras": [{"camera": contract.CAMERAS[0], "key": "observation/image", "resize": "none"}],
    "state": [{"key": "observation/state", "parts": list(OPENPI_STATE), "dtype": "float64"}],
    "prompt": {"key": "prompt"},
    "actions": [{"key": "actions", "parts": [part.name for part in contract.ACTION_PARTS_HDF5]}],
    "executed_steps": peer_servers.CHUNK,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "size", "state", "dtype", "order"),
    [
        ("openpi", SIZE, OPENPI_STATE, np.float64, contract.hdf5_to_stored),
        ("vla_eval", contract.IMAGE_SIZE, VLA_EVAL_STATE, np.float64, contract.hdf5_to_stored),
        ("gr00t", contract.IMAGE_SIZE, STORED_STATE, np.float32, np.asarray),
    ],
)
def test_our_clients_ask_servers_of_other_projects_code(
    tmp_path: Path, kind: str, size: int, state: tuple[str, ...], dtype: type, order: Callable[[Any], Any]
) -> None:
    python = prepared("vla_eval", on_ours=True) if kind == "vla_eval" else prepared("policy_clients")
    more = []
    if kind == "openpi":
        (tmp_path / "keys.yaml").write_text(yaml.safe_dump(OPENPI_KEYS))
        more = [f"--policy.keys={tmp_path / 'keys.yaml'}"]
    with peer(python, kind) as port:
        records = evaluate(f"{kind}://127.0.0.1:{port}", tmp_path / "run", size, *more)
    assert outcomes(records) == outcomes(in_process(size, state, dtype, order))
    assert len({record.trajectory for record in records}) == TRIALS


def test_the_peers_policy_depends_on_all_that_it_sees() -> None:
    state, picture = np.zeros(16), np.zeros((4, 4, 3), np.uint8)
    first = peer_servers.actions(state, picture)
    assert first.shape == (4, 12)
    for place in range(16):
        moved = state.copy()
        moved[place] = 0.3
        assert not np.array_equal(peer_servers.actions(moved, picture), first)
    assert not np.array_equal(peer_servers.actions(state, picture + 9), first)


@pytest.mark.slow
@pytest.mark.render
def test_a_trial_in_a_real_kitchen_takes_the_same_course_behind_a_socket(checkpoint: Path, tmp_path: Path) -> None:
    kitchen = ["--env.factory=robocasa_lerobot.envs.kitchen_env:KitchenEnv", "--env.tasks=OpenDrawer,CloseDrawer"]
    kitchen += ["--env.horizon=20", "--trials=1"]

    def course(policy: str, name: str, *more: str) -> list[Any]:
        arguments = ["eval", f"--policy={policy}", f"--out={tmp_path / name}", f"--seed={SEED}", "--policy.label=x"]
        arguments += [f"--env.image_size={SIZE}", "--videos=0", "--workers=1", "--report=false", *kitchen, *more]
        assert main(arguments) == 0
        return outcomes(sorted(read_results(tmp_path / name).trials, key=lambda record: record.key))

    ours = course(str(checkpoint), "ours", "--policy.device=cpu")
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "openpi") as port:
        assert course(f"openpi://127.0.0.1:{port}", "theirs") == ours
    assert len({trajectory for _, _, trajectory in ours}) == 2
