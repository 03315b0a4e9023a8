"""A process that holds the policy for one device and answers whatever observations are waiting, in batches."""

from __future__ import annotations

import os
import signal
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Client, Connection, Listener, wait
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.actor import ChunkActor, ChunkReply, ChunkRequest, ChunkShape
from robocasa_lerobot.evaluation.actors.chunk_policy import BatchingError, ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.run.messages import Alive, Describe, Failed, Loading, Ready, Refused, ServerSettings
from robocasa_lerobot.evaluation.run.processes import take_over
from robocasa_lerobot.evaluation.run.rollout import RolloutError

_POLL_SECONDS = 0.5
_CONNECT_SECONDS = 0.1
_LOST = (EOFError, ConnectionError, BrokenPipeError)


class PolicyServerError(RolloutError):
    """The policy's process failed or ended while a trial waited for it."""


def server_main(parent: Connection, settings: ServerSettings, environment: dict[str, str]) -> None:
    """Answer requests until the parent's pipe closes."""
    take_over(environment)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its processes
    import torch

    torch.set_num_threads(settings.threads)
    Path(settings.address).unlink(missing_ok=True)  # of one that was killed
    server = _Server(settings, parent)
    with Listener(settings.address, "AF_UNIX") as listener, suppress(*_LOST):
        threading.Thread(target=server.accept, args=(listener,), daemon=True).start()
        parent.send(Ready())
        server.serve()
    os._exit(0)  # the accepting thread still waits


class _Server:
    def __init__(self, settings: ServerSettings, parent: Connection) -> None:
        self._settings, self._parent = settings, parent
        self._clients: list[Connection] = []
        self._policy: tuple[str, ChunkPolicy] | None = None
        self._last_sign = 0.0

    def accept(self, listener: Listener) -> None:
        while True:
            with suppress(OSError, EOFError):  # a worker that died while it connected
                self._clients.append(listener.accept())

    def serve(self) -> None:
        while True:
            clients = list(self._clients)
            ready = wait([self._parent, *clients], _POLL_SECONDS / 10 if not clients else _POLL_SECONDS)
            if self._parent in ready:
                self._parent.recv()  # nothing is ever sent: the pipe has closed
            self._sign()
            self._answer([client for client in clients if client in ready])

    def _answer(self, ready: list[Connection]) -> None:
        waiting: list[tuple[Connection, ChunkRequest]] = []
        for client in ready:
            try:
                message = client.recv()
            except (*_LOST, OSError):
                self._drop(client)
                continue
            if isinstance(message, Describe):
                self._send(client, self._policy_of(message.label).shape)
            else:
                waiting.append((client, message))
        for label in dict.fromkeys(request.label for _, request in waiting):
            own = [(client, request) for client, request in waiting if request.label == label]
            replies = self._predict(label, [request for _, request in own])
            for (client, _), reply in zip(own, replies, strict=True):
                self._send(client, reply)

    def _predict(self, label: str, requests: list[ChunkRequest]) -> list[ChunkReply | Failed]:
        policy = self._policy_of(label)
        try:
            return list(policy.predict(requests))
        except BatchingError as error:
            self._parent.send(Refused(str(error)))
            raise EOFError from error
        except Exception:
            if len(requests) > 1:  # only the one that is at fault is to fail
                return [self._predict(label, [request])[0] for request in requests]
            if _is_broken(self._settings.device):
                traceback.print_exc()
                os._exit(1)  # no later request would fare better; the engine starts another process
            return [Failed(traceback.format_exc())]

    def _policy_of(self, label: str) -> ChunkPolicy:
        if self._policy is None or self._policy[0] != label:
            self._policy = None  # Free the last one first: two large policies may not fit.
            settings = self._settings
            self._parent.send(Loading())
            try:
                loaded = LoadedCheckpoint(
                    settings.sources[label], settings.device, settings.executed_steps, settings.runtime
                )
                self._policy = (label, ChunkPolicy(loaded, settings.width))
            except Exception as error:
                detail = "" if isinstance(error, UserError) else "\n" + traceback.format_exc()
                self._parent.send(Refused(f"policy {label!r} cannot be loaded: {error}{detail}"))
                raise EOFError from error
            self._parent.send(Alive())
        return self._policy[1]

    def _send(self, client: Connection, message: Any) -> None:
        try:
            client.send(message)
        except (*_LOST, OSError):
            self._drop(client)

    def _drop(self, client: Connection) -> None:
        client.close()
        self._clients.remove(client)

    def _sign(self) -> None:
        if time.monotonic() - self._last_sign > _POLL_SECONDS:
            self._last_sign = time.monotonic()
            self._parent.send(Alive())


def _is_broken(device: str) -> bool:
    """Whether a GPU has failed in a way that this process keeps, as after an illegal memory access."""
    if not device.startswith("cuda"):
        return False
    import torch

    try:
        torch.cuda.synchronize(device)
    except RuntimeError:
        return True
    return False


class PolicyConnection:
    """A worker's side: connects when it is needed, and again after the server was replaced.

    Args:
        address: path of the server's socket.
        alive: called every now and then while waiting.
    """

    def __init__(self, address: str, alive: Callable[[int], None]) -> None:
        self._address, self._alive = address, alive
        self._connection: Connection | None = None

    def actor(self, label: str) -> ChunkActor:
        """The actor whose chunks the server computes."""
        shape = self._ask(Describe(label))
        assert isinstance(shape, ChunkShape), shape
        return ChunkActor(label, shape, self._predict)

    def _predict(self, request: ChunkRequest) -> ChunkReply:
        reply = self._ask(request)
        if isinstance(reply, Failed):
            raise PolicyServerError(f"the policy raised:\n{reply.traceback}")
        assert isinstance(reply, ChunkReply), reply
        return reply

    def _ask(self, message: Any) -> Any:
        connection = self._connection = self._connection or self._connect()
        try:
            connection.send(message)
            while not connection.poll(_POLL_SECONDS):
                self._alive(-1)
            return connection.recv()
        except (*_LOST, OSError) as error:
            self._connection = None
            if not isinstance(error, BrokenPipeError) and not connection.closed:
                connection.close()
            raise PolicyServerError("the policy's process ended while this trial waited for it") from error

    def _connect(self) -> Connection:
        while True:
            try:
                return Client(self._address, "AF_UNIX")
            except OSError:  # it is still starting
                self._alive(-1)
                time.sleep(_CONNECT_SECONDS)
