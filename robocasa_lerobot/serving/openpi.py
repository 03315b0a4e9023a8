"""openpi's protocol: metadata first, then an observation map for each map with actions, over a WebSocket.

A text frame is an error, after which the connection closes with code 1011. Beside openpi's own keys an observation may
hold `seed` (of the trial's noise), `number` (of the request in its trial, from 0) and `reset` (true: a new trial).
Source: openpi-client 0.1.2.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from typing import Any

from websockets.asyncio.server import ServerConnection

from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits
from robocasa_lerobot.serving.request import RequestError
from robocasa_lerobot.wire.codec import WireError, decode, encode

OPEN_PAGES = {"/healthz": "OK\n"}
_CLOSE_CODE = 1011
_log = logging.getLogger(__name__)


class OpenpiServer:
    """Answers one client's connection after the other's requests."""

    def __init__(self, host: Host, limits: Limits) -> None:
        self._host, self._limits = host, limits

    async def handle(self, connection: ServerConnection) -> None:
        """Serve a client until it leaves, or until its first mistake."""
        session = self._host.session()
        await connection.send(encode(self._host.served.metadata(), "openpi"))
        async for frame in connection:
            try:
                answer = await self._answer(session, frame)
            except Exception as error:
                text = describe(error)
                _log.warning("a client's request failed: %a", text, exc_info=not is_clients_mistake(error))
                await connection.send(text)
                await connection.close(_CLOSE_CODE, "the request failed; the text before this says why")
                return
            await connection.send(answer)

    async def _answer(self, session: Any, frame: str | bytes) -> bytes:
        if isinstance(frame, str):
            raise RequestError("found a text frame, expected a binary one with a map in msgpack.")
        message = await asyncio.to_thread(decode, frame, self._limits.message_bytes)
        if not isinstance(message, Mapping):
            raise RequestError(f"found a {type(message).__name__}, expected a map of the observation.")
        reply = await self._host.answer(session, message, message)
        milliseconds = reply.seconds * 1000
        return encode(
            {
                "actions": reply.flat(),
                "action_order": "stored" if reply.asked.stored_order else "hdf5",
                "number": reply.number,
                "policy_timing": {"infer_ms": milliseconds},
                "server_timing": {"infer_ms": milliseconds},
            },
            "openpi",
        )


def is_clients_mistake(error: Exception) -> bool:
    """Whether the request was at fault, and not the policy."""
    return isinstance(error, RequestError | WireError)


def describe(error: Exception) -> str:
    """An error as a client is told: its kind and text, without the places in our files."""
    return f"{type(error).__name__}: {error}"
