"""The server of vla-eval's protocol: an episode's actions are those of the same policy in process, step by step."""

from __future__ import annotations

import json
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from serving_support import SIZE, blocked_host, observation, own_names, serving
from websockets.sync.client import ClientConnection, connect

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served
from robocasa_lerobot.wire.codec import decode, encode
from robocasa_lerobot.wire.images import encode_png

INSTRUCTION = "open the left drawer"
STEPS = 19  # two chunks of eight, and a part of a third
TOKEN = "0123456789abcdef-token"


@pytest.fixture(scope="module")
def port(checkpoint: Path) -> Iterator[int]:
    with serving(Host(load_served(read_source(str(checkpoint)), "cpu")), "vla_eval") as port:
        yield port


class Client:
    def __init__(self, connection: ClientConnection) -> None:
        self.connection, self.sequence = connection, 0

    def send(self, kind: Any, payload: Any, **other: Any) -> None:
        self.sequence += 1
        message = {"type": kind, "payload": payload, "seq": self.sequence, "timestamp": 0.0}
        self.connection.send(encode({**message, **other}, "vla_eval"))

    def receive(self) -> dict[str, Any]:
        answer = self.connection.recv(timeout=60)
        assert isinstance(answer, bytes)
        return dict(decode(answer))

    def ask(self, kind: Any, payload: Any) -> dict[str, Any]:
        self.send(kind, payload)
        answer = self.receive()
        assert answer["seq"] == self.sequence
        return answer


@contextmanager
def client(port: int) -> Iterator[Client]:
    with connect(f"ws://127.0.0.1:{port}", compression=None, max_size=None) as connection:
        yield Client(connection)


def as_vla_eval(one: Observation, png: bool) -> dict[str, Any]:
    """As its RoboCasa365 benchmark names things."""
    images = {f"video.{camera}": encode_png(picture) if png else picture for camera, picture in one["pixels"].items()}
    state = {f"state.{name}": values for name, values in contract.split_state(one["agent_pos"]).items()}
    return {"images": images, "state": state, "task_description": INSTRUCTION}


def in_process_actions(policy: ChunkPolicy, seed: int) -> list[np.ndarray]:
    actor = ChunkActor("x", policy.shape, lambda request: policy.predict([request])[0])
    actor.reset(seed, None)
    return [actor.act(observation(step), INSTRUCTION) for step in range(STEPS)]


@pytest.mark.parametrize("png", [True, False])
@pytest.mark.parametrize("start", [{"seed": 21}, {"task": {"name": "OpenDrawer", "policy_seed": 21}}])
def test_an_episodes_actions_are_those_of_the_policy_in_process(
    port: int, in_process: ChunkPolicy, png: bool, start: dict[str, Any]
) -> None:
    with client(port) as one:
        one.ask("hello", {"protocol_version": 1})
        for _ in range(2):  # a second episode starts from nothing
            one.send("episode_start", start)
            for step, expected in enumerate(in_process_actions(in_process, 21)):
                answer = one.ask("observation", as_vla_eval(observation(step), png))
                assert answer["type"] == "action"
                np.testing.assert_array_equal(contract.hdf5_to_stored(answer["payload"]["actions"]), expected)
            one.send("episode_end", {})


def test_our_own_names_get_stored_order_and_episodes_their_own_noise(port: int, in_process: ChunkPolicy) -> None:
    with client(port) as one:
        found = []
        for start, inside in (({"seed": 21}, {}), ({}, {}), ({}, {}), ({}, {"seed": 21})):
            one.send("episode_start", start)
            message = own_names([observation(0)], INSTRUCTION)
            message = {**{key: value if key == "task" else value[0] for key, value in message.items()}, **inside}
            found.append(one.ask("observation", message)["payload"]["actions"])
    for told in (found[0], found[3]):
        np.testing.assert_array_equal(told, in_process_actions(in_process, 21)[0])
    assert len({one.tobytes() for one in found}) == 3


def test_hello_says_what_the_policy_is(port: int) -> None:
    with client(port) as one:
        said = one.ask("hello", {"harness_version": "0.8.0", "protocol_version": 1, "benchmark": "x"})
    assert said["type"] == "hello"
    payload = said["payload"]
    assert payload["protocol_version"] == 1
    assert payload["observation_params"] == {"camera_size": SIZE}
    assert payload["executed_steps"] == 1
    assert payload["chunk"] == {"executed_steps": 8, "history_offsets": [-1, 0]}
    assert sum(spec["dims"] for spec in payload["action_spec"].values()) == contract.ACTION_SIZE


def test_mistakes_are_told_and_the_connection_goes_on(port: int) -> None:
    good = as_vla_eval(observation(1), png=True)
    picture = good["images"]["video.robot0_agentview_left"]

    def with_picture(**changed: Any) -> dict[str, Any]:
        return {**good, "images": {**good["images"], "video.robot0_agentview_left": {**picture, **changed}}}

    wrong: list[tuple[Any, Any, str]] = [
        ("observation", good, "episode_start"),
        ("hello", {"protocol_version": 2}, "protocol_version"),
        ("dance", {}, "type"),
        ("observation", [1], "map as payload"),
        ("episode_start", {"seed": "x"}, "seed"),
        ("episode_start", {"task": {"policy_seed": -1}}, "policy_seed"),
        ("observation", with_picture(shape=[16, 16, 3]), "says that it has"),
        ("observation", with_picture(shape=[60000, 60000, 3]), "too large"),
        ("observation", with_picture(data=b"\x89PNG\r\n\x1a\nbroken"), "cannot be read"),
        ("observation", with_picture(format="raw"), "raw picture"),
        ("observation", with_picture(data=b"GIF89a"), "cannot be read"),
    ]
    with client(port) as one:
        for kind, payload, text in wrong:
            one.send(kind, payload)
            answer = one.receive()
            assert answer["type"] == "error", kind
            assert text in answer["payload"]["error"]
        for frame in ("text", b"\xc1", msgpack.packb({"type": "hello"}), msgpack.packb([1])):
            one.connection.send(frame)
            assert one.receive()["type"] == "error"
        one.send("error", {"why": "a client may complain"})
        one.send("episode_start", {"seed": 1})
        without = {**good, "state": {}}
        assert "state" in one.ask("observation", without)["payload"]["error"]
        assert one.ask("observation", good)["type"] == "action"


def test_a_failure_of_the_policy_ends_the_episode_and_says_so() -> None:
    go = threading.Event()
    go.set()
    step = {"agent_pos": np.zeros(16), "task": "x"}
    with serving(blocked_host(go, go), "vla_eval") as port, client(port) as one:
        one.send("episode_start", {})
        assert one.ask("observation", step)["type"] == "action"
        error = one.ask("observation", {**step, "task": "fail"})["payload"]["error"]
        assert "the policy broke; the episode has ended with it" in error
        assert "before episode_start" in one.ask("observation", step)["payload"]["error"]
        one.send("episode_start", {})
        assert one.ask("observation", step)["type"] == "action"


def get(port: int, path: str, **headers: str) -> tuple[int, dict[str, Any]]:
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=30) as page:
            return page.status, json.load(page)
    except urllib.error.HTTPError as error:
        body = error.read()
        return error.code, json.loads(body) if body.startswith(b"{") else {}


def test_health_and_config_while_the_policy_computes() -> None:
    begun, go = threading.Event(), threading.Event()
    with serving(blocked_host(begun, go), "vla_eval") as port, client(port) as slow:
        slow.send("episode_start", {})
        slow.send("observation", {"agent_pos": np.zeros(16), "task": "x"})
        assert begun.wait(30)
        assert get(port, "/health") == (200, {"status": "ok"})
        assert get(port, "/config")[1]["config"]["max_batch_size"] == 1
        status, said = get(port, "/config?max_batch_size=8")
        assert status == 422
        assert "cannot be changed" in said["errors"][0]
        with client(port) as other:
            assert other.ask("hello", {})["type"] == "hello"
        go.set()
        assert slow.receive()["type"] == "action"


def test_the_token_may_stand_in_the_address() -> None:
    go = threading.Event()
    with serving(blocked_host(go, go), "vla_eval", TOKEN) as port:
        assert get(port, "/health")[0] == 200
        assert get(port, "/config")[0] == 401
        assert get(port, "/config?token=wrong")[0] == 401
        assert get(port, f"/config?token={TOKEN}")[0] == 200
        assert get(port, "/config", Authorization=f"Bearer {TOKEN}")[0] == 200
        with connect(f"ws://127.0.0.1:{port}/?token={TOKEN}") as connection:
            assert Client(connection).ask("hello", {})["type"] == "hello"
