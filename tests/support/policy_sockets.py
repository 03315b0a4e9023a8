"""Small policy servers for tests, written with websockets and pyzmq alone: nothing of ours packs or reads their bytes.

Each runs in a thread of the test and answers with a function from the decoded request to actions. Arrays are packed as
the projects do: see the functions at the end.
"""

from __future__ import annotations

import contextlib
import io
import json
import threading
import time
from collections.abc import Callable
from typing import Any

import msgpack
import numpy as np
import zmq
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

Answer = Callable[[dict[str, Any]], Any]


class _WebsocketServer:
    """Serves `_handle` on a free (or the given) port of the loopback until it is stopped."""

    def __init__(self, port: int = 0) -> None:
        self.requests: list[Any] = []
        self.connections: list[ServerConnection] = []
        self._server = serve(self._serve, "127.0.0.1", port, compression=None, max_size=None, ping_interval=None)
        self.port = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    def stop(self) -> None:
        """Drop all connections without a word, as a killed process does."""
        self._server.shutdown()
        for connection in self.connections:
            with contextlib.suppress(OSError):
                connection.socket.shutdown(2)
        self._thread.join(timeout=10)

    def _serve(self, connection: ServerConnection) -> None:
        self.connections.append(connection)
        with contextlib.suppress(ConnectionClosed):
            self._handle(connection)

    def _handle(self, connection: ServerConnection) -> None:
        raise NotImplementedError


class OpenpiServer(_WebsocketServer):
    """openpi's server: metadata first, then an answer for each request; an exception is a text frame and the end."""

    def __init__(self, answer: Answer, metadata: dict[str, Any] | None = None, port: int = 0) -> None:
        self._answer, self._metadata = answer, metadata or {}
        super().__init__(port)

    @property
    def url(self) -> str:
        return f"openpi://127.0.0.1:{self.port}"

    def _handle(self, connection: ServerConnection) -> None:
        connection.send(msgpack.packb(self._metadata))
        for frame in connection:
            request = msgpack.unpackb(frame, object_hook=openpi_array)
            self.requests.append(request)
            try:
                answer = self._answer(request)
            except Exception as error:
                connection.send(f"Traceback (most recent call last):\n{type(error).__name__}: {error}")
                connection.close(1011, "Internal server error. Traceback included in previous frame.")
                return
            connection.send(answer if isinstance(answer, bytes) else msgpack.packb(answer, default=openpi_map))


class VlaEvalServer(_WebsocketServer):
    """vla-eval's server: hello for hello, actions of the observation's number, errors without an end."""

    def __init__(self, answer: Answer, port: int = 0) -> None:
        self._answer = answer
        super().__init__(port)

    @property
    def url(self) -> str:
        return f"vla_eval://127.0.0.1:{self.port}"

    def _handle(self, connection: ServerConnection) -> None:
        for frame in connection:
            message = msgpack.unpackb(frame, object_hook=vla_eval_array)
            self.requests.append(message)
            kind, payload = message["type"], message["payload"]
            if kind == "hello":
                reply = ("hello", {"harness_version": "0", "protocol_version": 1, "model_server": "Fake"})
            elif kind == "observation":
                try:
                    reply = ("action", self._answer(payload))
                except Exception as error:
                    reply = ("error", {"error": f"observation_failed: {type(error).__name__}: {error}"})
            else:
                continue
            said = {"type": reply[0], "payload": reply[1], "seq": message["seq"], "timestamp": time.time()}
            connection.send(msgpack.packb(said, default=vla_eval_map))


class Gr00tServer:
    """GR00T's service of a version: "N1.5", "N1.6" or "N1.7"; exceptions are answers with `error`.

    `config` is the modality configuration as plain maps; `token` is wanted in every request where it is given.
    """

    def __init__(
        self, answer: Answer, version: str, config: dict[str, Any], port: int = 0, token: str | None = None
    ) -> None:
        self._answer, self._version, self._config, self._token = answer, version, config, token
        self.requests: list[Any] = []
        self._context = zmq.Context()
        socket = self._context.socket(zmq.REP)
        socket.setsockopt(zmq.LINGER, 0)
        self.port = port or socket.bind_to_random_port("tcp://127.0.0.1")
        if port:
            socket.bind(f"tcp://127.0.0.1:{port}")
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(socket,), daemon=True)
        self._thread.start()

    def __enter__(self) -> Gr00tServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def url(self) -> str:
        return f"gr00t://127.0.0.1:{self.port}"

    def stop(self) -> None:
        self._ended.set()
        self._thread.join(timeout=10)
        self._context.term()

    def _serve(self, socket: Any) -> None:
        while not self._ended.is_set():
            if not socket.poll(50):
                continue
            request = msgpack.unpackb(socket.recv(), object_hook=gr00t_array)
            self.requests.append(request)
            try:
                answer = self._reply(request)
            except Exception as error:
                answer = {"error": str(error)}
            socket.send(msgpack.packb(answer, default=msgpack_numpy_map if self._version == "N1.7" else gr00t_map))
        socket.close()

    def _reply(self, request: dict[str, Any]) -> Any:
        if self._token is not None and request.get("api_token") != self._token:
            return {"error": "Unauthorized: Invalid API token"}
        endpoint, data = request.get("endpoint", "get_action"), request.get("data", {})
        if endpoint == "ping":
            return {"status": "ok", "message": "Server is running"}
        if endpoint == "get_modality_config":
            return {name: self._entry(entry) for name, entry in self._config.items()}
        if self._version == "N1.5":
            if endpoint != "get_action":
                raise ValueError(f"Unknown endpoint: {endpoint}")
            return self._answer(data)
        return getattr(self, f"_{endpoint}")(**data)

    def _get_action(self, observation: dict[str, Any], options: Any = None) -> Any:
        return [self._answer(observation), {}]

    def _reset(self, options: Any = None) -> dict[str, Any]:
        return {}

    def _entry(self, entry: dict[str, Any]) -> dict[str, Any]:
        if self._version == "N1.5":
            return {"__ModalityConfig_class__": True, "as_json": json.dumps(entry)}
        marker = "__ModalityConfig__" if self._version == "N1.7" else "__ModalityConfig_class__"
        return {marker: True, "as_json": entry}


def openpi_map(value: Any) -> Any:
    assert isinstance(value, np.ndarray), value
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


def openpi_array(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        return np.ndarray(buffer=value[b"data"], dtype=np.dtype(value[b"dtype"]), shape=value[b"shape"])
    return value


def vla_eval_map(value: Any) -> Any:
    assert isinstance(value, np.ndarray), value
    return {"__ndarray__": True, "data": value.tobytes(), "dtype": value.dtype.str, "shape": list(value.shape)}


def vla_eval_array(value: dict[Any, Any]) -> Any:
    if "__ndarray__" in value:
        return np.frombuffer(value["data"], dtype=np.dtype(value["dtype"])).reshape(value["shape"])
    return value


def gr00t_map(value: Any) -> Any:
    assert isinstance(value, np.ndarray), value
    output = io.BytesIO()
    np.save(output, value, allow_pickle=False)
    return {"__ndarray_class__": True, "as_npy": output.getvalue()}


def gr00t_array(value: dict[Any, Any]) -> Any:
    if "__ndarray_class__" in value:
        return np.load(io.BytesIO(value["as_npy"]), allow_pickle=False)
    return value


def msgpack_numpy_map(value: Any) -> Any:
    assert isinstance(value, np.ndarray), value
    shape, data = value.shape, value.tobytes()
    return {b"nd": True, b"type": value.dtype.str, b"kind": b"", b"shape": shape, b"data": data}


class ScriptedWebsocket(_WebsocketServer):
    """Frames as bytes: those of `greeting` first, then for each frame the next entry of `replies`, or nothing."""

    def __init__(self, greeting: list[bytes], replies: list[bytes | str | None]) -> None:
        self._greeting, self._replies = greeting, replies
        super().__init__()

    def _handle(self, connection: ServerConnection) -> None:
        replies = iter(self._replies)
        for frame in self._greeting:
            connection.send(frame)
        for frame in connection:
            self.requests.append(frame)
            reply = next(replies, None)
            if reply is not None:
                connection.send(reply)
