"""The way to one client: messages in their order, of pictures only the newest, never more than it acknowledges."""

from __future__ import annotations

import asyncio
import collections
import json
import time
from collections.abc import Callable
from typing import Any

from aiohttp import WSCloseCode, web

MOST_UNACKNOWLEDGED = 2  # pictures
_MOST_WAITING = 500  # messages, of a client that takes none
_LONGEST_REASON = 120  # bytes that a closing frame has room for


class ClientLine:
    """What waits for a client. Only the event loop's thread uses it.

    Args:
        socket: of the client, open.
        sent: called when a picture has left, so that there may be room for the next.
    """

    def __init__(self, socket: web.WebSocketResponse, sent: Callable[[], None]) -> None:
        self._socket, self._left = socket, sent
        self._texts: collections.deque[str] = collections.deque()
        self._picture: tuple[int, bytes] | None = None
        self._sent: collections.OrderedDict[int, float] = collections.OrderedDict()
        self._answered_in = 0.0
        self._wake = asyncio.Event()

    @property
    def hungry(self) -> bool:
        """Whether a picture would be sent at once."""
        return self._picture is None and len(self._sent) < MOST_UNACKNOWLEDGED

    def say(self, message: dict[str, Any]) -> None:
        """Send a message after those before it."""
        self._texts.append(json.dumps(message))
        self._wake.set()

    def show(self, number: int, message: bytes) -> None:
        """Send a picture as soon as the client has room for it; a newer one takes its place until then."""
        self._picture = number, message
        self._wake.set()

    def acknowledge(self, number: int) -> None:
        """The client has drawn a picture, and needs none before it any more."""
        for sent in [sent for sent in self._sent if sent <= number]:
            self._answered_in = time.monotonic() - self._sent.pop(sent)
        self._wake.set()

    def overdue(self, seconds: float) -> bool:
        """Whether a picture has waited for its acknowledgement for so long."""
        return bool(self._sent) and time.monotonic() - next(iter(self._sent.values())) > seconds

    def late(self, seconds: float) -> bool:
        """Whether a picture waits, or the last one that was acknowledged has waited, for so long."""
        return self._answered_in > seconds or self.overdue(seconds)

    async def send(self) -> None:
        """Send for as long as the client is there."""
        try:
            while not self._socket.closed:
                await self._wake.wait()
                self._wake.clear()
                if len(self._texts) > _MOST_WAITING:
                    await self.close(WSCloseCode.TRY_AGAIN_LATER, "too slow")
                    return
                while self._texts:
                    await self._socket.send_str(self._texts.popleft())
                if self._picture is not None and len(self._sent) < MOST_UNACKNOWLEDGED:
                    (number, message), self._picture = self._picture, None
                    self._sent[number] = time.monotonic()
                    self._left()
                    await self._socket.send_bytes(message)
        except ConnectionError:
            return

    async def flush(self, seconds: float) -> None:
        """Wait until all messages are sent, but not for ever."""
        until = time.monotonic() + seconds
        while self._texts and not self._socket.closed and time.monotonic() < until:
            self._wake.set()
            await asyncio.sleep(0.01)

    async def close(self, code: WSCloseCode, reason: str) -> None:
        """End the connection with a reason in words."""
        await self._socket.close(code=code, message=_closing(reason))


def _closing(reason: str) -> bytes:
    # A client's own words may be in it: halves of a pair, which UTF-8 has not, and characters that the end would cut.
    return reason.encode(errors="replace")[:_LONGEST_REASON].decode(errors="ignore").encode()
