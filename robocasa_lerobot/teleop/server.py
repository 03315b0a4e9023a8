"""The one port: page, map and WebSocket, in a thread with an event loop of its own; `protocol.md` has what is said."""

from __future__ import annotations

import asyncio
import hmac
import secrets
import ssl
import threading
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import WSCloseCode, WSMsgType, web

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.teleop.client_line import ClientLine
from robocasa_lerobot.teleop.loop import Event, Inbox
from robocasa_lerobot.teleop.messages import LONGEST_MESSAGE, Message, ProtocolError, pack_frame, parse
from robocasa_lerobot.teleop.settings import STALE_S, TeleopSettings
from robocasa_lerobot.teleop.telling import hello

OPERATOR, VIEWER = "operator", "viewer"
PAGE = Path(__file__).parent / "page"
MOST_CLIENTS = 9
_HEARTBEAT_S, _WATCH_S, _START_S, _FLUSH_S = 10.0, 0.1, 10.0, 1.0
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'self'; img-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"
    ),
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
_WITHOUT_PAGE = "The page is not installed here; the WebSocket at /ws works."


class TeleopServer:
    """Serves one session to one operator and some viewers; it is a `loop.Audience`.

    Args:
        settings: told to clients.
        inbox: gets what the operator says.
        host: address to listen at.
        port: 0 takes a free one.
        token: that clients must know; None makes one.
        tls: certificate and key, for https.
    """

    def __init__(
        self,
        settings: TeleopSettings,
        inbox: Inbox,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self.host, self.port, self.token = host, port, token or secrets.token_urlsafe(16)
        self._settings, self._inbox, self._tls = settings, inbox, tls
        self._lines: list[ClientLine] = []  # the first that was there longest; only the event loop's thread uses them
        self._operator: ClientLine | None = None
        self._scene: dict[str, Any] | None = None
        self._map: tuple[str, bytes] = ("", b"")
        self._hungry = self._blind = False
        self._failure: BaseException | None = None
        self._loop = asyncio.new_event_loop()
        self._started, self._ended = threading.Event(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="teleop-server", daemon=True)

    @property
    def address(self) -> str:
        """What the operator opens."""
        scheme = "http" if self._tls is None else "https"
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{scheme}://{host}:{self.port}/?t={self.token}"

    @property
    def free_view(self) -> str:
        """Where MuJoCo's own viewer is, or ""."""
        return self._settings.free_view

    def start(self) -> None:
        """Listen.

        Raises:
            UserError: the address or port cannot be had.
        """
        self._thread.start()
        self._started.wait(_START_S)
        if self._failure is not None:
            raise UserError(
                f"nothing can be served at {self.host}:{self.port} ({self._failure}). Choose another --port or --host."
            ) from self._failure

    def close(self) -> None:
        """Send what is left, and end."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._ended.set)
            self._thread.join()

    def wants_frames(self) -> bool:
        """Whether somebody can take a picture now."""
        return self._hungry

    def sees_nothing(self) -> bool:
        """Whether the operator has not answered a picture for too long."""
        return self._blind

    def frame(self, told: dict[str, Any], pictures: list[bytes]) -> None:
        """Send a picture message to everybody; it replaces one that still waits."""
        self._soon(self._spread_frame, told, pictures)

    def tell(self, message: dict[str, Any], map_jpeg: bytes | None) -> None:
        """Send a message to everybody; with a new scene its map."""
        self._soon(self._spread, message, map_jpeg)

    def _soon(self, call: Any, *args: Any) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(call, *args)

    def _spread_frame(self, told: dict[str, Any], pictures: list[bytes]) -> None:
        viewers = len(self._lines) - (self._operator is not None)
        late = self._operator is not None and self._operator.late(STALE_S)
        driven = {"operator": self._operator is not None, "late": late}
        message = pack_frame({**told, **driven, "viewers": viewers}, pictures)
        for line in self._lines:
            line.show(told["id"], message)
        self._count()

    def _spread(self, message: dict[str, Any], map_jpeg: bytes | None) -> None:
        if map_jpeg is not None:
            version = str(message["episode"])
            self._map = version, map_jpeg
            message = {**message, "map": {**message["map"], "url": f"/map.jpg?t={self.token}&v={version}"}}
            self._scene = message
        for line in self._lines:
            line.say(message)

    def _count(self) -> None:
        self._hungry = any(line.hungry for line in self._lines)
        self._blind = self._operator is not None and self._operator.overdue(STALE_S)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except (OSError, OverflowError, UnicodeError) as error:  # taken; no port; no name of a host
            self._failure = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        app = web.Application(middlewares=[_with_headers])
        app.router.add_get("/", self._page)
        app.router.add_get("/map.jpg", self._picture)
        app.router.add_get("/ws", self._socket)
        if PAGE.is_dir():
            app.router.add_static("/page/", PAGE)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=_FLUSH_S)
        await runner.setup()
        try:
            site = web.TCPSite(runner, self.host, self.port, ssl_context=self._tls)
            await site.start()
            self.port = runner.addresses[0][1]
            self._started.set()
            watch = asyncio.create_task(self._watch())
            await self._ended.wait()
            watch.cancel()
            await asyncio.gather(*(line.flush(_FLUSH_S) for line in self._lines), return_exceptions=True)
            for line in list(self._lines):
                await line.close(WSCloseCode.GOING_AWAY, "the session has ended")
        finally:
            await runner.cleanup()

    def _admitted(self, request: web.Request) -> bool:
        return hmac.compare_digest(request.query.get("t", "").encode(), self.token.encode())

    async def _page(self, request: web.Request) -> web.StreamResponse:
        if not self._admitted(request):
            raise web.HTTPForbidden(text="The address needs the token that the command printed.")
        page = PAGE / "index.html"
        if not page.is_file():
            return web.Response(text=_WITHOUT_PAGE)
        return web.FileResponse(page)

    async def _picture(self, request: web.Request) -> web.StreamResponse:
        if not self._admitted(request):
            raise web.HTTPForbidden
        version, data = self._map
        if not data or request.query.get("v") != version:
            raise web.HTTPNotFound
        return web.Response(body=data, content_type="image/jpeg")

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        origin = request.headers.get("Origin")
        if not self._admitted(request) or (origin is not None and urlsplit(origin).netloc != request.host):
            raise web.HTTPForbidden
        if len(self._lines) >= MOST_CLIENTS:
            raise web.HTTPServiceUnavailable(text="too many clients")
        socket = web.WebSocketResponse(max_msg_size=LONGEST_MESSAGE, heartbeat=_HEARTBEAT_S, compress=False)
        await socket.prepare(request)
        line = ClientLine(socket, self._count)
        self._lines.append(line)
        role = VIEWER if self._operator is not None else OPERATOR
        if role == OPERATOR:
            self._operator = line
        line.say(hello(self._settings, role))
        if self._scene is not None:
            line.say(self._scene)
        self._count()
        self._inbox.put(Event("joined"))
        sending = asyncio.create_task(line.send())
        try:
            await self._listen(line, socket)
        finally:
            self._lines.remove(line)
            if self._operator is line:
                self._operator = None
                self._inbox.put(Event("disconnected"))
            self._count()
            sending.cancel()
        return socket

    async def _listen(self, line: ClientLine, socket: web.WebSocketResponse) -> None:
        async for received in socket:
            if received.type != WSMsgType.TEXT:
                await line.close(WSCloseCode.UNSUPPORTED_DATA, "text messages only")
                return
            try:
                message = parse(received.data)
            except ProtocolError as error:
                await line.close(WSCloseCode.POLICY_VIOLATION, str(error))
                return
            self._take(line, message)

    def _take(self, line: ClientLine, message: Message) -> None:
        if message.type == "ack":
            line.acknowledge(message["frame"])
            self._count()
        elif message.type == "take":
            if self._operator is None:
                self._operator = line
                line.say({"type": "role", "role": OPERATOR})
                self._count()
                self._inbox.put(Event("joined"))
            elif self._operator is not line:
                line.say(_answer("take", "another client drives"))
        elif line is self._operator:
            self._inbox.put(message)
        else:
            line.say(_answer(message.type, "you are watching: another client drives"))

    async def _watch(self) -> None:
        """Notice where the operator has not answered for too long."""
        while True:
            await asyncio.sleep(_WATCH_S)
            self._count()


def _answer(about: str, text: str) -> dict[str, Any]:
    return {"type": "note", "level": "warning", "text": text, "about": about}


@web.middleware
async def _with_headers(request: web.Request, handler: Any) -> web.StreamResponse:
    try:
        response: web.StreamResponse = await handler(request)
    except web.HTTPException as error:
        error.headers.update(_HEADERS)
        raise
    if not response.prepared:
        response.headers.update(_HEADERS)
    return response
