"""The operator's page in a real browser, beside the session that it drives."""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from urllib.parse import urlsplit

import mujoco
import numpy as np
from browser import Browser, find_chromium
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from teleop_support import WAIT_S, served

from robocasa_lerobot.envs.robots.panda_omron.names import GRIP_SITE
from robocasa_lerobot.teleop.session import Session
from robocasa_lerobot.teleop.settings import TeleopSettings

# A gamepad that tests move: `pad.axes`, `pad.buttons`. Stands in for hardware, and for nothing of ours.
FAKE_GAMEPAD = """
window.pad = {id: "test pad", index: 0, connected: false, mapping: "standard", axes: [0, 0, 0, 0],
              buttons: Array.from({length: 17}, () => ({pressed: false, touched: false, value: 0}))};
navigator.getGamepads = () => [window.pad.connected ? window.pad : null, null, null, null];
"""
CODES = {"Space": " ", "Backspace": "Backspace", "Enter": "Enter"}
# After which a gesture that shows nothing is made again, as people do: on a busy machine the page lets go of everything
# where a picture is late, which is what it is for.
AGAIN_S = 5.0
CLICKS = 3  # without an effect, after which the browser is started again between tests


class Page:
    """A page that drives a session; what it shows, and what is true of the simulation."""

    def __init__(self, browser: Browser, session: Session, line: Line, again: Callable[[], Browser]) -> None:
        self.browser, self.session, self.line, self._again = browser, session, line, again

    @property
    def phase(self) -> str:
        """As the page shows it."""
        return str(self.browser.ask("document.body.dataset.phase"))

    @property
    def late(self) -> bool:
        """Whether time stands since a picture was late."""
        return self.session.phase == "paused" and self.session.pause == "stale"

    @property
    def offers_to_go_on(self) -> bool:
        """Whether the button over the pictures is there."""
        return bool(self.browser.ask("document.querySelector('#veil-button').checkVisibility()"))

    @property
    def hand(self) -> NDArray[np.float64]:
        """The grip site in the world, from the simulation."""
        data: mujoco.MjData = self.session.env.data
        return np.array(data.site(GRIP_SITE).xpos)

    def told(self) -> str:
        """What page and session are at, for who reads of a failure."""
        at = self.browser.ask(
            "[document.body.dataset.phase, document.body.dataset.locked, document.querySelector('dialog[open]')?.id,"
            "document.activeElement.id, document.querySelector('#g-step').textContent, innerHeight, scrollY,"
            "JSON.stringify(document.querySelector('#redo').getBoundingClientRect()), "
            "(r => document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2)?.outerHTML.slice(0, 200))"
            "(document.querySelector('#redo').getBoundingClientRect())]"
        )
        return f"page {at}, session {self.session.phase}, {self.session.pause}, {self.browser.messages}"

    def text(self, selector: str) -> str:
        """What an element says."""
        return str(self.browser.ask(f"document.querySelector({selector!r}).textContent"))

    def click(self, selector: str) -> None:
        """With the mouse, in the middle of an element."""
        left, top, width, height = self.browser.box(selector)
        self.click_at(left + width / 2, top + height / 2)

    def click_at(self, x: float, y: float) -> None:
        """With the mouse, CSS pixels of the window."""
        for kind in ("mousePressed", "mouseReleased"):
            self.browser.mouse(kind, x, y)

    def until(self, phase: str) -> None:
        """Wait for a phase; for time to run also where a picture is late meanwhile."""
        deadline = time.monotonic() + WAIT_S
        while self.phase != phase:
            assert time.monotonic() < deadline, f"not {phase}: {self.told()}"
            if phase == "running":
                self.go_on()
            time.sleep(0.1)

    def steps(self, count: int) -> None:
        """Wait until so many more control steps have been carried out."""
        episode = self.session.driven
        last = len(episode) + count
        self.wait(lambda: len(episode) >= last)

    def gesture(self, begin: Callable[[], object], end: Callable[[], object], shows: Callable[[], Any]) -> Any:
        """Begin something and go on until it shows, however long commands take here; then end it. What it showed."""
        deadline = time.monotonic() + WAIT_S
        shown = None
        while not shown:
            assert time.monotonic() < deadline, f"nothing to be seen of it: {self.told()}"
            self.go_on()
            begin()
            try:
                again = time.monotonic() + AGAIN_S
                while not (shown := shows()) and time.monotonic() < again and not self.late:
                    time.sleep(0.01)
            finally:
                end()
        return shown

    def answer(self, x: float, y: float, expression: str) -> Any:
        """Click until a JavaScript expression is true; its value."""
        return self.gesture(lambda: self.click_at(x, y), lambda: None, lambda: self.browser.ask(expression))

    def wait(self, shows: Callable[[], object]) -> None:
        """Wait until something shows; where time stands since a picture was late, it is run again."""
        deadline = time.monotonic() + WAIT_S
        while not shows():
            assert time.monotonic() < deadline, f"nothing to be seen of it: {self.told()}"
            self.go_on()
            time.sleep(0.01)

    def go_on(self) -> None:
        """Where time stands since a picture was late, have it run; and again where one is late meanwhile."""
        deadline, again = time.monotonic() + WAIT_S, 0.0
        while self.late:
            assert time.monotonic() < deadline, f"it does not go on: {self.told()}"
            # Asked and clicked in one: a mouse might hit the picture behind a button that has gone meanwhile.
            if time.monotonic() > again and self.browser.ask(
                "(b => b.checkVisibility() && (b.click(), true))(document.querySelector('#veil-button'))"
            ):
                again = time.monotonic() + AGAIN_S
            time.sleep(0.05)

    def hold_until(self, code: str, shows: Callable[[], object]) -> None:
        """Hold a key until what it is for shows."""
        key = CODES.get(code, "")
        self.gesture(lambda: self.browser.key(code, True, key), lambda: self.browser.key(code, False, key), shows)

    def rest(self) -> NDArray[np.float64]:
        """Wait until the hand stands still; where."""
        deadline = time.monotonic() + WAIT_S
        while True:
            before = self.hand
            self.steps(4)
            if np.abs(self.hand - before).max() < 0.004:
                return self.hand
            assert time.monotonic() < deadline, "the hand never comes to rest"

    def hold(self, code: str, steps: int) -> None:
        """Hold a key for so many control steps."""
        episode = self.session.driven
        last = len(episode) + steps
        self.hold_until(code, lambda: len(episode) >= last)

    def pad(self, axes: list[float] | None = None, **pressed: float) -> None:
        """Put the gamepad's sticks and buttons (`b7=0.5`) somewhere."""
        buttons = {int(name[1:]): value for name, value in pressed.items()}
        self.browser.ask(
            f"pad.connected = true, pad.axes = {json.dumps(axes or [0, 0, 0, 0])},"
            f"pad.buttons.forEach((b, i) => {{ b.value = {json.dumps(buttons)}[i] ?? 0; b.pressed = b.value > 0.5; }})"
        )

    def fresh(self) -> None:
        """The same kitchen from its start, with nothing held."""
        if self.phase == "ready":
            return
        scenes, clicks = self.session.scenes, 0
        deadline, again = time.monotonic() + WAIT_S, 0.0
        while self.session.scenes == scenes or self.phase != "ready":
            assert time.monotonic() < deadline, f"no fresh kitchen: {self.told()}"
            if self.browser.ask("document.querySelector('#leave-dialog').open"):
                self.click("#leave-ok")
            elif self.session.scenes == scenes and time.monotonic() > again:
                if clicks == CLICKS:
                    # Seen after a drag, in one of some twenty runs: no mouse reaches a page loaded anew either.
                    warnings.warn(f"the browser was started again: {self.told()}", stacklevel=2)
                    self.browser = self._again()
                    self.browser.until("['running', 'paused', 'review'].includes(document.body.dataset.phase)", WAIT_S)
                self.click("#redo" if self.phase not in ("review", "saving") else "#review-redo")
                clicks += 1
                again = time.monotonic() + AGAIN_S
            time.sleep(0.05)


class Line:
    """A line between browser and server whose bytes arrive `delay_s` later, for as long as that is set.

    Chromium's own emulation of slow networks leaves WebSockets alone.
    """

    def __init__(self, port: int) -> None:
        self.delay_s = 0.0
        self._port = port
        self._open: list[socket.socket] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        threading.Thread(target=self._listen, daemon=True).start()

    def close(self) -> None:
        """No further connections; those that are there end with their sides."""
        self._listener.close()

    def cut(self) -> None:
        """End all connections that there are."""
        for one in self._open:
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        self._open.clear()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._port))
                self._open += [near, far]
                for source, target in ((near, far), (far, near)):
                    sent: queue.Queue[tuple[float, bytes]] = queue.Queue()
                    threading.Thread(target=self._take, args=(source, sent), daemon=True).start()
                    threading.Thread(target=self._give, args=(target, sent), daemon=True).start()

    def _take(self, source: socket.socket, sent: queue.Queue[tuple[float, bytes]]) -> None:
        data = b"-"
        while data:
            try:
                data = source.recv(1 << 16)
            except OSError:
                data = b""
            sent.put((time.monotonic() + self.delay_s, data))

    def _give(self, target: socket.socket, sent: queue.Queue[tuple[float, bytes]]) -> None:
        with contextlib.suppress(OSError):
            while True:
                at, data = sent.get()
                time.sleep(max(0.0, at - time.monotonic()))
                if not data:
                    target.shutdown(socket.SHUT_WR)
                    return
                target.sendall(data)


@contextmanager
def driven_page(settings: TeleopSettings, policy: str = "", **window: Any) -> Iterator[Page]:
    """A session that is served, and a page of it that is ready to drive."""
    program = find_chromium()
    assert program is not None
    with ExitStack() as running, served(settings, policy=policy) as session:
        address = urlsplit(session.address)
        assert address.port is not None
        line = Line(address.port)

        def start() -> Browser:
            running.pop_all().close()
            browser = running.enter_context(Browser(program))
            browser.with_focus()
            browser.before_load(FAKE_GAMEPAD)
            browser.open(session.address.replace(str(address.port), str(line.port), 1), **window)
            return browser

        page = Page(start(), session._loop._session, line, start)
        page.until("ready")
        yield page
        line.close()


def middle_of(seen: NDArray[np.bool_]) -> tuple[int, int]:
    """Row and column that are farthest from what is not `seen`."""
    depth = distance_transform_edt(np.pad(seen, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(int(depth.argmax()), seen.shape)
    assert depth[row, column] > 2, "too little of it is to be seen"
    return int(row), int(column)
