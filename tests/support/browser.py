"""A headless Chromium for tests, spoken to through its DevTools pipe; no driver and no network."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")


def find_chromium() -> str | None:
    """The path of a Chromium on this machine ($CHROMIUM first)."""
    return next(
        (path for name in (os.environ.get("CHROMIUM", ""), *NAMES) if name and (path := shutil.which(name))), None
    )


class Browser:
    """One page at a time: open it in a given width and theme, ask it things, photograph it."""

    def __init__(self, program: str, timeout_s: float = 120.0) -> None:
        self._timeout_s = timeout_s
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        commands_out, self._commands = os.pipe()
        self._answers, answers_in = os.pipe()

        def connect() -> None:
            # Chromium reads commands from descriptor 3 and writes answers to 4.
            high = os.dup2(commands_out, 100), os.dup2(answers_in, 101)
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        arguments = ["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions"]
        arguments += ["--disable-background-networking", "--disable-dev-shm-usage", "--hide-scrollbars"]
        arguments += ["--remote-debugging-pipe", f"--user-data-dir={self._profile.name}", "about:blank"]
        # Popen's own pipe must not become descriptor 3 or 4 of the child, which `connect` replaces.
        low = [os.open(os.devnull, os.O_RDONLY)]
        while low[-1] < 5:
            low.append(os.open(os.devnull, os.O_RDONLY))
        self._process = subprocess.Popen(
            [program, *arguments],
            pass_fds=(3, 4),
            preexec_fn=connect,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for descriptor in (commands_out, answers_in, *low):
            os.close(descriptor)
        self._buffer, self._number, self._session = b"", 0, ""
        self.messages: list[str] = []
        self.requests: list[str] = []
        self._loaded = False
        targets = self._send("Target.getTargets")["targetInfos"]
        target = next(t["targetId"] for t in targets if t["type"] == "page")
        self._session = self._send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._send(f"{domain}.enable")

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._commands)
        os.close(self._answers)
        self._profile.cleanup()

    def open(self, page: Path | str, width: int = 1280, height: int = 900, dark: bool = False) -> None:
        """Load a file or address; `messages` are then what its console said, `requests` what it asked for as well."""
        self.messages, self.requests, self._loaded = [], [], False
        self.theme(dark)
        self._send(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        self._send("Page.navigate", url=page.resolve().as_uri() if isinstance(page, Path) else page)
        deadline = time.monotonic() + self._timeout_s
        while not self._loaded:
            self._read(deadline)

    def theme(self, dark: bool) -> None:
        """Have the system ask for dark or light pages; a page that is open follows."""
        theme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self._send("Emulation.setEmulatedMedia", features=theme)

    def ask(self, expression: str) -> Any:
        """The value of a JavaScript expression."""
        answer = self._send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def until(self, expression: str, timeout_s: float = 60.0) -> Any:
        """The value of a JavaScript expression as soon as it is true; asked for ten times a second."""
        deadline = time.monotonic() + timeout_s
        while not (value := self.ask(expression)):
            assert time.monotonic() < deadline, f"not within {timeout_s:g} s: {expression}; console: {self.messages}"
            time.sleep(0.1)
        return value

    def before_load(self, script: str) -> None:
        """Run a script in every page before its own."""
        self._send("Page.addScriptToEvaluateOnNewDocument", source=script)

    def key(self, code: str, down: bool, key: str = "", repeat: bool = False) -> None:
        """Press or let go of a key, named by its place (`KeyW`, `Space`)."""
        kind = "keyDown" if down else "keyUp"
        self._send(
            "Input.dispatchKeyEvent", type=kind, code=code, key=key or code.removeprefix("Key"), autoRepeat=repeat
        )

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """`mousePressed`, `mouseMoved`, `mouseReleased` (left button) or `mouseWheel` with `deltaY`."""
        held = (
            {} if kind == "mouseWheel" else {"button": "left", "buttons": int(kind != "mouseReleased"), "clickCount": 1}
        )
        self._send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held, **more)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """`touchStart`, `touchMove` or `touchEnd` with the fingers that are down."""
        self._send("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in points])

    def with_focus(self, on: bool = True) -> None:
        """Have pages believe that their window has the keys, as no window of a headless browser does."""
        self._send("Emulation.setFocusEmulationEnabled", enabled=on)

    def box(self, selector: str) -> tuple[float, float, float, float]:
        """Left, top, width and height of an element, CSS pixels of the window."""
        asked = (
            f"(r => [r.left, r.top, r.width, r.height])(document.querySelector({selector!r}).getBoundingClientRect())"
        )
        left, top, width, height = self.ask(asked)
        return left, top, width, height

    def screenshot(self, path: Path, top: int = 0, height: int | None = None) -> None:
        """The page from `top` for `height` pixels (default: to its end) as PNG."""
        size = self._send("Page.getLayoutMetrics")["cssContentSize"]
        high = size["height"] - top if height is None else min(height, size["height"] - top)
        clip = {"x": 0, "y": top, "width": size["width"], "height": max(1, high), "scale": 1}
        data = self._send("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)["data"]
        path.write_bytes(base64.b64decode(data))

    def _send(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + self._timeout_s
        while True:
            answer = self._read(deadline)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                result: dict[str, Any] = answer["result"]
                return result

    def _read(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            assert time.monotonic() < deadline, "Chromium does not answer"
            part = os.read(self._answers, 1 << 20)
            assert part, "Chromium has ended"
            self._buffer += part
        line, self._buffer = self._buffer.split(b"\0", 1)
        message: dict[str, Any] = json.loads(line)
        self._note(message.get("method", ""), message.get("params", {}))
        return message

    def _note(self, method: str, values: dict[str, Any]) -> None:
        if method == "Page.loadEventFired":
            self._loaded = True
        elif method == "Runtime.exceptionThrown":
            self.messages.append(f"exception: {values['exceptionDetails'].get('text')}")
        elif method == "Runtime.consoleAPICalled":
            self.messages.append(f"{values['type']}: {values['args']}")
        elif method == "Log.entryAdded":
            self.messages.append(f"{values['entry']['level']}: {values['entry']['text']}")
        elif method == "Network.requestWillBeSent":
            url = values["request"]["url"]
            if not url.startswith(("data:", "blob:")) and values.get("type") != "Document":
                self.requests.append(url)
