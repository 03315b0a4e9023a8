"""What `robocasa-lerobot serve` was asked for, and the server of each protocol."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field

from robocasa_lerobot.serving.access import Access
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.limits import Limits

Ready = Callable[[int], None]


@dataclass(frozen=True)
class ServerSettings:
    """How a policy is served. `groot_version` is that of the modality config; requests tell theirs themselves."""

    protocol: str
    access: Access
    limits: Limits = field(default_factory=Limits)
    groot_version: str = "1.6"
    allow_kill: bool = False


def run_server(host: Host, settings: ServerSettings, ready: Ready) -> bool:
    """Serve until SIGINT or SIGTERM; False where a computation had to be left behind.

    Raises:
        UserError: the address cannot be listened on, or a package is missing.
    """

    async def run() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        for one in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(one, stop.set)
        await serve(host, settings, stop, ready)

    try:
        asyncio.run(run())
    finally:
        ended = host.close()
    return ended


def serve(host: Host, settings: ServerSettings, stop: asyncio.Event, ready: Ready) -> Awaitable[None]:
    """The server of a protocol, until `stop` is set; `ready` is called with its port."""
    access, limits = settings.access, settings.limits
    if settings.protocol == "gr00t":
        from robocasa_lerobot.serving.gr00t import GrootServer

        return GrootServer(host, access, limits, settings.groot_version, settings.allow_kill).serve(stop, ready)
    from robocasa_lerobot.serving.web import serve_websockets

    if settings.protocol == "vla_eval":
        from robocasa_lerobot.serving import vla_eval

        episodes = vla_eval.VlaEvalServer(host, limits)
        pages = episodes.pages()
        return serve_websockets(episodes.handle, vla_eval.OPEN_PAGES, pages, access, limits, stop, ready)
    from robocasa_lerobot.serving import openpi

    server = openpi.OpenpiServer(host, limits)
    return serve_websockets(server.handle, openpi.OPEN_PAGES, {}, access, limits, stop, ready)


def address(settings: ServerSettings, port: int) -> str:
    """Where clients find the server."""
    host = f"[{settings.access.host}]" if ":" in settings.access.host else settings.access.host
    return f"{'tcp' if settings.protocol == 'gr00t' else 'ws'}://{host}:{port}"
