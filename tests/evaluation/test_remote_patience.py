"""How long a client waits for a server that is there, and does not read or answer."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import re
import socket
import threading
import time

import numpy as np
import pytest

from robocasa_lerobot.evaluation.remote.client import Timeouts
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.failures import LostError

METADATA = b"\x80"  # an empty map of msgpack


@pytest.mark.parametrize("protocol", ["openpi", "vla_eval", "gr00t"])
@pytest.mark.parametrize(("introduction", "waited"), [(0.0, 0.5), (1.2, 1.2)])
def test_a_server_that_is_busy_is_waited_for_where_others_ask_it_too(
    protocol: str, introduction: float, waited: float
) -> None:
    """It takes connections, and answers no handshake and no ping, as one that compiles in its event loop."""
    signs: list[float] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        began, url = time.monotonic(), f"{protocol}://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(LostError, match=r"timed out|without a word"):
            connect(url, Timeouts(connect=0.5, introduction=introduction), lambda: signs.append(time.monotonic()))
        assert waited <= time.monotonic() - began
    assert signs


def test_a_request_that_is_not_taken_ends() -> None:
    """A server that does not read, and a request larger than the system's buffers."""
    signs: list[int] = []
    with socket.create_server(("127.0.0.1", 0)) as server, contextlib.ExitStack() as stack:

        def greet() -> None:
            taken = stack.enter_context(server.accept()[0])
            key = re.search(rb"Sec-WebSocket-Key: (\S+)", taken.recv(4096))
            assert key is not None
            accept = base64.b64encode(hashlib.sha1(key[1] + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
            taken.sendall(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n")
            taken.sendall(b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n\x82" + bytes([len(METADATA)]))
            taken.sendall(METADATA)

        threading.Thread(target=greet, daemon=True).start()
        url = f"openpi://127.0.0.1:{server.getsockname()[1]}"
        client = connect(url, Timeouts(10.0, 1.0, 1.0), lambda: signs.append(0))
        with pytest.raises(LostError, match="a request was not taken within 1 s"):
            client.infer({"picture": np.zeros(64_000_000, np.uint8)})
    assert signs
