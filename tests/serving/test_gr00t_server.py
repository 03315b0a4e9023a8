"""The server of GR00T's protocol, asked in the shapes of N1.5 and of N1.6."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq
from gr00t_client import GrootClient
from serving_support import blocked_host, observation, panda_omron_names, serving

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ChunkRequest, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy
from robocasa_lerobot.serving import gr00t
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.policy import load_served

INSTRUCTION = "open the left drawer"
TOKEN = "0123456789abcdef-token"


@pytest.fixture(scope="module")
def port(checkpoint: Path) -> Iterator[int]:
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "gr00t") as port:
        yield port


@pytest.fixture
def client(port: int) -> Iterator[GrootClient]:
    client = GrootClient(port)
    yield client
    client.close()


def nested(batch: list[list[Observation]]) -> dict[str, Any]:
    """N1.6's form: by modality, (B, T, ...)."""
    flat = [panda_omron_names(steps, INSTRUCTION) for steps in batch]
    out: dict[str, Any] = {"video": {}, "state": {}, "language": {}}
    for key in flat[0]:
        modality, _, name = key.partition(".")
        if modality in out:
            out[modality][name] = np.stack([one[key] for one in flat])
    out["state"] = {name: value.astype(np.float32) for name, value in out["state"].items()}
    out["language"]["annotation.human.task_description"] = [[INSTRUCTION]] * len(batch)
    return out


def expected(policy: ChunkPolicy, steps: list[Observation], seed: int, number: int) -> dict[str, np.ndarray]:
    steps = [{**one, "agent_pos": one["agent_pos"].astype(np.float32).astype(float)} for one in steps]
    actions = policy.predict([ChunkRequest("x", tuple(steps), INSTRUCTION, seed, number)])[0].actions
    return contract.split_action(actions)


STEPS = [[observation(1), observation(2)], [observation(3), observation(4)], [observation(5), observation(6)]]


def test_n16_nested_batch_with_a_seed_for_each_row(client: GrootClient, in_process: ChunkPolicy) -> None:
    options = {"seed": [7, 8, 9], "number": 4}
    action, info = client.call("get_action", {"observation": nested(STEPS), "options": options})
    assert info["number"] == [4, 4, 4]
    assert set(action) == {part.name for part in contract.ACTION_PARTS}
    for row, steps in enumerate(STEPS):
        for name, values in expected(in_process, steps, 7 + row, 4).items():
            assert action[name].dtype == np.float32
            np.testing.assert_array_equal(action[name][row], values)


def test_n16_flat_keys_of_the_simulations_wrapper(client: GrootClient, in_process: ChunkPolicy) -> None:
    inner = nested(STEPS[:1])
    flat = {f"{modality}.{name}": value for modality in ("video", "state") for name, value in inner[modality].items()}
    flat["annotation.human.task_description"] = [INSTRUCTION]
    action, _ = client.call("get_action", {"observation": flat, "options": {"seed": 1, "number": 0}})
    for name, values in expected(in_process, STEPS[0], 1, 0).items():
        np.testing.assert_array_equal(action[f"action.{name}"][0], values)


@pytest.mark.parametrize("batched", [False, True])
@pytest.mark.parametrize("endpoint", ["get_action", None])
def test_n15_flat_map(client: GrootClient, in_process: ChunkPolicy, batched: bool, endpoint: str | None) -> None:
    flat = panda_omron_names(STEPS[0], INSTRUCTION)
    data = {
        key: (value[None] if batched else value) if isinstance(value, np.ndarray) else value
        for key, value in flat.items()
    }
    # A text array, as its gym wrapper has it.
    data["annotation.human.task_description"] = np.array([INSTRUCTION])
    state = [key for key in data if key.startswith("state.")]
    data |= {key: data[key].astype(np.float32) for key in state}
    action = client.call(endpoint, {**data, "seed": 3, "number": 2})
    for name, values in expected(in_process, STEPS[0], 3, 2).items():
        np.testing.assert_array_equal(action[f"action.{name}"], values[None] if batched else values)


def test_names_of_n16s_base_checkpoint(client: GrootClient, in_process: ChunkPolicy) -> None:
    message = nested(STEPS[:1])
    names = ("res256_image_side_0", "res256_image_side_1", "res256_image_wrist_0")
    message["video"] = {name: message["video"][camera] for name, camera in zip(names, contract.CAMERAS, strict=True)}
    message["language"] = {"annotation.human.action.task_description": [[INSTRUCTION]]}
    action, _ = client.call("get_action", {"observation": message, "options": {"seed": 1, "number": 1}})
    for name, values in expected(in_process, STEPS[0], 1, 1).items():
        np.testing.assert_array_equal(action[name][0], values)


def test_reset_with_a_seed_begins_a_trial(client: GrootClient, in_process: ChunkPolicy) -> None:
    def ask() -> tuple[dict[str, np.ndarray], int]:
        action, info = client.call("get_action", {"observation": nested(STEPS[:1]), "options": None})
        return action, info["number"][0]

    for seed in (11, 12):
        assert client.call("reset", {"options": {"seed": seed}}) == {}
        for number in range(2):
            action, found = ask()
            assert found == number
            for name, values in expected(in_process, STEPS[0], seed, number).items():
                np.testing.assert_array_equal(action[name][0], values)
    for seeds in ([21, 22], [23]):  # rows that have not asked yet, and fewer rows than before
        assert client.call("reset", {"options": {"seed": seeds}}) == {}
        action, _ = client.call("get_action", {"observation": nested(STEPS[: len(seeds)]), "options": None})
        for row, seed in enumerate(seeds):
            for name, values in expected(in_process, STEPS[row], seed, 0).items():
                np.testing.assert_array_equal(action[name][row], values)
    assert client.call("reset", {"options": None}) == {}
    own, number = ask()
    assert number == 0
    assert not np.array_equal(
        own["end_effector_position"], expected(in_process, STEPS[0], 12, 0)["end_effector_position"]
    )


@pytest.mark.parametrize(("version", "prefix"), [("1.5", "video."), ("1.6", "")])
def test_the_modality_config_says_keys_and_offsets(checkpoint: Path, version: str, prefix: str) -> None:
    host = Host(load_served(read_source(str(checkpoint)), "cpu"))
    with serving(host, "gr00t", groot_version=version) as port:
        client = GrootClient(port)
        config = client.call("get_modality_config")
        client.close()
    assert config["video"]["modality_keys"] == [prefix + camera for camera in contract.CAMERAS]
    assert config["video"]["delta_indices"] == config["state"]["delta_indices"] == [-1, 0]
    assert config["action"]["delta_indices"] == list(range(8))
    assert config["language"]["modality_keys"] == ["annotation.human.task_description"]


def test_mistakes_are_told_and_the_server_goes_on(client: GrootClient) -> None:
    good = nested(STEPS[:1])
    wrong: list[tuple[Any, Any, str]] = [
        ("no_such", None, "Unknown endpoint"),
        (5, None, "Unknown endpoint"),
        ("kill", None, "kill is refused"),
        ("get_action", None, "expected a map"),
        ("get_action", {"observation": 5}, "expected a map"),
        ("get_action", {"observation": {**good, "video": {}}}, "no picture of it"),
        ("get_action", {"observation": good, "options": 5}, "options"),
        ("get_action", {"observation": good, "options": {"seed": -1}}, "seed"),
        ("get_action", {"observation": nested(STEPS), "options": {"seed": [1]}}, "one for each row"),
        ("get_action", {"observation": {**good, "state": nested(STEPS)["state"]}}, "same B"),
        ("reset", {"options": {"seed": "x"}}, "seed"),
    ]
    for endpoint, data, text in wrong:
        assert text in client.call(endpoint, data)["error"], (endpoint, text)
    assert client.call("ping")["status"] == "ok"


def test_wrong_tokens_are_told_in_their_words(checkpoint: Path) -> None:
    begun, go = threading.Event(), threading.Event()
    go.set()
    with serving(blocked_host(begun, go), "gr00t", TOKEN) as port:
        for token in (None, "wrong", TOKEN + "x"):
            client = GrootClient(port, token)
            for endpoint in ("ping", "get_modality_config", "kill", "get_action"):
                assert client.call(endpoint) == {"error": "Unauthorized: Invalid API token"}
            client.close()
        client = GrootClient(port, TOKEN)
        assert client.call("ping")["status"] == "ok"
        client.close()


def ask_blocked(client: GrootClient, found: list[Any]) -> None:
    """Ask the policy of `blocked_host`, and append its answer."""
    state = {name: value[None] for name, value in contract.split_state(np.zeros((1, 16))).items()}
    message = {"video": {}, "state": state, "language": {"annotation.human.task_description": [["x"]]}}
    found.append(client.call("get_action", {"observation": message, "options": None}))


def test_ping_is_answered_while_the_policy_computes() -> None:
    begun, go = threading.Event(), threading.Event()
    with serving(blocked_host(begun, go), "gr00t") as port:
        found: list[Any] = []
        slow = GrootClient(port)
        asking = threading.Thread(target=ask_blocked, args=(slow, found))
        asking.start()
        assert begun.wait(30)
        client = GrootClient(port)
        assert client.call("ping")["status"] == "ok"
        assert not found
        go.set()
        asking.join(30)
        client.close()
        slow.close()
    assert found[0][0]["gripper_close"].shape == (1, 1, 1)


def test_more_clients_than_the_limit_wait_for_their_turn() -> None:
    begun, go = threading.Event(), threading.Event()
    with serving(blocked_host(begun, go), "gr00t", limits=Limits(clients=2)) as port:
        found: list[Any] = []
        clients = [GrootClient(port) for _ in range(5)]
        threads = [threading.Thread(target=ask_blocked, args=(client, found)) for client in clients]
        for thread in threads:
            thread.start()
        assert begun.wait(30)
        threads[-1].join(0.5)
        assert found == []  # nobody is sent away
        go.set()
        for thread, client in zip(threads, clients, strict=True):
            thread.join(30)
            client.close()
    assert [action["gripper_close"].shape for action, _ in found] == [(1, 1, 1)] * 5


def test_what_a_client_sends_beyond_its_turn_waits_with_it() -> None:
    begun, go = threading.Event(), threading.Event()
    with serving(blocked_host(begun, go), "gr00t", limits=Limits(clients=1)) as port:
        slow, found = GrootClient(port), list[Any]()
        asking = threading.Thread(target=ask_blocked, args=(slow, found))
        asking.start()
        assert begun.wait(30)
        flood = zmq.Context.instance().socket(zmq.DEALER)
        for option, value in ((zmq.SNDHWM, 1), (zmq.LINGER, 0), (zmq.SNDTIMEO, 500)):
            flood.setsockopt(option, value)
        flood.connect(f"tcp://127.0.0.1:{port}")
        most, sent = 150, 0
        with suppress(zmq.Again):
            while sent < most:
                flood.send(bytes(2**20))
                sent += 1
        flood.close()
        go.set()
        asking.join(30)
        slow.close()
    assert sent < most  # what the system's own buffers hold, and two


def test_sessions_outlive_the_limit_until_their_clients_are_silent_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go = threading.Event(), threading.Event()
    go.set()
    with serving(blocked_host(begun, go), "gr00t", limits=Limits(clients=2)) as port:
        clients = [GrootClient(port) for _ in range(4)]

        def numbers(*asking: GrootClient) -> list[int]:
            found: list[Any] = []
            for client in asking:
                ask_blocked(client, found)
            return [info["number"][0] for _, info in found]

        assert numbers(*clients, *clients) == [0, 0, 0, 0, 1, 1, 1, 1]
        monkeypatch.setattr(gr00t, "_SILENT_SECONDS", 0.0)
        # Who asks last is known, and so is who is being answered, however long ago it asked.
        assert numbers(clients[3]) == [2]
        begun.clear()
        go.clear()
        late: list[Any] = []
        asking = threading.Thread(target=ask_blocked, args=(clients[3], late))
        asking.start()
        assert begun.wait(30)
        for client in (*clients[:3], *clients[:3]):
            assert client.call("reset", {"options": None}) == {}
        go.set()
        asking.join(30)
        assert late[0][1]["number"] == [3]
        assert numbers(clients[3], clients[0]) == [4, 0]
        monkeypatch.undo()
        monkeypatch.setattr(gr00t, "_KNOWN", 1)
        assert numbers(*clients, *clients)[4:] == [0, 0, 0, 0]
        for client in clients:
            client.close()


def test_kill_ends_the_server_where_it_may() -> None:
    go = threading.Event()
    with serving(blocked_host(go, go), "gr00t", allow_kill=True) as port:
        client = GrootClient(port)
        assert client.call("kill")["status"] == "ok"
        client.close()
