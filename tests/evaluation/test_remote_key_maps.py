"""What servers are sent and asked for: GR00T's from what it says, vla-eval's by episodes, anybody's by a file."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from policy_sockets import Gr00tServer, OpenpiServer, VlaEvalServer
from remote_runs import FORWARD, command, evaluate, push

from robocasa_lerobot import contract
from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.key_map import load_key_map, presets
from robocasa_lerobot.evaluation.remote.pictures import resized
from robocasa_lerobot.evaluation.remote.translation import actions_of, flat_shapes, request_of

PARTS = {part.name: part.size for part in contract.ACTION_PARTS}
VIDEO = ("robot0_agentview_left", "robot0_agentview_right", "robot0_eye_in_hand")
STATE = tuple(part.name for part in contract.STATE_PARTS)


def modality_config(version: str, offsets: list[int]) -> dict[str, Any]:
    full = version == "N1.5"

    def group(name: str, keys: Any, deltas: list[int]) -> dict[str, Any]:
        return {"modality_keys": [f"{name}.{key}" if full else key for key in keys], "delta_indices": deltas}

    language = "annotation.human.task_description"
    return {
        "video": group("video", VIDEO, offsets),
        "state": group("state", STATE, [0]),
        "action": group("action", PARTS, list(range(16))),
        "language": {"modality_keys": [language], "delta_indices": [0]},
    }


def gr00t_policy(nested: bool, offsets: list[int]) -> Callable[[Any], Any]:
    """A strict policy with GR00T's shapes and names."""

    def answer(observation: Any) -> Any:
        length = len(offsets)
        if nested:
            video, state = observation["video"], observation["state"]
            assert observation["language"] == {"annotation.human.task_description": [["slide the block"]]} or (
                "drawer" in str(observation["language"])
            ), observation["language"]
        else:
            video = {key: observation[f"video.{key}"] for key in VIDEO}
            state = {key: observation[f"state.{key}"] for key in STATE}
            assert isinstance(observation["annotation.human.task_description"], list)
        assert set(video) == set(VIDEO)
        for picture in video.values():
            assert (picture.shape, picture.dtype) == ((1, length, 256, 256, 3), np.uint8)
        for name, value in state.items():
            assert value.shape == (1, 1, contract.STATE_SLICES[name].stop - contract.STATE_SLICES[name].start)
        actions = {name: np.zeros((1, 16, size), np.float32) for name, size in PARTS.items()}
        actions["base_motion"][..., 0] = 0.15 + 0.25 * state["base_position"][..., :1].reshape(-1)[0]
        return actions if nested else {f"action.{name}": value for name, value in actions.items()}

    return answer


@pytest.mark.parametrize(
    ("version", "nested", "offsets"),
    [("N1.5", False, [0]), ("N1.6", True, [0]), ("N1.6", False, [-2, 0]), ("N1.7", True, [-6, -4, -2, 0])],
)
def test_gr00ts_services_are_asked_for_what_they_say_they_take(
    tmp_path: Path, version: str, nested: bool, offsets: list[int]
) -> None:
    server = Gr00tServer(gr00t_policy(nested, offsets), version, modality_config(version, offsets))
    with server:
        results = evaluate(server.url, tmp_path / "out", "--executed_steps=5", "--env.image_size=48", keys="")
    assert [record.error for record in results.trials] == [None] * 4
    (header,) = results.headers.values()
    remote = header.policies["theirs"].remote
    assert remote is not None
    assert (remote["keys"], remote["metadata"]["gr00t_version"]) == ("auto", version)
    assert remote["key_map"]["picture_offsets"] == offsets
    with OpenpiServer(push) as peer:
        theirs = evaluate(peer.url, tmp_path / "peer", "--env.image_size=48")
    # The same policy over another protocol: the same successes on the same trials.
    assert [(r.seed, r.success) for r in results.trials] == [(r.seed, r.success) for r in theirs.trials]


def test_a_configuration_that_cannot_be_named_says_which_key(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = modality_config("N1.6", [0])
    config["video"]["modality_keys"] = ["ceiling"]
    with Gr00tServer(gr00t_policy(True, [0]), "N1.6", config) as server:
        assert main(command(server.url, tmp_path / "out", keys="")) == 2
    assert "the server wants the picture 'ceiling', which names none of our cameras" in capsys.readouterr().err


def test_vla_evals_servers_get_an_episode_for_each_trial(tmp_path: Path) -> None:
    def answer(observation: Any) -> Any:
        assert set(observation["images"]) == {f"video.{camera}" for camera in VIDEO}
        place = observation["state"]["state.base_position"][0]
        action = np.zeros(12, np.float32)
        action[FORWARD] = 0.15 + 0.25 * place
        return {"actions": action}

    with VlaEvalServer(answer) as server:
        results = evaluate(server.url, tmp_path / "out", keys="")
        kinds = [request["type"] for request in server.requests]
    assert [record.error for record in results.trials] == [None] * 4
    assert kinds.count("episode_start") == 1 + 4  # the probe's, and one for each trial
    assert kinds.count("episode_end") == 3  # between the trials of the one worker
    steps = sum(record.steps for record in results.trials)
    assert kinds.count("observation") == 1 + steps


OWN_MAP = """
about: two cameras, offsets, an envelope, a reset
protocol: openpi
cameras:
  - {camera: robot0_agentview_left, key: obs > left, size: [24, 32], resize: pad}
  - {camera: robot0_eye_in_hand, key: obs > wrist, size: [16, 16], resize: stretch}
state:
  - {key: obs > gripper, parts: [gripper_qpos], dtype: float64}
  - {key: obs > base, parts: [base_position, base_rotation]}
prompt: {key: lang, form: list}
actions:
  - {key: data > arm, parts: [end_effector_position, end_effector_rotation, gripper_close]}
  - {key: data > base, parts: [base_motion, control_mode], start: 1, width: 7}
executed_steps: 3
picture_offsets: [-6, -4, -2, 0]
state_offsets: [-1, 0]
axes: time
constants: {endpoint: infer, session_id: abc}
reset: {endpoint: reset}
seed: seed
number: chunk
"""


def test_a_key_map_of_ones_own_says_everything(tmp_path: Path) -> None:
    seen: list[Any] = []
    resets = []

    def answer(request: Any) -> Any:
        if request["endpoint"] == "reset":
            resets.append(request)
            return {}
        assert set(request) == {"endpoint", "session_id", "obs", "lang", "seed", "chunk"}
        obs = request["obs"]
        assert {name: value.shape for name, value in obs.items()} == {
            "left": (4, 24, 32, 3), "wrist": (4, 16, 16, 3), "gripper": (2, 2), "base": (2, 7),
        }  # fmt: skip
        assert obs["gripper"].dtype == np.float64
        assert not obs["left"][:, :, :4].any()  # a square picture between black bars
        assert obs["left"][:, :, 4:28].all(axis=-1).mean() > 0.9
        seen.append((request["seed"], request["chunk"], obs["base"][:, 0].copy(), request["lang"]))
        arm, base = np.zeros((3, 7)), np.full((3, 7), 0.01)
        base[:, 1] = 0.1  # base_forward, after one number that nobody reads
        return {"data": {"arm": arm, "base": base}}

    file = tmp_path / "map.yaml"
    file.write_text(OWN_MAP)
    with OpenpiServer(answer) as server:
        results = evaluate(server.url, tmp_path / "out", "--trials=2", keys=f"--policy.keys={file}")
    assert len(resets) == 1 + 2
    trials = sorted(results.trials, key=lambda record: record.trial)
    own = [entry for entry in seen if entry[0] == trials[0].policy_seed]
    assert [entry[1] for entry in own] == list(range(-(-trials[0].steps // 3)))
    assert own[0][2][0] == own[0][2][1]  # before the start the first observation counts
    assert own[1][2][1] - own[1][2][0] == pytest.approx(0.2 * 0.1)
    assert own[0][3] == ["slide the block"]
    (header,) = results.headers.values()
    remote = header.policies["theirs"].remote
    assert remote is not None
    assert remote["outcomes"].startswith("fixed by the trial's seed")


@pytest.mark.parametrize("name", presets())
def test_every_preset_says_what_it_is_for_and_loses_nothing(name: str) -> None:
    key_map = load_key_map(name)
    assert key_map.about
    observations = [
        {"pixels": dict.fromkeys(contract.CAMERAS, np.full((256, 256, 3), 9, np.uint8)), "agent_pos": np.arange(16.0)}
        for _ in key_map.offsets
    ]
    request = request_of(key_map, observations, "go")
    assert len(flat_shapes(request)) >= len(key_map.sent_keys)
    actions = np.arange(36, dtype=np.float32).reshape(3, 12)
    parts = {
        part.name: actions[:, where]
        for part, where in zip(contract.ACTION_PARTS, contract.ACTION_SLICES.values(), strict=True)
    }
    answer: dict[str, Any] = {}
    for one in key_map.actions:
        answer[one.key] = np.concatenate([parts[part] for part in one.parts], axis=1)[None]
    few = dataclasses.replace(key_map, executed_steps=3)
    np.testing.assert_array_equal(actions_of(few, answer), actions)


def test_orders_are_those_of_the_forks() -> None:
    """The state of RoboCasa365's forks begins with the end effector, and their actions are in HDF5 order."""
    observation = {
        "pixels": dict.fromkeys(contract.CAMERAS, np.zeros((256, 256, 3), np.uint8)),
        "agent_pos": np.arange(16.0),
    }
    request = request_of(load_key_map("robocasa365_pi0"), [observation], "go")
    assert request["observation/state"].tolist() == [7, 8, 9, 10, 11, 12, 13, 0, 1, 2, 3, 4, 5, 6, 14, 15]
    assert request["observation/state"].dtype == np.float32
    assert request_of(load_key_map("robocasa_libero"), [observation], "go")["observation/state"].shape == (9,)
    hdf5 = np.tile(np.arange(12, dtype=np.float32), (5, 1))
    stored = actions_of(load_key_map("robocasa365_pi0"), {"actions": hdf5})
    np.testing.assert_array_equal(stored, contract.hdf5_to_stored(hdf5))


@pytest.mark.parametrize(
    ("height", "width", "size"), [(256, 256, (224, 224)), (100, 200, (224, 224)), (64, 48, (32, 40))]
)
def test_pictures_are_padded_as_openpis_clients_do(height: int, width: int, size: tuple[int, int]) -> None:
    picture = np.full((height, width, 3), 200, np.uint8)
    out = resized(picture, size, "pad")
    assert out.shape == (*size, 3)
    scale = min(size[0] / height, size[1] / width)
    inside = int(height * scale), int(width * scale)
    top, left = (size[0] - inside[0]) // 2, (size[1] - inside[1]) // 2
    assert (out[top : top + inside[0], left : left + inside[1]] == 200).all()
    assert out.any(axis=-1).sum() == inside[0] * inside[1]
    assert (resized(picture, size, "stretch") == 200).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cameras": [{"camera": "robot0_agentview_lft", "key": "a"}]}, "Did you mean 'robot0_agentview_left'"),
        ({"actions": [{"key": "a", "parts": ["base_motion"]}]}, "lacks control_mode, end_effector_position"),
        ({"state": [{"key": "prompt", "parts": ["gripper_qpos"]}]}, "sends two things under prompt"),
        ({"picture_offsets": [-1]}, "ascending steps up to 0"),
        ({"picture_offsets": [-1, 0]}, "needs `axes: time`"),
        ({"promt": {"key": "a"}}, "Did you mean 'prompt'"),
        ({"prompt": {"key": "a", "form": "listt"}}, "unknown form of the prompt 'listt'"),
        ({"executed_steps": 0}, "executed_steps of at least 1"),
    ],
)
def test_a_key_map_that_is_wrong_says_where(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    good = {
        "prompt": {"key": "prompt"},
        "actions": [{"key": "actions", "parts": [part.name for part in contract.ACTION_PARTS_HDF5]}],
    }
    file = tmp_path / "map.yaml"
    file.write_text(yaml.safe_dump(good | change))
    with pytest.raises(UserError, match=message):
        load_key_map(str(file))
    file.write_text(yaml.safe_dump(good))
    assert load_key_map(str(file)).offsets == (0,)
