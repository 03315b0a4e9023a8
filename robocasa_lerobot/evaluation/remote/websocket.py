"""A websocket with our own timeouts, whose ends are told apart: refused, timed out, closed and why."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import suppress

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus, WebSocketException
from websockets.sync.client import ClientConnection, connect

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.address import Address
from robocasa_lerobot.evaluation.remote.client import POLL_SECONDS, TOKEN_VARIABLE, Waiting
from robocasa_lerobot.evaluation.remote.failures import LostError
from robocasa_lerobot.wire.codec import MAX_MESSAGE_BYTES

_HANDSHAKE_SECONDS = 20.0  # of one try: a server that computes in its event loop lets newcomers wait
_RETRY_SECONDS = 0.25
_UNAUTHORIZED = (401, 403)
# Others are served, or what the server needs is not there yet; a proxy before it finds nobody, or nobody who answers.
_NOT_NOW = (502, 503, 504)
_SHOWN = 200  # characters of what an answer says; a proxy sends whole pages


class WebSocket:
    """An open websocket; frames are bytes or text.

    Pings are off: servers that compile inside their event loop do not answer them for minutes.

    Args:
        address: of the server.
        seconds: for how long it is tried again while nobody listens, or the server has no place.
        waiting: called every now and then.
        token: sent as `Authorization: Api-Key ...`; None sends nothing.
        busy_seconds: for how long while somebody listens and does not answer the handshake, if that is longer.

    Raises:
        LostError: nobody listened or answered the handshake in time, or the server had no place.
        UserError: the server wants a token, or is no websocket server.
    """

    def __init__(
        self, address: Address, seconds: float, waiting: Waiting, token: str | None, busy_seconds: float = 0.0
    ) -> None:
        self._address, self._waiting = address, waiting
        headers = {"Authorization": f"Api-Key {token}"} if token else None
        self._connection = self._connect(seconds, max(seconds, busy_seconds), headers)

    def send(self, frame: bytes, seconds: float) -> None:
        """Send a binary frame.

        Raises:
            LostError: it was not taken within `seconds`, as by a server that computes and does not read what is larger
                than the system's buffers; or the connection has ended.
        """
        failed: list[Exception] = []

        def work() -> None:  # which has no time limit of its own
            try:
                self._connection.send(frame)
            except Exception as error:
                failed.append(error)

        deadline, sending = _now() + seconds, threading.Thread(target=work, daemon=True)
        sending.start()
        while True:
            sending.join(min(POLL_SECONDS, max(0.0, deadline - _now())))
            if not sending.is_alive():
                break
            self._waiting()
            if _now() >= deadline:
                self.close()
                raise LostError(f"{self._address.text}: timed out, a request was not taken within {seconds:g} s")
        if failed:
            if isinstance(failed[0], ConnectionClosed | OSError):
                raise self._ended(failed[0]) from failed[0]
            raise failed[0]

    def receive(self, seconds: float) -> bytes | str:
        """The next frame.

        Raises:
            LostError: none within `seconds`, or the connection has ended. Then the socket is closed: an answer that
                came later would be taken for that to another request.
        """
        deadline = time.monotonic() + seconds
        while True:
            try:
                frame: bytes | str = self._connection.recv(timeout=min(POLL_SECONDS, max(0.0, deadline - _now())))
                return frame
            except TimeoutError:
                self._waiting()
                if _now() >= deadline:
                    self.close()
                    raise LostError(f"{self._address.text}: timed out, no answer within {seconds:g} s") from None
            except (ConnectionClosed, OSError) as error:
                raise self._ended(error) from error

    def close(self) -> None:
        """End the connection without waiting for the other side."""
        with suppress(Exception):
            self._connection.socket.shutdown(socket.SHUT_RDWR)
        with suppress(Exception):
            self._connection.close()

    def _connect(self, seconds: float, busy_seconds: float, headers: dict[str, str] | None) -> ClientConnection:
        began = _now()
        while True:
            try:
                return connect(
                    self._address.websocket,
                    additional_headers=headers,
                    compression=None,
                    max_size=MAX_MESSAGE_BYTES,
                    ping_interval=None,
                    open_timeout=min(max(0.1, began + busy_seconds - _now()), _HANDSHAKE_SECONDS),
                    close_timeout=1.0,
                    proxy=None,
                )
            except (OSError, TimeoutError, WebSocketException) as error:
                if isinstance(error, socket.gaierror) and error.errno != socket.EAI_AGAIN:
                    raise LostError(f"{self._address.text}: unknown host ({error})") from error
                if isinstance(error, InvalidStatus) and error.response.status_code not in _NOT_NOW:
                    raise self._unwanted(error) from error
                self._waiting()
                busy = isinstance(error, TimeoutError) and self._listens()
                tried = busy_seconds if busy else seconds
                if _now() + _RETRY_SECONDS >= began + tried:
                    raise LostError(f"{self._address.text}: {_why(error)}; tried for {tried:g} s") from error
                time.sleep(_RETRY_SECONDS)

    def _listens(self) -> bool:
        """Whether somebody takes connections there, whatever they do with them."""
        try:
            socket.create_connection((self._address.host.strip("[]"), self._address.port), timeout=5.0).close()
        except OSError:
            return False
        return True

    def _unwanted(self, error: InvalidStatus) -> UserError:
        status = error.response.status_code
        if status in _UNAUTHORIZED:
            return UserError(
                f"{self._address.text}: the server refuses us (HTTP {status}): put its token into the environment "
                f"variable {TOKEN_VARIABLE}."
            )
        return UserError(f"{self._address.text}: found a web server that answers HTTP {status}, expected a websocket.")

    def _ended(self, error: Exception) -> LostError:
        self.close()
        frame = error.rcvd if isinstance(error, ConnectionClosed) else None
        why = f"code {frame.code}" + (f", {frame.reason}" if frame.reason else "") if frame else "without a word"
        return LostError(f"{self._address.text}: the server closed the connection ({why})")


def _now() -> float:
    return time.monotonic()


def _why(error: Exception) -> str:
    if isinstance(error, ConnectionRefusedError):
        return "refused, nobody listens there"
    if isinstance(error, TimeoutError):
        return "timed out, the handshake was not answered"
    if isinstance(error, InvalidStatus):
        said = (error.response.body or b"").decode(errors="replace").strip()[:_SHOWN]
        return f"the server has no place, HTTP {error.response.status_code}" + (f" ({said})" if said else "")
    if isinstance(error, InvalidHandshake):
        return f"what listens there is no websocket server ({error})"
    return f"cannot connect ({error})"
