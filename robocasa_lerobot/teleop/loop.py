"""The clock of a session: 20 ticks a second in one thread, whatever clients do; scripts may go faster."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco

from robocasa_lerobot import contract
from robocasa_lerobot.teleop.messages import Message
from robocasa_lerobot.teleop.orders import carry_out
from robocasa_lerobot.teleop.session import DONE, RUNNING, Session
from robocasa_lerobot.teleop.telling import header

TICK_S = 1.0 / contract.CONTROL_HZ
STILL_S = 0.5  # between pictures of what does not move
_MOST_AT_ONCE = 256  # messages between two ticks
_MOST_LATE_S = 0.25  # that is caught up; beyond it, time is lost and the page says so


@dataclass(frozen=True)
class Event:
    """What has happened to the operator's connection: `joined` or `disconnected`."""

    what: str


SeenState = Callable[[mujoco.MjModel, mujoco.MjData], None]
Inbox = queue.SimpleQueue[Message | Event]


class Audience(Protocol):
    """Who takes pictures and messages; called from the session's thread."""

    def wants_frames(self) -> bool:
        """Whether somebody can take a picture now."""

    def sees_nothing(self) -> bool:
        """Whether the operator has shown no picture for too long, though one waits for it."""

    def frame(self, told: dict[str, Any], pictures: list[bytes]) -> None:
        """A picture message; `told` is its header."""

    def tell(self, message: dict[str, Any], map_jpeg: bytes | None) -> None:
        """A message for everybody; with a new scene its map."""


class ControlLoop:
    """Runs a session until it is done or stopped.

    Args:
        session: only this thread touches it.
        inbox: what clients say.
        audience: who is told.
        seen: is shown the state of each picture, if given.
    """

    def __init__(self, session: Session, inbox: Inbox, audience: Audience, seen: SeenState | None = None) -> None:
        self._session, self._inbox, self._audience, self._seen = session, inbox, audience, seen
        self._stop = threading.Event()

    def stop(self) -> None:
        """End after the present tick; from any thread or signal handler."""
        self._stop.set()

    def run(self) -> None:
        """Tick until the session is done or stopped; what is saved is merged in any case.

        Raises:
            UserError: the disk is full: the session has ended before its time, or its file could not be written.
        """
        session = self._session
        due, drawn = time.monotonic(), 0.0
        wanted = True
        try:
            while not self._stop.is_set():
                wanted |= self._listen(due)
                if session.clocked and self._audience.sees_nothing():
                    session.hold_still("stale")
                    wanted = True
                started = time.monotonic()
                stepping = session.phase == RUNNING
                moved = session.tick(started)
                wanted |= moved
                self._tell()
                now = time.monotonic()
                if (wanted or now - drawn >= STILL_S) and self._audience.wants_frames():
                    self._draw(now)
                    wanted, drawn = False, now
                if stepping and moved:
                    session.seconds.append(time.monotonic() - started)
                if session.phase == DONE:
                    break
                now = time.monotonic()
                due = min(max(due + TICK_S, now - _MOST_LATE_S), now + TICK_S)
        finally:
            session.finish()
            self._tell()
            self._draw(time.monotonic())
            session.close()
        if session.failure is not None:
            raise session.failure

    def _listen(self, due: float) -> bool:
        """Carry out what has been said, until the next tick is due; whether there was anything."""
        said = 0
        while not self._stop.is_set() and said < _MOST_AT_ONCE:
            left = 0.0 if self._session.hurries else due - time.monotonic()
            try:
                item = self._inbox.get(timeout=left) if left > 0 else self._inbox.get_nowait()
            except queue.Empty:
                break
            said += 1
            self._take(item)
            self._tell()
        return said > 0

    def _take(self, item: Message | Event) -> None:
        session = self._session
        if isinstance(item, Message):
            carry_out(session, item, time.monotonic())
        elif item.what == "disconnected":
            session.hold_still(item.what)
            session.driver.by_steps = False

    def _draw(self, now: float) -> None:
        number, parts = self._session.draw(now)
        if self._seen is not None and parts:
            self._seen(self._session.env.model, self._session.env.data)
        told = header(self._session, number, now)
        told["pictures"] = [what for what, _ in parts]
        self._audience.frame(told, [data for _, data in parts])

    def _tell(self) -> None:
        session = self._session
        told, session.outgoing = session.outgoing, []
        for message in told:
            self._audience.tell(message, session.map.jpeg if message["type"] == "scene" else None)
