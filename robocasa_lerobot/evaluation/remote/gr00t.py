"""Asking a policy over GR00T's inference service: ZeroMQ request and reply, msgpack.

Source of the protocol: Isaac-GR00T, `gr00t/eval/service.py` of N1.5 and `gr00t/policy/server_client.py` of N1.6 and
N1.7. N1.5 hands `data` over as one argument, the others as keyword arguments: what the modality configuration looks
like tells them apart, and so does the complaint about unexpected arguments.
"""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.address import Address
from robocasa_lerobot.evaluation.remote.client import POLL_SECONDS, TOKEN_VARIABLE, Timeouts, Waiting, do_nothing
from robocasa_lerobot.evaluation.remote.failures import AnswerError, LostError, ServerSaidError
from robocasa_lerobot.wire.codec import MAX_MESSAGE_BYTES, WireError, decode, encode

N15, N16, N17 = "N1.5", "N1.6", "N1.7"
_MARKERS = ("__ModalityConfig_class__", "__ModalityConfig__")
_RETRY_SECONDS = 0.25
_OTHER_CALL = ("unexpected keyword argument", "required positional argument")  # of a service that is asked wrongly


def _only_ipv6(address: Address) -> bool:
    """Whether a host has no IPv4 address: ZeroMQ looks for either kind, as it is told."""
    try:
        found = socket.getaddrinfo(address.host.strip("[]"), address.port, type=socket.SOCK_STREAM)
    except OSError:
        return False
    return all(kind == socket.AF_INET6 for kind, *_ in found)


class Gr00tClient:
    """A connection to GR00T's inference service; see `PolicyClient`.

    `metadata` has `gr00t_version` (None where the service does not tell), `modality_config` (for `video`, `state`,
    `action` and `language` a map with `modality_keys` and `delta_indices`) and what our own server says with its ping.

    Raises:
        LostError: nobody listens, or nobody answers.
        UserError: pyzmq is not installed, or the service wants a token.
    """

    def __init__(
        self, address: Address, timeouts: Timeouts, waiting: Waiting = do_nothing, token: str | None = None
    ) -> None:
        try:
            import zmq
        except ImportError as error:
            raise UserError(
                "gr00t:// needs pyzmq: `pip install pyzmq`, or this package with its extra gr00t, in its folder: "
                "`pip install -e '.[gr00t]'`."
            ) from error
        self._zmq, self._address, self._timeouts = zmq, address, timeouts
        self._waiting, self._token, self._answered = waiting, token, False
        self._wait_for_listener()
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.IPV6, int(_only_ipv6(address)))
        self._socket.setsockopt(zmq.MAXMSGSIZE, MAX_MESSAGE_BYTES)
        # A service that dies leaves a request without an answer for ever; the monitor tells.
        self._monitor = self._socket.get_monitor_socket(zmq.EVENT_DISCONNECTED)
        self._socket.connect(f"tcp://{address.host}:{address.port}")
        try:
            said = self._ask({"endpoint": "ping"}, timeouts.introduced)
            config, version = self._modality_config()
        except ServerSaidError as error:
            self.close()
            raise self._refused(error) from error
        except (LostError, AnswerError):
            self.close()
            raise
        self._version = version
        own = said.get("metadata") if isinstance(said, dict) else None
        own = own if isinstance(own, dict) else {}
        self.metadata: dict[str, Any] = {**own, "gr00t_version": version, "modality_config": config}

    @property
    def version(self) -> str | None:
        """N1.5, N1.6 or N1.7, as far as it is known."""
        return self._version

    def infer(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The action map of an observation; the service's version, where unknown, follows from its first answer.

        What the observation has under `options` is handed over as such, by services from N1.6 on.
        """
        seconds = self._timeouts.answer if self._answered else self._timeouts.first_answer
        try:
            answer = self._get_action(observation, seconds)
        except ServerSaidError as error:
            if self._answered or not any(words in str(error) for words in _OTHER_CALL):
                raise
            self._version = N16 if self._version in (None, N15) else N15
            self.metadata["gr00t_version"] = self._version
            answer = self._get_action(observation, seconds)
        self._answered = True
        if isinstance(answer, list | tuple) and answer:  # N1.6 and N1.7: actions, and information beside them
            answer = answer[0]
        if not isinstance(answer, dict):
            raise AnswerError(f"{self._address.text}: found a {type(answer).__name__}, expected a map of actions")
        return answer

    def reset(self, message: Mapping[str, Any] | None = None) -> None:
        """Tell services from N1.6 on; N1.5 keeps nothing."""
        if self._version in (None, N15):
            return
        try:
            self._ask({"endpoint": "reset", "data": {"options": dict(message) if message else None}})
        except ServerSaidError as error:
            if "endpoint" not in str(error).lower():  # one that does not know the request keeps nothing either
                raise

    def close(self) -> None:
        """End the connection."""
        with suppress(Exception):
            self._socket.disable_monitor()
        for one in (self._monitor, self._socket):
            with suppress(Exception):
                one.close(linger=0)
        with suppress(Exception):
            self._context.term()

    def _get_action(self, observation: Mapping[str, Any], seconds: float) -> Any:
        old = self._version in (None, N15)
        data = dict(observation)
        if not old:
            options = data.pop("options", None)
            data = {"observation": data, "options": options}
        return self._ask({"endpoint": "get_action", "data": data}, seconds)

    def _modality_config(self) -> tuple[dict[str, Any], str | None]:
        """The service's modality configuration as plain maps, and the version that writes it so."""
        try:
            answer = self._ask({"endpoint": "get_modality_config"}, self._timeouts.first_answer)
        except ServerSaidError as error:
            if "endpoint" in str(error).lower():
                return {}, None
            raise
        if not isinstance(answer, dict):
            return {}, None
        version: str | None = None
        config: dict[str, Any] = {}
        for name, entry in answer.items():
            marker = next((marker for marker in _MARKERS if isinstance(entry, dict) and marker in entry), None)
            if marker is None:
                config[name] = entry
                continue
            content = entry.get("as_json", {key: value for key, value in entry.items() if key != marker})
            version = N17 if marker == _MARKERS[1] else N15 if isinstance(content, str) else N16
            try:
                config[name] = json.loads(content) if isinstance(content, str) else content
            except json.JSONDecodeError as error:
                raise AnswerError(f"{self._address.text}: modality configuration of {name!r}: {error}") from error
        return config, version

    def _ask(self, request: dict[str, Any], seconds: float | None = None) -> Any:
        seconds = self._timeouts.answer if seconds is None else seconds
        zmq, poller = self._zmq, self._zmq.Poller()
        for one in (self._socket, self._monitor):
            poller.register(one, zmq.POLLIN)
        try:
            self._socket.send(encode(request | ({"api_token": self._token} if self._token else {}), "gr00t"))
        except zmq.ZMQError as error:
            raise LostError(f"{self._address.text}: the connection has ended ({error})") from error
        deadline = time.monotonic() + seconds
        while True:
            left = max(0.0, deadline - time.monotonic())
            ready = dict(poller.poll(round(1000 * min(POLL_SECONDS, left))))
            if self._socket in ready:
                return self._read(self._socket.recv())
            if self._monitor in ready:
                self.close()
                raise LostError(f"{self._address.text}: the server closed the connection")
            self._waiting()
            if time.monotonic() >= deadline:
                self.close()
                raise LostError(f"{self._address.text}: timed out, no answer within {seconds:g} s")

    def _read(self, data: bytes) -> Any:
        if data == b"ERROR":  # of a service whose reply could not even be packed
            raise ServerSaidError("ERROR, without a reason")
        try:
            answer = decode(data)
        except WireError as error:
            raise AnswerError(f"{self._address.text}: {error}") from error
        if isinstance(answer, dict) and "error" in answer:
            raise ServerSaidError(str(answer["error"]))
        return answer

    def _wait_for_listener(self) -> None:
        """ZeroMQ connects to nobody without a word; this tells refused from silent."""
        deadline = time.monotonic() + self._timeouts.connect
        host = self._address.host.strip("[]")
        while True:
            try:
                socket.create_connection((host, self._address.port), timeout=5.0).close()
                return
            except socket.gaierror as error:
                raise LostError(f"{self._address.text}: unknown host ({error})") from error
            except OSError as error:
                self._waiting()
                if time.monotonic() + _RETRY_SECONDS >= deadline:
                    refused = isinstance(error, ConnectionRefusedError)
                    why = "refused, nobody listens there" if refused else f"cannot connect ({error})"
                    tried = f"tried for {self._timeouts.connect:g} s"
                    raise LostError(f"{self._address.text}: {why}; {tried}") from error
                time.sleep(_RETRY_SECONDS)

    def _refused(self, error: ServerSaidError) -> UserError:
        if "nauthorized" in str(error):
            return UserError(
                f"{self._address.text}: the service refuses us ({error}): put its token into the environment variable "
                f"{TOKEN_VARIABLE}."
            )
        return UserError(f"{self._address.text}: the service answers its ping with an error: {error}.")
