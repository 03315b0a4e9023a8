"""A session of driving by hand without clock and socket: a test turns the clock."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from teleop_support import settings

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.teleop.driving.pilot import Pilot
from robocasa_lerobot.teleop.keeping.store import Store
from robocasa_lerobot.teleop.messages import parse
from robocasa_lerobot.teleop.orders import carry_out
from robocasa_lerobot.teleop.session import Session
from robocasa_lerobot.teleop.telling import header

TICK_S = 0.05


class Desk:
    """A session whose clock is turned by hand."""

    def __init__(
        self, store: Store, env: KitchenEnv, shown: Recording | None = None, pilot: Pilot | None = None
    ) -> None:
        self.session = Session(store.settings, store, env, pilot)
        self.now, self.told = 100.0, list[dict[str, Any]]()
        self._actions = [] if shown is None else list(contract.hdf5_to_stored(shown.actions))

    def say(self, kind: str, **fields: Any) -> None:
        carry_out(self.session, parse(json.dumps({"type": kind, **fields})), self.now)
        self._listen()

    def tick(self, times: int = 1) -> None:
        for _ in range(times):
            self.now += TICK_S
            self.session.tick(self.now)
            header(self.session, 1, self.now)  # what is told must be there in every phase
            self._listen()

    def until(self, phase: str) -> None:
        for _ in range(5):
            if self.session.phase != phase:
                self.tick()
        assert self.session.phase == phase, self.told[-3:]

    def hold(self, steps: int, **held: Any) -> None:
        for _ in range(steps):
            self.say("input", frame=0, **held)
            self.tick()

    def follow(self, steps: int) -> None:
        """Carry out the demonstrator's actions from where the episode is."""
        for _ in range(steps):
            episode = self.session.episode
            at = len(self._actions) if episode is None else len(episode)
            if self.session.phase not in ("ready", "running", "paused") or at >= len(self._actions):
                return
            self.say("action", frame=0, action=self._actions[at].tolist())
            if self.session.phase == "paused":
                self.say("resume")
            self.tick()

    def notes(self) -> list[str]:
        return [told["text"] for told in self.told if told["type"] == "note"]

    def _listen(self) -> None:
        self.told += self.session.outgoing
        self.session.outgoing.clear()


@contextlib.contextmanager
def desk(
    out: Path, env: KitchenEnv, shown: Recording | None = None, pilot: Pilot | None = None, **changes: Any
) -> Iterator[Desk]:
    with Store(settings(out, **changes)).held() as store:
        made = Desk(store, env, shown, pilot)
        made.until("ready")
        try:
            yield made
        finally:
            made.session._views.close()
