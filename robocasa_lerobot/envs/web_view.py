"""MuJoCo's own web viewer: a scene in a browser, drawn there, without a display or an OpenGL context here.

It is `mujoco.experimental.studio` of MuJoCo 3.17, in the wheel that we have. As it comes it listens on all
addresses and asks for no password; here it listens on the loopback address alone. `tests/envs/test_web_view.py` pins
what is used.
"""

from __future__ import annotations

import contextlib
import copy
import queue
import socket
import time
from collections.abc import Iterator
from typing import Any, ClassVar

import mujoco

from robocasa_lerobot.envs.rendering.canvas import COLLISION_GROUP
from robocasa_lerobot.errors import UserError

_LOOPBACK = "127.0.0.1"
_START_S, _POLL_S = 60.0, 0.05
_NOT_SHOWN = 3  # the first group that MuJoCo's viewers leave out


class WebView:
    """A running viewer; `sync` shows it a state. A process has one at most: two share what they draw with, and crash.

    Args:
        title: of the browser's tab.
        port: 0 for the first free one from 8080 on.
        simulate: the viewer lets time run by itself, with its own pause and speed, in `run`.

    Raises:
        UserError: this MuJoCo has no such viewer, or the port is taken.
    """

    _running: ClassVar[bool] = False

    def __init__(self, title: str, port: int = 0, simulate: bool = False) -> None:
        assert not WebView._running, "a second web viewer in this process"
        studio = _studio()
        plugins: list[Any] = [studio["viewer_app"].ViewerApp()]
        if simulate:
            plugins.append(studio["step_control"].StepControl())
        config = studio["viewer_protocol"].ViewerConfig(title=title, gfx="web", http_port=port)
        with _loopback_only(studio) as bound:
            self._handle = studio["launch_web"].launch(config, plugins=plugins)
            self.port = _port(bound, self._handle, port)
        WebView._running = True
        self._copy: mujoco.MjData | None = None
        self._model: mujoco.MjModel | None = None
        self._shown: mujoco.MjModel | None = None

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{_LOOPBACK}:{self.port}/"

    def sync(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Show a state (3 ms). What somebody does in the viewer changes a copy of it and never `data`."""
        if self._copy is None or model is not self._model:
            self._model, self._copy, self._shown = model, mujoco.MjData(model), as_shown(model)
        mujoco.mj_copyData(self._copy, model, data)
        self._handle.sync(self._shown, self._copy)

    def run(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Simulate `data` and show it until the viewer ends or the user interrupts; needs `simulate`."""
        self._handle.set_model(as_shown(model), data=data)
        while self._handle.is_running():
            self._handle.sync()

    def close(self) -> None:
        """End it."""
        WebView._running = False
        self._handle.close()

    def __enter__(self) -> WebView:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it."""
        self.close()


def as_shown(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy for MuJoCo's own viewers: its collision shapes are in a group that these leave out, as cameras do."""
    shown = copy.copy(model)
    shown.geom_group[shown.geom_group == COLLISION_GROUP] = _NOT_SHOWN
    return shown


def _studio() -> dict[str, Any]:
    """The modules that are used, by name."""
    try:
        from mujoco.experimental.studio import launch_web, step_control, viewer_app, viewer_protocol, web_viewer
        from mujoco.experimental.studio.web import web_server
    except (ImportError, OSError) as error:
        raise UserError(
            f"MuJoCo {mujoco.__version__} has no web viewer here ({error}); it came with 3.17 and is experimental. "
            "`robocasa-lerobot gallery` makes pictures without it."
        ) from error
    return {
        "launch_web": launch_web,
        "step_control": step_control,
        "viewer_app": viewer_app,
        "viewer_protocol": viewer_protocol,
        "web_viewer": web_viewer,
        "web_server": web_server,
    }


@contextlib.contextmanager
def _loopback_only(studio: dict[str, Any]) -> Iterator[queue.Queue[int]]:
    """Meanwhile a viewer binds the loopback address and says nothing; the queue gets its port.

    Version 3.17 has no setting for that: its own comment asks for one.
    """
    bound: queue.Queue[int] = queue.Queue()
    server, viewer = studio["web_server"], studio["web_viewer"]
    bind, banner = server.bind_public_socket, viewer._print_url_banner

    def bind_loopback(host: str, port: int = 0) -> Any:
        return bind(_LOOPBACK, port)

    server.bind_public_socket = bind_loopback
    viewer._print_url_banner = lambda host, port: bound.put(port)
    try:
        yield bound
    finally:
        server.bind_public_socket, viewer._print_url_banner = bind, banner


def _port(bound: queue.Queue[int], handle: Any, asked: int) -> int:
    """The viewer's port, once it answers there."""
    port = 0
    for _ in range(int(_START_S / _POLL_S)):
        try:
            if not handle.is_running():
                break
            port = port or bound.get(timeout=_POLL_S)
            socket.create_connection((_LOOPBACK, port), timeout=_START_S).close()
            return port
        except queue.Empty:
            continue
        except ConnectionRefusedError:  # bound, and not listening yet
            time.sleep(_POLL_S)
        except (RuntimeError, OverflowError) as error:
            where = asked or "8080 and the next ones"
            raise UserError(f"the web viewer cannot listen at port {where}: {error}") from error
    raise UserError("MuJoCo's web viewer did not start within a minute.")
