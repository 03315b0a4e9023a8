"""A policy server that computes as long as it is told, by the projects' own means: websockets or ZeroMQ, msgpack.

Like openpi's and vla-eval's servers it computes inside its event loop, one request at a time. It imports nothing of
ours. Commands on standard input: see `sim_loop.answer_commands`.
"""

from __future__ import annotations

import asyncio
import io
import threading
import time
from typing import Any

import msgpack
import numpy as np
from sim_loop import answer_commands
from websockets.asyncio.server import ServerConnection, serve

CHUNK = np.zeros((50, 12), np.float32)


class Server:
    """The one server of this process."""

    def __init__(self) -> None:
        self._seconds = 0.0

    def hello(self) -> dict[str, Any]:
        """Ready."""
        return {}

    def open(self, protocol: str) -> dict[str, Any]:
        """Start to serve; its port."""
        ports: list[int] = []
        opened = threading.Event()
        target = {"openpi": self._openpi, "vla_eval": self._vla_eval}.get(protocol)
        run = (lambda: self._gr00t(ports, opened)) if target is None else lambda: self._loop(target, ports, opened)
        threading.Thread(target=run, daemon=True).start()
        opened.wait(30)
        return {"port": ports[0]}

    def compute(self, milliseconds: float) -> dict[str, Any]:
        """How long each request computes from now on."""
        self._seconds = milliseconds / 1000
        return {}

    def own(self, requests: int) -> dict[str, Any]:
        """Requests per second of the computation alone, without any socket."""
        started = time.perf_counter()
        for _ in range(requests):
            self._compute()
        return {"per_second": requests / (time.perf_counter() - started)}

    def _compute(self) -> np.ndarray:
        if self._seconds:
            time.sleep(self._seconds)  # as for a GPU's answer; the event loop stands still meanwhile
        return CHUNK

    def _loop(self, handle: Any, ports: list[int], opened: threading.Event) -> None:
        async def run() -> None:
            async with serve(handle, "127.0.0.1", 0, compression=None, max_size=None, ping_interval=None) as server:
                ports.append(next(iter(server.sockets)).getsockname()[1])
                opened.set()
                await server.serve_forever()

        asyncio.run(run())

    async def _openpi(self, connection: ServerConnection) -> None:
        await connection.send(msgpack.packb({}))
        async for frame in connection:
            msgpack.unpackb(frame, object_hook=_openpi_array)
            answer = {"actions": self._compute()}
            await connection.send(msgpack.packb(answer, default=_openpi_map))

    async def _vla_eval(self, connection: ServerConnection) -> None:
        async for frame in connection:
            message = msgpack.unpackb(frame, object_hook=_vla_eval_array)
            kind = {"hello": "hello", "observation": "action"}.get(message["type"])
            if kind is not None:
                payload = {"actions": self._compute()} if kind == "action" else {"protocol_version": 1}
                reply = {"type": kind, "payload": payload, "seq": message["seq"], "timestamp": time.time()}
                await connection.send(msgpack.packb(reply, default=_vla_eval_map))

    def _gr00t(self, ports: list[int], opened: threading.Event) -> None:
        import zmq

        socket = zmq.Context().socket(zmq.REP)
        ports.append(socket.bind_to_random_port("tcp://127.0.0.1"))
        opened.set()
        while True:
            request = msgpack.unpackb(socket.recv(), object_hook=_gr00t_array)
            wanted = request["endpoint"] == "get_action"
            answer = {"actions": self._compute()} if wanted else {}
            socket.send(msgpack.packb(answer, default=_gr00t_map))


def _openpi_map(value: np.ndarray) -> dict[Any, Any]:
    return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}


def _openpi_array(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        return np.ndarray(buffer=value[b"data"], dtype=np.dtype(value[b"dtype"]), shape=value[b"shape"])
    return value


def _vla_eval_map(value: np.ndarray) -> dict[str, Any]:
    return {"__ndarray__": True, "data": value.tobytes(), "dtype": value.dtype.str, "shape": list(value.shape)}


def _vla_eval_array(value: dict[Any, Any]) -> Any:
    if "__ndarray__" in value:
        return np.frombuffer(value["data"], dtype=np.dtype(value["dtype"])).reshape(value["shape"]).copy()
    return value


def _gr00t_map(value: np.ndarray) -> dict[str, Any]:
    output = io.BytesIO()
    np.save(output, value, allow_pickle=False)
    return {"__ndarray_class__": True, "as_npy": output.getvalue()}


def _gr00t_array(value: dict[Any, Any]) -> Any:
    if "__ndarray_class__" in value:
        return np.load(io.BytesIO(value["as_npy"]), allow_pickle=False)
    return value


if __name__ == "__main__":
    server = Server()
    answer_commands(server.hello, server.open, server.compute, server.own)
