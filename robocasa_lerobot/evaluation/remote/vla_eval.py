"""Asking a policy over vla-eval's protocol: websocket, msgpack messages with a type and a number.

Source of the protocol: vla-eval 0.8.0. The client says hello, then begins an episode, then sends observations, each
answered by an action or an error of the same number.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from robocasa_lerobot.evaluation.remote.address import Address
from robocasa_lerobot.evaluation.remote.client import Timeouts, Waiting, do_nothing
from robocasa_lerobot.evaluation.remote.failures import AnswerError, LostError, ServerSaidError
from robocasa_lerobot.evaluation.remote.websocket import WebSocket
from robocasa_lerobot.wire.codec import WireError, decode, encode

PROTOCOL_VERSION = 1
HARNESS = "robocasa_lerobot"


class VlaEvalClient:
    """A connection to a model server of vla-eval; see `PolicyClient`.

    Raises:
        LostError: nobody listens, or no hello came in time.
    """

    def __init__(
        self, address: Address, timeouts: Timeouts, waiting: Waiting = do_nothing, token: str | None = None
    ) -> None:
        self._address, self._timeouts, self._answered = address, timeouts, False
        self._number, self._in_episode = 0, False
        self._socket = WebSocket(address, timeouts.connect, waiting, token, timeouts.introduced)
        hello = {"harness_version": HARNESS, "protocol_version": PROTOCOL_VERSION, "benchmark": HARNESS}
        try:
            self.metadata = self._answer(self._send("hello", hello), "hello", timeouts.introduced)
        except LostError as error:
            raise LostError(f"{error}: a vla_eval server answers a hello; is it one?") from error

    def infer(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The answer to an observation; begins an episode where none has begun."""
        if not self._in_episode:
            self.reset()
        number = self._send("observation", dict(observation))
        answer = self._answer(number, "action", self._seconds)
        self._answered = True
        return answer

    def reset(self, message: Mapping[str, Any] | None = None) -> None:
        """End the episode, if there is one, and begin the next; neither is answered."""
        if self._in_episode:
            self._send("episode_end", {})
        self._send("episode_start", dict(message or {"task": {"name": HARNESS}}))
        self._in_episode = True

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    @property
    def _seconds(self) -> float:
        return self._timeouts.answer if self._answered else self._timeouts.first_answer

    def _send(self, kind: str, payload: dict[str, Any]) -> int:
        self._number += 1
        message = {"type": kind, "payload": payload, "seq": self._number, "timestamp": time.time()}
        self._socket.send(encode(message, "vla_eval"), self._seconds)
        return self._number

    def _answer(self, number: int, kind: str, seconds: float) -> dict[str, Any]:
        """The payload of the message of this kind and number; an error of any number is one of ours."""
        while True:
            frame = self._socket.receive(seconds)
            try:
                message = decode(frame.encode() if isinstance(frame, str) else frame)
            except WireError as error:
                raise AnswerError(f"{self._address.text}: {error}") from error
            found = message.get("type") if isinstance(message, dict) else None
            payload = message.get("payload") if isinstance(message, dict) else None
            if found == "error":
                raise ServerSaidError(str(payload.get("error", payload) if isinstance(payload, dict) else payload))
            if found != kind or not isinstance(payload, dict):
                raise AnswerError(f"{self._address.text}: found a message of type {found!r}, expected {kind!r}")
            if message.get("seq") == number:
                return payload
