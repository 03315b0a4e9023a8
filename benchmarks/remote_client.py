"""A process that asks a policy server as a worker of an evaluation does, and times it. Commands as in `peers/`."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent / "peers"))
sys.path.insert(0, str(Path(__file__).parents[1]))  # the package of this checkout

from sim_loop import answer_commands

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.remote.client import PolicyClient
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.key_map import ActionKey, CameraKey, KeyMap, PromptKey, StateKey
from robocasa_lerobot.evaluation.remote.probe import INSTRUCTION, observations
from robocasa_lerobot.evaluation.remote.translation import actions_of, request_of


class Client:
    """One connection; pictures are three of 256x256, sent as they are, or resized to `size` first."""

    def __init__(self) -> None:
        self._client: PolicyClient | None = None
        self._map = key_map(None)

    def hello(self) -> dict[str, Any]:
        """Ready."""
        return {}

    def connect(self, url: str, size: int | None = None) -> dict[str, Any]:
        """Connect, and ask a few times so that everything is warm."""
        self._client, self._map = connect(url), key_map(size)
        self._ask(20)
        return {}

    def requests(self, count: int) -> dict[str, Any]:
        """Milliseconds of each of so many requests, one after the other."""
        return {"milliseconds": self._ask(count)}

    def run(self, at: float, seconds: float) -> dict[str, Any]:
        """Requests answered from the instant `at` on, for so long."""
        time.sleep(max(0.0, at - time.perf_counter()))
        count = 0
        while time.perf_counter() < at + seconds:
            self._ask(1)
            count += 1
        return {"requests": count, "seconds": time.perf_counter() - at}

    def _ask(self, count: int) -> list[float]:
        assert self._client is not None
        seen, taken = observations(1, contract.IMAGE_SIZE), []
        for _ in range(count):
            started = time.perf_counter()
            answer = self._client.infer(request_of(self._map, seen, INSTRUCTION))
            actions_of(self._map, answer)
            taken.append(1000 * (time.perf_counter() - started))
        return taken


def key_map(size: int | None) -> KeyMap:
    """All that we have, under our own names; HDF5 order of actions."""
    return KeyMap(
        cameras=[CameraKey(f"images.{name}", name, [size, size] if size else None) for name in contract.CAMERAS],
        state=[StateKey("state", [part.name for part in contract.STATE_PARTS])],
        prompt=PromptKey("prompt"),
        actions=[ActionKey("actions", [part.name for part in contract.ACTION_PARTS_HDF5])],
        executed_steps=8,
    )


if __name__ == "__main__":
    client = Client()
    answer_commands(client.hello, client.connect, client.requests, client.run)
