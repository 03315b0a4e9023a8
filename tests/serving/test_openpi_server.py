"""The server of openpi's protocol: the same actions as in process, whatever the names; mistakes are told."""

from __future__ import annotations

import itertools
import threading
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from serving_support import (
    SIZE,
    blocked_host,
    observation,
    openpi_names,
    own_names,
    panda_omron_names,
    serving,
)
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import ClientConnection, connect

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ChunkRequest, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import read_source
from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import load_served
from robocasa_lerobot.wire.codec import decode, encode

INSTRUCTION = "open the left drawer"


@contextmanager
def client(port: int) -> Iterator[tuple[ClientConnection, dict[str, Any]]]:
    with connect(f"ws://127.0.0.1:{port}", compression=None, max_size=None) as connection:
        yield connection, decode(connection.recv(timeout=60))


def ask(connection: ClientConnection, message: dict[str, Any]) -> dict[str, Any]:
    connection.send(encode(message, "openpi"))
    answer = connection.recv(timeout=60)
    assert isinstance(answer, bytes), answer
    return dict(decode(answer))


def expected(policy: ChunkPolicy, steps: list[Observation], seed: int, number: int) -> np.ndarray:
    return policy.predict([ChunkRequest("x", tuple(steps), INSTRUCTION, seed, number)])[0].actions


def test_metadata_says_what_the_policy_needs_and_gives(openpi_port: int, checkpoint: Path) -> None:
    with client(openpi_port) as (_, said):
        source = read_source(str(checkpoint))
        assert said["policy"]["fingerprint"] == source.fingerprint
        assert said["history_offsets"] == [-1, 0]
        assert said["executed_steps"] == 8
        assert said["action_horizon"] >= 8
        assert said["image_size"] == [SIZE, SIZE]
        assert said["cameras"] == list(contract.CAMERAS)
        assert said["fps"] == 20
        assert sum(size for _, size in said["state_parts"]) == contract.STATE_SIZE
        assert [name for name, _ in said["action_parts"]] == [part.name for part in contract.ACTION_PARTS]


@pytest.mark.parametrize(
    ("names", "order"), [(own_names, "stored"), (panda_omron_names, "hdf5"), (openpi_names, "hdf5")]
)
def test_actions_are_those_of_the_same_policy_in_process(
    openpi_port: int, in_process: ChunkPolicy, names: Callable[..., dict[str, Any]], order: str
) -> None:
    steps = [observation(1), observation(2)]
    with client(openpi_port) as (connection, _):
        for seed, number in ((5, 0), (5, 1), (2**40, 7)):
            answer = ask(connection, {**names(steps, INSTRUCTION), "seed": seed, "number": number})
            assert answer["action_order"] == order
            found = answer["actions"] if order == "stored" else contract.hdf5_to_stored(answer["actions"])
            np.testing.assert_array_equal(found, expected(in_process, steps, seed, number))


def test_clients_at_once_get_their_own_actions(openpi_port: int, in_process: ChunkPolicy) -> None:
    def steps(index: int) -> list[dict[str, Any]]:
        return [observation(index), observation(index + 50)]

    def one(index: int) -> list[Any]:
        with client(openpi_port) as (connection, _):
            return [
                ask(connection, {**own_names(steps(index), INSTRUCTION), "seed": index, "number": n})["actions"]
                for n in range(3)
            ]

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(one, range(4)))
    # The policy in process works for one caller at a time.
    for index, number in itertools.product(range(4), range(3)):
        wanted = expected(in_process, steps(index), index, number)
        np.testing.assert_array_equal(found[index][number], wanted)


def test_without_a_seed_the_noise_is_the_sessions_own_and_comes_again(checkpoint: Path) -> None:
    message = own_names([observation(1), observation(2)], INSTRUCTION)

    def sessions(seed: int) -> list[np.ndarray]:
        host = Host(load_served(read_source(str(checkpoint)), "cpu"), seed)
        found = []
        with serving(host, "openpi") as port:
            for _ in range(2):
                with client(port) as (connection, _):
                    found += [ask(connection, message)["actions"] for _ in range(2)]
                    found.append(ask(connection, {**message, "reset": True})["actions"])
        return found

    first, again, other = sessions(0), sessions(0), sessions(1)
    assert len({found.tobytes() for found in first}) == 6
    for one, same, different in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(one, same)
        assert not np.array_equal(one, different)


def test_seed_alone_counts_the_requests(openpi_port: int, in_process: ChunkPolicy) -> None:
    steps = [observation(3), observation(4)]
    with client(openpi_port) as (connection, _):
        answers = [ask(connection, {**own_names(steps, INSTRUCTION), "seed": 9}) for _ in range(2)]
        answers += [ask(connection, {**own_names(steps, INSTRUCTION), "seed": 10})]
    assert [answer["number"] for answer in answers] == [0, 1, 0]
    for answer, (seed, number) in zip(answers, ((9, 0), (9, 1), (10, 0)), strict=True):
        np.testing.assert_array_equal(answer["actions"], expected(in_process, steps, seed, number))


GOOD = own_names([observation(1), observation(2)], INSTRUCTION)
LEFT = contract.IMAGE_KEYS[0]


def without(key: str) -> dict[str, Any]:
    return {name: value for name, value in GOOD.items() if name != key}


MISTAKES: dict[str, tuple[Any, str]] = {
    "no state": (without(contract.STATE_KEY), "state: not in the observation"),
    "misspelt state": ({**without(contract.STATE_KEY), "observation.states": np.zeros(16)}, "Did you mean"),
    "no picture": (without(LEFT), "robot0_agentview_left: no picture"),
    "no instruction": (without("task"), "instruction: not in"),
    "short state": ({**GOOD, contract.STATE_KEY: np.zeros((2, 15))}, r"found an array of shape \(2, 15\)"),
    "nan": ({**GOOD, contract.STATE_KEY: np.full((2, 16), np.nan)}, "not finite"),
    "state of nine": ({**openpi_names([observation(1)] * 2, "x"), "observation/state": np.zeros(9)}, r"\(16,\)"),
    "channels first": ({**GOOD, LEFT: np.zeros((2, 3, SIZE, SIZE), np.uint8)}, "channels last"),
    "floats for pictures": ({**GOOD, LEFT: np.zeros((2, SIZE, SIZE, 3))}, "uint8"),
    "other size": ({**GOOD, LEFT: np.zeros((2, 64, 64, 3), np.uint8)}, "found pictures of 64x64, expected 32x32"),
    "one step": (own_names([observation(1)], "x"), r"found 1 step\(s\), expected those at the control steps"),
    "steps differ": ({**GOOD, LEFT: np.zeros((3, SIZE, SIZE, 3), np.uint8)}, "as many of each"),
    "instruction a number": ({**GOOD, "task": 3}, "expected text"),
    "negative seed": ({**GOOD, "seed": -1}, "seed: found -1"),
    "seed a text": ({**GOOD, "seed": "1"}, "whole number"),
    "a list": ([1, 2], "expected a map"),
    "part missing": (
        {k: v for k, v in panda_omron_names([observation(1)] * 2, "x").items() if k != "state.base_position"},
        "state.base_position: not in the observation",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_and_closes_the_connection(openpi_port: int, name: str) -> None:
    message, text = MISTAKES[name]
    with client(openpi_port) as (connection, _):
        connection.send(encode(message, "openpi"))
        with pytest.raises(AssertionError, match=text):
            assert not connection.recv(timeout=60)
        with pytest.raises(ConnectionClosedError) as closed:
            connection.recv(timeout=60)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1011


def test_resize_and_repeat_history_are_asked_for(checkpoint: Path, in_process: ChunkPolicy) -> None:
    policy = load_served(read_source(str(checkpoint)), "cpu")
    small = observation(1)
    large = {**small, "pixels": {k: v.repeat(2, 0).repeat(2, 1) for k, v in small["pixels"].items()}}
    with serving(Host(policy, resize=True, repeat_history=True), "openpi") as port, client(port) as (connection, _):
        message = {key: value[0] if key != "task" else value for key, value in own_names([large], INSTRUCTION).items()}
        answer = ask(connection, {**message, "seed": 1, "number": 0})
    np.testing.assert_array_equal(answer["actions"], expected(in_process, [small, small], 1, 0))


def test_health_and_handshakes_are_answered_while_the_policy_computes() -> None:
    begun, go = threading.Event(), threading.Event()
    with serving(blocked_host(begun, go), "openpi") as port, client(port) as (slow, _):
        slow.send(encode({"agent_pos": np.zeros(16), "task": "x"}, "openpi"))
        assert begun.wait(30)
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/healthz", timeout=30) as page:
            assert page.read() == b"OK\n"
        with client(port) as (_, said):
            assert said["server"] == "robocasa_lerobot"
        go.set()
        assert decode(slow.recv(timeout=30))["actions"].shape == (1, 12)


@pytest.mark.parametrize(("instruction", "text"), [("fail", "the policy broke"), ("nan", "not finite")])
def test_a_policy_that_fails_is_told_and_others_go_on(instruction: str, text: str) -> None:
    go = threading.Event()
    go.set()
    with serving(blocked_host(threading.Event(), go), "openpi") as port:
        for words in (instruction, "x"):
            with client(port) as (connection, _):
                connection.send(encode({"agent_pos": np.zeros(16), "task": words}, "openpi"))
                answer = connection.recv(timeout=30)
                if words == "x":
                    assert isinstance(answer, bytes)
                else:
                    assert isinstance(answer, str)
                    assert text in answer
                    assert "/" not in answer  # no places in our files
