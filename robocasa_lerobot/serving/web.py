"""What the two WebSocket protocols share: HTTP answers on the same port, the token, limits, and a clean end."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.serving.access import Access
from robocasa_lerobot.serving.limits import Limits

Handler = Callable[[ServerConnection], Awaitable[None]]
Page = Callable[[dict[str, list[str]]], tuple[HTTPStatus, str]]  # of the address's query
_CLOSE_SECONDS = 10.0
# The system asks a silent client's machine whether it is there after so many seconds, this often, so many times.
_KEEP_ALIVE = {"TCP_KEEPIDLE": 600, "TCP_KEEPINTVL": 60, "TCP_KEEPCNT": 5}


async def serve_websockets(
    handler: Handler,
    open_pages: dict[str, str],
    closed_pages: dict[str, Page],
    access: Access,
    limits: Limits,
    stop: asyncio.Event,
    ready: Callable[[int], None],
) -> None:
    """Answer clients until `stop` is set.

    Args:
        handler: of one client's connection.
        open_pages: bodies of HTTP answers by path, for anybody.
        closed_pages: what makes HTTP answers by path, for who has the token.
        access: where to listen, and the token.
        limits: of messages and clients.
        stop: ends the server.
        ready: called with the port when clients can come.

    Raises:
        UserError: the address cannot be listened on.
    """
    clients: set[ServerConnection] = set()
    # Whoever only looks whether somebody listens would leave a traceback in the log.
    quiet = logging.getLogger(f"{__name__}.handshakes")
    quiet.setLevel(logging.CRITICAL)

    def before_handshake(connection: ServerConnection, request: Request) -> Response | None:
        address = urlsplit(request.path)
        if address.path in open_pages:
            return _page(connection, HTTPStatus.OK, open_pages[address.path])
        if not access.allows(_token(request)):
            return connection.respond(
                HTTPStatus.UNAUTHORIZED, "a valid token is needed: Authorization: Api-Key TOKEN\n"
            )
        if address.path in closed_pages:
            return _page(connection, *closed_pages[address.path](parse_qs(address.query)))
        if len(clients) >= limits.clients:
            full = f"{limits.clients} clients are served already: give a larger --max-clients, or use fewer workers"
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, full + "\n")
        return None

    async def counted(connection: ServerConnection) -> None:
        clients.add(connection)
        try:
            _keep_alive(connection)
            with suppress(ConnectionClosed):  # the client went away; nobody else is concerned
                await handler(connection)
        finally:
            clients.discard(connection)

    try:
        server = await serve(
            counted,
            access.host,
            access.port,
            process_request=before_handshake,
            # Without a token no page of a browser may ask a server on its machine.
            origins=[None] if access.token is None else None,
            logger=quiet,
            compression=None,
            max_size=limits.message_bytes,
            max_queue=1,
            ping_interval=None,  # a client that renders or plans for minutes is not gone
        )
    except (OSError, UnicodeError) as error:  # the latter: no name of a host
        why = getattr(error, "strerror", None) or error
        raise UserError(f"cannot listen on {access.host}:{access.port}: {why}") from error
    ready(server.sockets[0].getsockname()[1])
    await stop.wait()
    server.close()
    with suppress(TimeoutError):  # a computation may go on; the process ends all the same
        await asyncio.wait_for(server.wait_closed(), _CLOSE_SECONDS)


def _keep_alive(connection: ServerConnection) -> None:
    """End the connection of a client that is gone without a word: nothing else would ever free its place."""
    own = connection.transport.get_extra_info("socket")
    own.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in _KEEP_ALIVE.items():
        if hasattr(socket, name):  # not on every system; its own are hours
            own.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def _page(connection: ServerConnection, status: HTTPStatus, body: str) -> Response:
    response = connection.respond(status, body)
    if body.startswith("{"):
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "application/json"
    return response


def _token(request: Request) -> str | None:
    """What a client gave as its token: a header (`Api-Key` or `Bearer`), or `token=` in the address."""
    headers = request.headers.get_all("Authorization")
    if len(headers) == 1:
        scheme, _, value = headers[0].partition(" ")
        return value.strip() if scheme.lower() in ("api-key", "bearer") else None
    values = parse_qs(urlsplit(request.path).query).get("token", [])
    return values[0] if len(values) == 1 and not headers else None
