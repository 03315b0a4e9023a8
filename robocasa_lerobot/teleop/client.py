"""A client without a page: scripts drive a session over the same socket, one call after the other."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any
from urllib.parse import parse_qs, urlsplit, urlunsplit

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from robocasa_lerobot.teleop.messages import unpack_frame

_OPEN_S = 20.0


class TeleopClient:
    """A scripted operator, or a viewer.

    Args:
        address: that the command printed.
        acknowledges: answer each picture as it comes.
        origin: header of a browser, for tests.

    Attributes:
        frame: header of the newest picture, `{}` before any; `pictures`: its JPEGs.
        said: all other messages, in their order.
    """

    def __init__(self, address: str, *, acknowledges: bool = True, origin: str | None = None) -> None:
        scheme, host, _, query, _ = urlsplit(address)
        token = parse_qs(query).get("t", [""])[0]
        where = urlunsplit(("wss" if scheme == "https" else "ws", host, "/ws", f"t={token}", ""))
        self._acknowledges = acknowledges
        self._socket = connect(where, max_size=None, open_timeout=_OPEN_S, origin=origin, compression=None)  # type: ignore[arg-type]
        self.frame: dict[str, Any] = {}
        self.pictures: list[bytes] = []
        self.said: list[dict[str, Any]] = []

    def send(self, kind: str, **fields: Any) -> None:
        """Send a message; `input` and `action` answer the newest picture unless they say which.

        Raises:
            websockets.exceptions.ConnectionClosed: the server has ended the connection.
        """
        if kind in ("input", "action"):
            fields.setdefault("frame", self.frame.get("id", 0))
        self._socket.send(json.dumps({"type": kind, **fields}))

    def send_text(self, text: str | bytes) -> None:
        """Send something as it is."""
        self._socket.send(text)

    def receive(self, seconds: float = 1.0) -> str:
        """Take one message, and return its type.

        Raises:
            TimeoutError: none has come.
            websockets.exceptions.ConnectionClosed: the server has ended the connection.
        """
        message = self._socket.recv(timeout=seconds)
        if isinstance(message, bytes):
            self.frame, self.pictures = unpack_frame(message)
            if self._acknowledges:
                self.send("ack", frame=self.frame["id"])
            return "frame"
        told: dict[str, Any] = json.loads(message)
        self.said.append(told)
        return str(told["type"])

    def until(self, condition: Callable[[], bool], seconds: float = 30.0) -> None:
        """Take messages until a condition holds.

        Raises:
            TimeoutError: it did not in that time.
        """
        end = time.monotonic() + seconds
        while not condition():
            left = end - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"not in {seconds:g} s; the last picture says {self.frame}")
            try:
                self.receive(left)
            except TimeoutError:
                continue

    def until_phase(self, *phases: str, seconds: float = 120.0) -> dict[str, Any]:
        """Take messages until the newest picture is of one of these phases; its header.

        Raises:
            TimeoutError: none was in that time.
        """
        self.until(lambda: self.frame.get("phase") in phases, seconds)
        return self.frame

    def until_told(self, kind: str, seconds: float = 30.0) -> dict[str, Any]:
        """Take messages until one of a type comes that has not been taken yet; that one.

        Raises:
            TimeoutError: none came in that time.
        """
        before = len(self.said)
        self.until(lambda: any(told["type"] == kind for told in self.said[before:]), seconds)
        return next(told for told in self.said[before:] if told["type"] == kind)

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def __enter__(self) -> TeleopClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


__all__ = ["ConnectionClosed", "TeleopClient"]
