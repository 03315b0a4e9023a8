"""A whole session: store, kitchen, policy, server and clock together, until it is done or interrupted."""

from __future__ import annotations

import contextlib
import dataclasses
import signal
import ssl
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.web_view import WebView
from robocasa_lerobot.gl import ensure_drawing, ensure_gl
from robocasa_lerobot.teleop.driving.pilot import Pilot, load_pilot
from robocasa_lerobot.teleop.keeping.store import Store, check_out
from robocasa_lerobot.teleop.loop import ControlLoop, Inbox
from robocasa_lerobot.teleop.server import TeleopServer
from robocasa_lerobot.teleop.session import Session
from robocasa_lerobot.teleop.settings import TeleopSettings

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Place:
    """Where it is served: see `TeleopServer`."""

    host: str = "127.0.0.1"
    port: int = 0
    token: str | None = None
    tls: ssl.SSLContext | None = None


@dataclass(frozen=True)
class Outcome:
    """What a session has come to: saved episodes of all sessions, and their file if there are any."""

    saved: int
    path: Path | None


def run_session(
    settings: TeleopSettings,
    place: Place,
    announce: Callable[[TeleopServer, ControlLoop], None],
    *,
    policy: str = "",
    device: str = "auto",
    keys: str = "",
    free_view: bool = False,
) -> Outcome:
    """Serve a session until enough is saved, it is ended or the process is interrupted.

    Args:
        settings: of the session.
        place: to serve it at.
        announce: called once clients can connect.
        policy: that drives where nobody intervenes, as of `load_pilot`.
        device: that it computes on.
        keys: its key map, where it is behind a socket.
        free_view: run MuJoCo's own web viewer beside it, on the loopback address.

    Raises:
        UserError: unknown names, episodes of other settings, a folder that cannot be written to, a port that is
            taken, a policy that cannot be loaded; a disk that is full at the end.
        NoOpenGLError: nothing on this machine can render free cameras; nothing is made then.
    """
    check_out(settings.out)
    ensure_drawing()
    ensure_gl()  # draws the map and the picture around whoever draws the robot's cameras: said now, not to an operator
    pilot: Pilot | None = None
    size = settings.image_size
    if policy:
        pilot, size = load_pilot(policy, settings.task, device, keys)
        settings = dataclasses.replace(settings, policy=pilot.name)
    kwargs = {**settings.env_kwargs(), "image_size": size, "cameras": contract.CAMERAS if pilot else ()}
    env = KitchenEnv(settings.task, terminate_on_success=False, **kwargs)
    env.render_observations = False
    inbox: Inbox = Inbox()
    with contextlib.ExitStack() as open_things:
        view = open_things.enter_context(WebView(f"{settings.task}, by hand")) if free_view else None
        if view is not None:
            settings = dataclasses.replace(settings, free_view=view.address)
        store = open_things.enter_context(Store(settings).held())
        server = TeleopServer(settings, inbox, place.host, place.port, place.token, place.tls)
        server.start()
        try:
            loop = ControlLoop(Session(settings, store, env, pilot), inbox, server, view.sync if view else None)
            with _stopped_by_signals(loop):
                announce(server, loop)
                loop.run()
        finally:
            server.close()
    return Outcome(len(store.saved), store.path if store.path.exists() else None)


@contextlib.contextmanager
def _stopped_by_signals(loop: ControlLoop) -> Iterator[None]:
    """The first interruption ends the session in order, the second at once; only where this is the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        loop.stop()
        for known, handler in before.items():
            signal.signal(known, handler)

    before = {known: signal.getsignal(known) for known in _SIGNALS}
    for known in _SIGNALS:
        signal.signal(known, stop)
    try:
        yield
    finally:
        for known, handler in before.items():
            signal.signal(known, handler)
