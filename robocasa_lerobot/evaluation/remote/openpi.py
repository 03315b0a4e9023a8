"""Asking a policy over openpi's protocol: websocket, msgpack, the server speaks first.

Source of the protocol: openpi-client 0.1.2. A text frame is an error with its traceback; there is no reset, no seed and
no number of a request, so that a request that timed out ends the connection.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from robocasa_lerobot.evaluation.remote.address import Address
from robocasa_lerobot.evaluation.remote.client import Timeouts, Waiting, do_nothing
from robocasa_lerobot.evaluation.remote.failures import AnswerError, LostError, ServerSaidError
from robocasa_lerobot.evaluation.remote.websocket import WebSocket
from robocasa_lerobot.wire.codec import WireError, decode, encode


class OpenpiClient:
    """A connection to an openpi server; see `PolicyClient`.

    Raises:
        LostError: nobody listens, or no metadata came in time.
    """

    def __init__(
        self, address: Address, timeouts: Timeouts, waiting: Waiting = do_nothing, token: str | None = None
    ) -> None:
        self._address, self._timeouts, self._answered = address, timeouts, False
        self._socket = WebSocket(address, timeouts.connect, waiting, token, timeouts.introduced)
        try:
            self.metadata = self._receive(timeouts.introduced)
        except LostError as error:
            raise LostError(f"{error}: an openpi server sends its metadata first; is it one?") from error

    def infer(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to an observation; see `PolicyClient`."""
        seconds = self._timeouts.answer if self._answered else self._timeouts.first_answer
        self._socket.send(encode(dict(observation), "openpi"), seconds)
        answer = self._receive(seconds)
        self._answered = True
        return answer

    def reset(self, message: Mapping[str, Any] | None = None) -> None:
        """Nothing on the wire, but for servers whose key map has a reset message: any answer to it will do."""
        if message:
            self._socket.send(encode(dict(message), "openpi"), self._timeouts.answer)
            self._socket.receive(self._timeouts.answer)

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def _receive(self, seconds: float) -> dict[str, Any]:
        frame = self._socket.receive(seconds)
        if isinstance(frame, str):
            self._socket.close()  # the server closes as well
            raise ServerSaidError(frame.strip())
        try:
            message = decode(frame)
        except WireError as error:
            raise AnswerError(f"{self._address.text}: {error}") from error
        if not isinstance(message, dict):
            raise AnswerError(f"{self._address.text}: found a {type(message).__name__}, expected a map")
        return message
