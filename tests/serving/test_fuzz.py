"""Whatever clients send, servers answer it or close, execute nothing, and go on answering others."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from frame_fuzz import damaged
from gr00t_client import GrootClient
from serving_support import BlockedActor, observation, own_names, panda_omron_names, serving
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.policy import Served, ServedPolicy
from robocasa_lerobot.wire.codec import Dialect, decode, encode
from robocasa_lerobot.wire.images import encode_png

SIZE = 16
STEPS = [observation(0, SIZE), observation(1, SIZE)]
MESSAGE_BYTES = 2**20
TOGETHER = 10  # damaged messages between two good ones


@contextmanager
def server(protocol: str) -> Iterator[int]:
    """A server of zeros that reads pictures and a history."""
    go = threading.Event()
    go.set()
    source = PolicySource("zeros", "zeros", "zeros", "none", image_size=(SIZE, SIZE))
    served = Served(source, contract.CAMERAS, 1, (-1, 0), 1)
    host = Host(ServedPolicy(served, None, lambda: BlockedActor(threading.Event(), go)))
    with serving(host, protocol, limits=Limits(MESSAGE_BYTES, 8)) as port:
        yield port


class Openpi:
    """A connection for each message that is not answered."""

    dialect: Dialect = "openpi"
    good: dict[str, Any] = {**own_names(STEPS, "x"), "seed": 1, "number": 0}  # noqa: RUF012

    def __init__(self, port: int) -> None:
        self._port = port
        self._socket: ClientConnection | None = None

    def send(self, frame: bytes | str) -> Any:
        """The answer; an error is a text, an end None."""
        if self._socket is None:
            self._socket = connect(f"ws://127.0.0.1:{self._port}", compression=None, max_size=None)
            self.greet()
        try:
            self._socket.send(frame)
            answer = self.receive()
        except ConnectionClosed:
            answer = None
        if not isinstance(answer, dict):
            self.close()
        return answer

    def greet(self) -> None:
        self.receive()

    def receive(self) -> Any:
        assert self._socket is not None
        answer = self._socket.recv(timeout=30)  # a hang is a TimeoutError
        return decode(answer) if isinstance(answer, bytes) else answer

    def is_answered(self) -> bool:
        answer = self.send(encode(self.good, self.dialect))
        return isinstance(answer, dict) and answer["actions"].shape == (1, 12)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class VlaEval(Openpi):
    """Errors leave the connection open; an observation follows each message, since not all are answered."""

    dialect: Dialect = "vla_eval"
    good: dict[str, Any] = {  # noqa: RUF012
        "type": "observation",
        "payload": {
            "images": {f"video.{name}": encode_png(one) for name, one in STEPS[0]["pixels"].items()},
            "state": {f"state.{k}": v for k, v in contract.split_state(STEPS[0]["agent_pos"]).items()},
            "task_description": "x",
        },
        "seq": 2**40,
        "timestamp": 0.5,
    }

    def greet(self) -> None:
        pass

    def send(self, frame: bytes | str) -> Any:
        if self._socket is None:
            self._socket = connect(f"ws://127.0.0.1:{self._port}", compression=None, max_size=None)
        try:
            self._socket.send(frame)
            self._socket.send(encode({"type": "hello", "payload": {}, "seq": 77, "timestamp": 0}, self.dialect))
            answer = None
            while not (isinstance(answer, dict) and answer.get("type") == "hello" and answer["seq"] == 77):
                answer = self.receive()
        except ConnectionClosed:
            self.close()
            return None
        return answer

    def is_answered(self) -> bool:
        self.send(encode({"type": "episode_start", "payload": {"seed": 1}, "seq": 1, "timestamp": 0}, self.dialect))
        assert self._socket is not None
        self._socket.send(encode(self.good, self.dialect))
        answer = self.receive()
        return bool(answer["type"] == "action" and answer["payload"]["actions"].shape == (12,))


class Groot:
    """Every message is answered, on the same socket, but too large ones."""

    dialect: Dialect = "gr00t"
    good: dict[str, Any] = {  # noqa: RUF012
        "endpoint": "get_action",
        "data": {
            "observation": {
                "video": {name: np.stack([one["pixels"][name] for one in STEPS])[None] for name in contract.CAMERAS},
                "state": {
                    key.removeprefix("state."): value[None].astype(np.float32)
                    for key, value in panda_omron_names(STEPS, "x").items()
                    if key.startswith("state.")
                },
                "language": {"annotation.human.task_description": [["x"]]},
            },
            "options": {"seed": [1], "number": [0]},
        },
    }

    def __init__(self, port: int) -> None:
        self._client = GrootClient(port)
        self._port = port

    def send(self, frame: bytes | str) -> Any:
        return self._client.send(frame if isinstance(frame, bytes) else frame.encode())

    def is_answered(self) -> bool:
        answer = self.send(encode(self.good, self.dialect))
        return isinstance(answer, list) and answer[0]["gripper_close"].shape == (1, 1, 1)

    def close(self) -> None:
        self._client.close()


CLIENTS: dict[str, type[Openpi | Groot]] = {"openpi": Openpi, "vla_eval": VlaEval, "gr00t": Groot}


@pytest.mark.parametrize("protocol", CLIENTS)
@pytest.mark.parametrize("count", [100, pytest.param(500, marks=pytest.mark.slow)])
def test_damaged_messages_are_answered_or_refused(protocol: str, count: int, tmp_path: Path) -> None:
    rng = np.random.default_rng([count, *protocol.encode()])
    bomb = tmp_path / "executed"
    with server(protocol) as port:
        client = CLIENTS[protocol](port)
        assert client.is_answered()
        for index in range(count):
            client.send(damaged(client.good, client.dialect, rng, bomb))
            assert not bomb.exists()
            if index % TOGETHER == TOGETHER - 1:
                assert client.is_answered(), index
        assert client.is_answered()
        client.close()


@pytest.mark.parametrize("protocol", CLIENTS)
def test_what_is_no_message_of_the_protocol_at_all_disturbs_nobody(protocol: str) -> None:
    rng = np.random.default_rng(0)
    frame = bytes([0x82, 0xFE, 0xFF, 0xFF, 1, 2, 3, 4])  # of a WebSocket; it ends too early
    upgrade = b"GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    upgrade += b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    bytes_of = [b"", b"\0" * 100, b"GET / HTTP/1.1\r\n\r\n", b"GET /" + b"a" * 100_000, b"POST / HTTP/9.9\r\n\r\n"]
    bytes_of += [
        upgrade + frame,
        upgrade + rng.bytes(500),
        upgrade + b"\x82\xff" + b"\xff" * 8,
        upgrade + b"\x01\0\x01\0",
    ]
    bytes_of += [b"\xff\0\0\0\0\0\0\0\x01\x7f\x03\0NULL" + b"\0" * 48 + rng.bytes(200)]  # ZeroMQ's greeting, then noise
    bytes_of += [rng.bytes(int(rng.integers(1, 2000))) for _ in range(20)]
    with server(protocol) as port:
        for content in bytes_of:
            with socket.create_connection(("127.0.0.1", port), timeout=30) as raw, suppress(OSError):
                raw.sendall(content)
        client = CLIENTS[protocol](port)
        assert client.is_answered()
        client.close()


@pytest.mark.parametrize("protocol", ["openpi", "vla_eval"])
def test_a_message_that_is_too_large_closes_its_connection_alone(protocol: str) -> None:
    with server(protocol) as port:
        client = CLIENTS[protocol](port)
        told = client.send(msgpack.packb(b"\0" * (MESSAGE_BYTES - 100)))  # just small enough to be read
        assert told is not None
        large = CLIENTS[protocol](port)
        assert isinstance(large, Openpi)
        assert large.send(b"\0" * (MESSAGE_BYTES + 1)) is None
        assert client.is_answered()
        client.close()


def test_a_gr00t_message_that_is_too_large_is_never_answered() -> None:
    import zmq

    with server("gr00t") as port:
        large = GrootClient(port)
        large.socket.setsockopt(zmq.RCVTIMEO, 500)
        with pytest.raises(zmq.Again):
            large.send(b"\0" * (MESSAGE_BYTES + 1))
        large.close()
        client = Groot(port)
        assert client.is_answered()
        client.close()


def test_parts_and_floods_of_a_dealer_are_refused() -> None:
    import zmq

    with server("gr00t") as port:
        dealer = zmq.Context.instance().socket(zmq.DEALER)
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.setsockopt(zmq.RCVTIMEO, 30_000)
        dealer.connect(f"tcp://127.0.0.1:{port}")
        ping = msgpack.packb({"endpoint": "ping"})
        dealer.send_multipart([b"", ping, ping])
        assert "one message part" in decode(dealer.recv_multipart()[-1])["error"]
        for _ in range(50):
            dealer.send_multipart([b"", ping])
        answers = [decode(dealer.recv_multipart()[-1]) for _ in range(50)]
        assert any(answer.get("status") == "ok" for answer in answers)
        assert all(answer.get("status") == "ok" or "busy" in answer["error"] for answer in answers)
        dealer.close()
        client = Groot(port)
        assert client.is_answered()
        client.close()
