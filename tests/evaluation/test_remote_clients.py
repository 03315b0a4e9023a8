"""Clients of three protocols against bytes as the projects write them, and every way in which a server can fail."""

from __future__ import annotations

import collections
import contextlib
import threading
import time
from collections.abc import Iterator
from typing import Any

import msgpack
import numpy as np
import pytest
import zmq
from policy_sockets import Gr00tServer, OpenpiServer, ScriptedWebsocket, VlaEvalServer
from websockets.sync.server import serve

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.address import parse_address
from robocasa_lerobot.evaluation.remote.client import TOKEN_VARIABLE, Timeouts
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.failures import AnswerError, LostError, ServerSaidError
from robocasa_lerobot.evaluation.remote.key_map import ActionKey, KeyMap
from robocasa_lerobot.evaluation.remote.translation import actions_of

SHORT = Timeouts(connect=10.0, answer=1.0, first_answer=10.0)
HASTY = Timeouts(connect=0.6)
ACTIONS = np.arange(24, dtype=np.float32).reshape(2, 12)
# Written by openpi-client 0.1.2, vla-eval 0.8.0 and numpy 2.2.6.
OPENPI_METADATA = b"\x81\xaareset_pose\x92\x00\x01"
OPENPI_REQUEST = (
    b"\x82\xa6prompt\xa2go\xb1observation/state\x84\xc4\x0b__ndarray__\xc3\xc4\x04data\xc4\x08\x00\x00\x80?\x00\x00\x00@"
    b"\xc4\x05dtype\xa3<f4\xc4\x05shape\x91\x02"
)
OPENPI_ANSWER = (
    b"\x82\xa7actions\x84\xc4\x0b__ndarray__\xc3\xc4\x04data\xc4\x04\x00\x00\xc0?\xc4\x05dtype\xa3<f4\xc4\x05shape\x92"
    b"\x01\x01\xadserver_timing\x81\xa8infer_ms\xcb@\x00\x00\x00\x00\x00\x00\x00"
)
VLA_EVAL_HELLO = (
    b"\x84\xa4type\xa5hello\xa7payload\x84\xafharness_version\xa50.8.0\xb0protocol_version\x01\xacmodel_server\xa5Dummy"
    b"\xaccapabilities\x80\xa3seq\x01\xa9timestamp\xcb?\xe0\x00\x00\x00\x00\x00\x00"
)
VLA_EVAL_OBSERVATION = (  # up to its time
    b"\x84\xa4type\xabobservation\xa7payload\x81\xa5state\x84\xab__ndarray__\xc3\xa4data\xc4\x04\x00\x00\x80?"
    b"\xa5dtype\xa3<f4\xa5shape\x91\x01\xa3seq\x03\xa9timestamp"
)
VLA_EVAL_ACTION = (
    b"\x84\xa4type\xa6action\xa7payload\x81\xa7actions\x84\xab__ndarray__\xc3\xa4data\xc4\x04\x00\x00\xc0?"
    b"\xa5dtype\xa3<f4\xa5shape\x91\x01\xa3seq\x03\xa9timestamp\xcb?\xe0\x00\x00\x00\x00\x00\x00"
)
GR00T_REPLY = (
    b"\x92\x81\xa8action.x\x82\xb1__ndarray_class__\xc3\xa6as_npy\xc4\x84\x93NUMPY\x01\x00v\x00{'descr': '<f4', "
    b"'fortran_order': False, 'shape': (1, 1), }                                                          \n"
    b"\x00\x00\xc0?\x80"
)


def test_golden_frames_of_openpi() -> None:
    with ScriptedWebsocket([OPENPI_METADATA], [OPENPI_ANSWER]) as server:
        client = connect(f"openpi://127.0.0.1:{server.port}", SHORT)
        assert client.metadata == {"reset_pose": [0, 1]}
        answer = client.infer({"prompt": "go", "observation/state": np.array([1, 2], np.float32)})
        assert server.requests == [OPENPI_REQUEST]
        np.testing.assert_array_equal(answer["actions"], np.array([[1.5]], np.float32))
        client.close()


def test_golden_frames_of_vla_eval() -> None:
    with ScriptedWebsocket([], [VLA_EVAL_HELLO, None, VLA_EVAL_ACTION]) as server:
        client = connect(f"vla_eval://127.0.0.1:{server.port}", SHORT)
        assert client.metadata["model_server"] == "Dummy"
        answer = client.infer({"state": np.array([1], np.float32)})
        assert [msgpack.unpackb(frame)["type"] for frame in server.requests] == [
            "hello",
            "episode_start",
            "observation",
        ]
        assert server.requests[-1].startswith(VLA_EVAL_OBSERVATION)
        np.testing.assert_array_equal(answer["actions"], np.array([1.5], np.float32))
        client.close()


@contextlib.contextmanager
def scripted_reply(replies: list[bytes]) -> Iterator[tuple[int, list[bytes]]]:
    """A ZeroMQ service that answers with these bytes, one after the other."""
    context, requests = zmq.Context(), list[bytes]()
    socket = context.socket(zmq.REP)
    port = socket.bind_to_random_port("tcp://127.0.0.1")

    def run() -> None:
        for reply in replies:
            requests.append(socket.recv())
            socket.send(reply)
        socket.close(linger=1000)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    yield port, requests
    thread.join(timeout=5)
    context.term()


def test_golden_replies_of_gr00t() -> None:
    unknown = msgpack.packb({"error": "Unknown endpoint: get_modality_config"})
    with scripted_reply([msgpack.packb({"status": "ok"}), unknown, GR00T_REPLY]) as (port, requests):
        client = connect(f"gr00t://127.0.0.1:{port}", SHORT)
        assert client.metadata == {"gr00t_version": None, "modality_config": {}}
        answer = client.infer({"state.x": np.array([[1.0]], np.float32)})
        np.testing.assert_array_equal(answer["action.x"], np.array([[1.5]], np.float32))
        assert requests[0] == msgpack.packb({"endpoint": "ping"})
        assert b"get_action" in requests[2]
        assert b"\x82\xb1__ndarray_class__\xc3\xa6as_npy" in requests[2]
        client.close()


@pytest.mark.parametrize("version", ["N1.5", "N1.6", "N1.7"])
def test_versions_of_gr00t_are_told_apart_and_asked_in_their_way(version: str) -> None:
    config = {"video": {"modality_keys": ["left"], "delta_indices": [-2, 0]}}
    with Gr00tServer(lambda observation: {"action.x": ACTIONS}, version, config, token="secret") as server:
        client = connect(server.url, SHORT, token="secret")
        assert client.metadata == {"gr00t_version": version, "modality_config": config}
        np.testing.assert_array_equal(client.infer({"left": ACTIONS})["action.x"], ACTIONS)
        client.reset()
        asked = [request["endpoint"] for request in server.requests]
        assert asked == ["ping", "get_modality_config", "get_action", *(["reset"] if version != "N1.5" else [])]
        client.close()
        with pytest.raises(UserError, match=f"Invalid API token.*{TOKEN_VARIABLE}"):
            connect(server.url, SHORT)


def test_a_service_that_hides_its_configuration_is_told_by_its_complaint() -> None:
    class Quiet(Gr00tServer):
        def _reply(self, request: dict[str, Any]) -> Any:
            if request.get("endpoint") == "get_modality_config":
                raise ValueError("Unknown endpoint: get_modality_config")
            return super()._reply(request)

    with Quiet(lambda observation: {"x": ACTIONS}, "N1.6", {}) as server:
        client = connect(server.url, SHORT)
        np.testing.assert_array_equal(client.infer({"left": ACTIONS})["x"], ACTIONS)
        assert client.metadata["gr00t_version"] == "N1.6"
        client.close()


def url_of(protocol: str, port: int) -> str:
    return f"{protocol}://127.0.0.1:{port}"


@contextlib.contextmanager
def serving(protocol: str, answer: Any, port: int = 0) -> Iterator[Any]:
    servers: dict[str, Any] = {
        "openpi": lambda: OpenpiServer(answer, port=port),
        "vla_eval": lambda: VlaEvalServer(answer, port=port),
        "gr00t": lambda: Gr00tServer(answer, "N1.6", {}, port=port),
    }
    with servers[protocol]() as server:
        yield server


def ask_for_ever(client: Any) -> None:
    for _ in range(1000):
        client.infer({})
        time.sleep(0.01)


PROTOCOLS = ("openpi", "vla_eval", "gr00t")


@pytest.mark.costly
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_refused_closed_and_timed_out_are_told_apart(protocol: str) -> None:
    slow = threading.Event()

    def answer(observation: Any) -> Any:
        if slow.is_set():
            time.sleep(1.5)
        return {"actions": ACTIONS}

    signs = []
    with serving(protocol, answer) as server:
        client = connect(server.url, SHORT, waiting=lambda: signs.append(1))
        client.infer({})
        slow.set()
        with pytest.raises(LostError, match=r"timed out, no answer within 1 s"):
            client.infer({})
        assert signs
        client.close()
        patient = connect(server.url, SHORT)
        patient.infer({})  # the first answer may take longer
        slow.clear()
        killed = threading.Timer(0.2, server.stop)
        killed.start()
        with pytest.raises(LostError, match="the server closed the connection"):
            ask_for_ever(patient)
        killed.join()
        patient.close()
    with pytest.raises(LostError, match=r"refused, nobody listens there; tried for 0\.6 s"):
        connect(url_of(protocol, server.port), HASTY)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_a_server_may_start_late(protocol: str) -> None:
    with serving(protocol, None) as server:
        port = server.port
    with contextlib.ExitStack() as stack:

        def start() -> None:
            stack.enter_context(serving(protocol, lambda observation: {"actions": ACTIONS}, port))

        threading.Timer(0.7, start).start()
        client = connect(url_of(protocol, port), Timeouts(connect=10.0))
        np.testing.assert_array_equal(client.infer({})["actions"], ACTIONS)
        client.close()


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_what_a_server_says_of_its_failure_is_told(protocol: str) -> None:
    def answer(observation: Any) -> Any:
        raise RuntimeError("out of memory")

    with serving(protocol, answer) as server:
        client = connect(server.url, SHORT)
        with pytest.raises(ServerSaidError, match="out of memory"):
            client.infer({})
        client.close()


@pytest.mark.parametrize("frame", [b"\xc1", b"\x93\x01\x02\x03", b"\x81\xa1a\xc7\xff\x01"])
def test_bytes_that_are_no_answer_are_an_error(frame: bytes) -> None:
    with ScriptedWebsocket([b"\x80"], [frame]) as server:
        client = connect(url_of("openpi", server.port), SHORT)
        with pytest.raises((AnswerError, LostError)):
            client.infer({})
        client.close()


def test_another_server_than_expected_is_named() -> None:
    with OpenpiServer(lambda observation: {}) as server, pytest.raises(AnswerError, match="expected 'hello'"):
        connect(url_of("vla_eval", server.port), SHORT)
    with VlaEvalServer(lambda observation: {}) as server, pytest.raises(LostError, match="sends its metadata first"):
        connect(url_of("openpi", server.port), HASTY)


@pytest.mark.parametrize(("status", "message"), [(401, TOKEN_VARIABLE), (404, "HTTP 404, expected a websocket")])
def test_a_handshake_that_is_refused_says_what_to_do(status: int, message: str) -> None:
    def refuse(connection: Any, request: Any) -> Any:
        return None if request.headers.get("Authorization") == "Api-Key secret" else connection.respond(status, "no")

    with serve(lambda ws: ws.send(b"\x80"), "127.0.0.1", 0, process_request=refuse) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = url_of("openpi", server.socket.getsockname()[1])
        with pytest.raises(UserError, match=message):
            connect(url, SHORT)
        connect(url, SHORT, token="secret").close()
        server.shutdown()


def test_a_server_that_has_no_place_is_asked_again() -> None:
    full = threading.Event()
    full.set()
    tries: list[int] = []

    def send_away(connection: Any, request: Any) -> Any:
        tries.append(1)
        return connection.respond(503, "2 clients are served already\n") if full.is_set() else None

    with serve(lambda ws: ws.send(b"\x80"), "127.0.0.1", 0, process_request=send_away) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = url_of("openpi", server.socket.getsockname()[1])
        with pytest.raises(LostError, match=r"no place, HTTP 503 \(2 clients are served already\); tried for 0\.6 s"):
            connect(url, HASTY)
        assert len(tries) > 1
        threading.Timer(0.5, full.clear).start()
        connect(url, SHORT).close()
        server.shutdown()


@pytest.mark.parametrize(
    ("text", "parsed"),
    [
        ("openpi://host", ("openpi", "host", 8000, "")),
        ("gr00t://10.0.0.7", ("gr00t", "10.0.0.7", 5555, "")),
        ("vla_eval://[::1]:9", ("vla_eval", "[::1]", 9, "")),
        ("openpi+wss://host:443/v1/robot", ("openpi", "host", 443, "/v1/robot")),
    ],
)
def test_addresses(text: str, parsed: tuple[str, str, int, str]) -> None:
    address = parse_address(text)
    assert (address.protocol, address.host, address.port, address.path) == parsed
    assert parse_address(address.text) == address
    assert address.websocket.startswith("wss://" if "wss" in text else "ws://")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("opnepi://host:1", "Did you mean 'openpi'"),
        ("openpi://", "expected openpi://HOST:PORT"),
        ("openpi://host:port", "expected openpi://HOST:PORT"),
        ("gr00t+wss://host", "unknown protocol"),
    ],
)
def test_an_address_that_is_none_is_an_error(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        parse_address(text)


def damaged(frame: bytes, rng: np.random.Generator) -> bytes:
    """A frame with bytes changed, left out, doubled or cut off."""
    data = bytearray(frame)
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.integers(0, max(1, len(data))))
        match int(rng.integers(0, 4)):
            case 0:
                data[place : place + 1] = rng.bytes(1)
            case 1:
                del data[place : place + int(rng.integers(1, 9))]
            case 2:
                data[place:place] = rng.bytes(int(rng.integers(1, 9)))
            case _:
                del data[place:]
    return bytes(data)


def outcome_of(client: Any) -> str:
    try:
        actions_of(ANY_WIDTH, client.infer({}))
    except (AnswerError, LostError, ServerSaidError) as error:
        return type(error).__name__
    return "actions"


ANY_WIDTH = KeyMap(actions=[ActionKey("actions", [part.name for part in contract.ACTION_PARTS])])


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_damaged_answers_are_errors_or_actions_and_never_more(protocol: str) -> None:
    rng = np.random.default_rng(len(protocol))
    chunk = {b"__ndarray__": True, b"data": bytes(96), b"dtype": "<f4", b"shape": [2, 12]}
    text = {key.decode(): value for key, value in chunk.items()}
    answers = {
        "openpi": {"actions": chunk, "server_timing": {"infer_ms": 1.0}},
        "vla_eval": {"type": "action", "payload": {"actions": text}, "seq": 3, "timestamp": 0.0},
        "gr00t": [{"actions": text}, {}],
    }
    whole = msgpack.packb(answers[protocol])
    seen = collections.Counter[str]()
    hasty = Timeouts(connect=5.0, answer=0.1, first_answer=0.1)
    for frame in (whole, *(damaged(whole, rng) for _ in range(60))):
        if protocol == "gr00t":
            unknown = msgpack.packb({"error": "Unknown endpoint"})
            with scripted_reply([msgpack.packb({"status": "ok"}), unknown, frame]) as (port, _):
                client = connect(url_of(protocol, port), hasty)
                seen[outcome_of(client)] += 1
                client.close()
            continue
        greeting = [b"\x80"] if protocol == "openpi" else []
        replies = [frame] if protocol == "openpi" else [VLA_EVAL_HELLO, None, frame]
        with ScriptedWebsocket(greeting, replies) as server:
            client = connect(url_of(protocol, server.port), hasty)
            seen[outcome_of(client)] += 1
            client.close()
    assert seen["actions"] >= 1
    assert seen["AnswerError"] > 20
    assert sum(seen.values()) == 61
