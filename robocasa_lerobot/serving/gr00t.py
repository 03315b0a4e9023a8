"""GR00T's inference service over ZeroMQ, in the shapes of N1.5 and of N1.6 and N1.7; a request tells which it is.

N1.5 sends an observation as `data` and gets a map of actions; N1.6 sends `data: {"observation", "options"}` and gets
the list of a map of actions and one of information. `seed`, `number` and `reset` stand in `options` or in the
observation's map, each a number, or a list with one for each row of a batch.
Source: Isaac-GR00T N1.5 (0a015f6), N1.6 (ade260e), and a public fork of N1.7.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.serving.access import Access
from robocasa_lerobot.serving.gr00t_messages import modality_config, rows_of, to_actions
from robocasa_lerobot.serving.host import Host, Reply
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.openpi import describe, is_clients_mistake
from robocasa_lerobot.serving.request import RequestError, Session, whole_number
from robocasa_lerobot.wire.codec import decode, encode

_log = logging.getLogger(__name__)
_OPTIONS = ("seed", "number", "reset")
_UNAUTHORIZED = "Unauthorized: Invalid API token"  # their words, which clients look for
# Clients leave without a word, and may simulate for minutes between two requests.
_SILENT_SECONDS = 3600.0
# Messages of a client that are read before their turn; all else waits in its own queue. Messages of ever so many parts
# count once, and ZeroMQ knows no limit of them.
_MOST_WAITING = 2
_KNOWN = 16  # times as many clients as are served at a time are known at most, however often they ask


@dataclass
class _Client:
    """Sessions, one for each row of its batches, and when it asked last, seconds of the monotonic clock."""

    sessions: list[Session] = field(default_factory=list)
    asked: float = 0.0


class GrootServer:
    """Answers the requests of all clients, each of them one at a time; beyond the limit requests wait for their turn.

    Args:
        host: the policy.
        access: where to listen, and the token.
        limits: of messages and clients.
        version: "1.5" or "1.6", of the modality config, which no request tells.
        allow_kill: clients may end the server.
    """

    def __init__(self, host: Host, access: Access, limits: Limits, version: str, allow_kill: bool) -> None:
        self._host, self._access, self._limits = host, access, limits
        self._version, self._allow_kill = version, allow_kill
        self._clients: OrderedDict[bytes, _Client] = OrderedDict()  # who asked last stands last
        self._busy: set[bytes] = set()
        self._stop = asyncio.Event()

    async def serve(self, stop: asyncio.Event, ready: Callable[[int], None]) -> None:
        """Answer until `stop` is set, or a client may and does end the server.

        Raises:
            UserError: pyzmq is missing, or the address cannot be listened on.
        """
        try:
            import zmq
            import zmq.asyncio
        except ImportError as error:
            raise UserError("--protocol=gr00t needs pyzmq: install robocasa_lerobot[gr00t].") from error
        self._stop = stop
        context = zmq.asyncio.Context()
        socket = context.socket(zmq.ROUTER)
        tasks: set[asyncio.Task[None]] = set()
        try:
            socket.setsockopt(zmq.MAXMSGSIZE, self._limits.message_bytes)
            socket.setsockopt(zmq.RCVHWM, _MOST_WAITING)
            socket.setsockopt(zmq.LINGER, 1000)
            socket.setsockopt(zmq.IPV6, int(":" in self._access.host))
            host = f"[{self._access.host}]" if ":" in self._access.host else self._access.host
            try:
                socket.bind(f"tcp://{'127.0.0.1' if host == 'localhost' else host}:{self._access.port or '*'}")
            except zmq.ZMQError as error:
                raise UserError(f"cannot listen on {self._access.host}:{self._access.port}: {error}") from error
            ready(int(socket.getsockopt_string(zmq.LAST_ENDPOINT).rpartition(":")[2]))
            ending = asyncio.ensure_future(stop.wait())
            while not stop.is_set():
                if len(tasks) >= self._limits.clients:  # the other requests wait in ZeroMQ's queues
                    await asyncio.wait({ending, *tasks}, return_when=asyncio.FIRST_COMPLETED)
                    continue
                arriving = asyncio.ensure_future(socket.recv_multipart())
                await asyncio.wait({arriving, ending}, return_when=asyncio.FIRST_COMPLETED)
                if not arriving.done():
                    arriving.cancel()
                    break
                task = asyncio.ensure_future(self._serve_one(socket, arriving.result()))
                tasks.add(task)
                task.add_done_callback(tasks.discard)
            if tasks:
                await asyncio.wait(tasks, timeout=10.0)
        finally:
            socket.close()
            context.term()

    async def _serve_one(self, socket: Any, parts: list[bytes]) -> None:
        client, envelope, body = parts[0], parts[:-1], parts[-1]
        if len(parts) > 3 or (len(parts) == 3 and parts[1]):
            await socket.send_multipart([*envelope[:2], _error("a request is one message part")])
            return
        if client in self._busy:
            await socket.send_multipart([*envelope, _error("busy: one request of a client at a time")])
            return
        self._busy.add(client)
        try:
            answer = await self._answer(client, body)
        except Exception as error:
            _log.warning("a client's request failed: %a", error, exc_info=not is_clients_mistake(error))
            answer = _error(describe(error))
        finally:
            self._busy.discard(client)
        await socket.send_multipart([*envelope, answer])

    async def _answer(self, client: bytes, body: bytes) -> bytes:
        message = await asyncio.to_thread(decode, body, self._limits.message_bytes)
        if not isinstance(message, Mapping):
            raise RequestError(f"found a {type(message).__name__}, expected a map with `endpoint` and `data`.")
        if not self._access.allows(message.get("api_token")):
            return _error(_UNAUTHORIZED)
        endpoint, data = message.get("endpoint", "get_action"), message.get("data")
        match endpoint:
            case "ping":
                running = {"status": "ok", "message": "Server is running", "metadata": self._host.served.metadata()}
                return encode(running, "gr00t")  # the metadata is for our own clients
            case "kill":
                if not self._allow_kill:
                    raise RequestError("kill is refused: the server was not started with --allow-kill.")
                self._stop.set()
                return encode({"status": "ok", "message": "Server is ending"}, "gr00t")
            case "get_modality_config":
                return encode(modality_config(self._host.served, self._version), "gr00t")
            case "reset":
                self._reset(client, (data.get("options") if isinstance(data, Mapping) else None) or {})
                return encode({}, "gr00t")
            case "get_action":
                return encode(await self._get_action(client, data), "gr00t")
        raise RequestError(f"Unknown endpoint: {endpoint!r:.60}")

    async def _get_action(self, client: bytes, data: Any) -> Any:
        if not isinstance(data, Mapping):
            raise RequestError(f"data: found a {type(data).__name__}, expected a map.")
        wrapped = "observation" in data  # N1.6 and later: the arguments of a function
        observation = data["observation"] if wrapped else data
        options = data.get("options") or {}
        if isinstance(observation, Mapping) and isinstance(options, Mapping):
            options = {**{key: observation.get(key) for key in _OPTIONS}, **options}
        rows = rows_of(observation, self._limits.clients)
        each = [_row_options(options, row) for row in range(len(rows.maps))]
        sessions = self._sessions(client, len(rows.maps))
        asked = zip(sessions, rows.maps, each, strict=False)  # an earlier batch may have had more rows
        replies: list[Reply] = []
        for reply in await asyncio.gather(*(self._host.answer(*one) for one in asked), return_exceptions=True):
            if isinstance(reply, BaseException):
                raise reply
            replies.append(reply)
        actions = to_actions([reply.actions for reply in replies], rows)
        if not wrapped:
            return actions
        return [actions, {"number": [reply.number for reply in replies]}]

    def _reset(self, client: bytes, options: Any) -> None:
        """Begin a client's trials; a list of seeds says how many rows its batches have from now on."""
        count = _listed(options, self._limits.clients)
        sessions = self._sessions(client, count or 1)
        rows = range(count or len(sessions))
        seeds = [whole_number(_row_options(options, row), "seed") for row in rows]
        del sessions[len(rows) :]
        for session, seed in zip(sessions, seeds, strict=True):
            session.begin(seed)

    def _sessions(self, client: bytes, count: int) -> list[Session]:
        """A client's sessions, one for each row of its batches."""
        own = self._clients.setdefault(client, _Client())
        own.asked = time.monotonic()
        self._clients.move_to_end(client)
        while len(own.sessions) < count:
            own.sessions.append(self._host.session())
        self._forget(own.asked)
        return own.sessions

    def _forget(self, now: float) -> None:
        """Forget clients that are more than the limit and have probably left."""
        most = self._limits.clients
        for client, known in list(self._clients.items())[:-most]:
            if now - known.asked < _SILENT_SECONDS and len(self._clients) <= _KNOWN * most:
                return
            if client not in self._busy:
                del self._clients[client]


def _listed(options: Any, most: int) -> int:
    """How many rows the options are listed for; 0 where none is a list."""
    values = [_plain(options.get(key)) for key in _OPTIONS] if isinstance(options, Mapping) else []
    count = max((len(value) for value in values if _is_listed(value)), default=0)
    if count > most:
        raise RequestError(f"options: found {count} rows, expected at most {most}.")
    return count


def _row_options(options: Mapping[Any, Any], row: int) -> dict[str, Any]:
    if not isinstance(options, Mapping):
        raise RequestError(f"options: found a {type(options).__name__}, expected a map or nothing.")
    return {key: _option(options, key, row) for key in _OPTIONS}


def _option(options: Mapping[Any, Any], key: str, row: int) -> Any:
    value = _plain(options.get(key))
    if not _is_listed(value):
        return value
    if row >= len(value):
        raise RequestError(f"options.{key}: found {len(value)} of them, expected one for each row of the batch.")
    return value[row]


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _is_listed(value: Any) -> bool:
    """Whether an option has a value for each row."""
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _error(text: str) -> bytes:
    return encode({"error": text}, "gr00t")
