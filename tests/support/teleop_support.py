"""Sessions of driving by hand for tests: served in a thread, and the actions of a demonstrator for them."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import Recording, record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.teleop.client import TeleopClient
from robocasa_lerobot.teleop.loop import ControlLoop
from robocasa_lerobot.teleop.run import Outcome, Place, run_session
from robocasa_lerobot.teleop.server import TeleopServer
from robocasa_lerobot.teleop.settings import TeleopSettings

TASK, SPLIT, SEED = "CloseDrawer", "target", 100_002
WAIT_S = 120.0


class Served:
    """A session that runs in a thread."""

    def __init__(self, address: str, loop: ControlLoop) -> None:
        self.address, self._loop = address, loop
        self.outcome: Outcome | None = None

    def stop(self) -> None:
        """As Ctrl+C does."""
        self._loop.stop()


@contextmanager
def served(settings: TeleopSettings, *, policy: str = "", free_view: bool = False) -> Iterator[Served]:
    """Serve a session; it is stopped at the end, and what it raised is raised here."""
    ready: queue.Queue[Served | BaseException] = queue.Queue()
    place = Place()
    handle: list[Served] = []

    def announce(server: TeleopServer, loop: ControlLoop) -> None:
        handle.append(Served(server.address, loop))
        ready.put(handle[0])

    failures: list[BaseException] = []

    def work() -> None:
        try:
            outcome = run_session(settings, place, announce, policy=policy, device="cpu", free_view=free_view)
            handle[0].outcome = outcome
        except BaseException as error:
            failures.append(error)
            ready.put(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        begun = ready.get(timeout=WAIT_S)
        if isinstance(begun, BaseException):
            raise begun
        yield begun
        begun.stop()
    finally:
        if handle:
            handle[0].stop()
        thread.join(WAIT_S)
    if failures:
        raise failures[0]


def settings(out: Path, **changes: Any) -> TeleopSettings:
    """One drawer to close, in small pictures."""
    values = {"task": TASK, "out": out, "split": SPLIT, "seed": SEED, "episodes": 1, "image_size": 48}
    return TeleopSettings(**{**values, **changes})


def demonstration(seed: int = SEED) -> Recording:
    """What the recorder makes of the demonstrator in the kitchen of a seed."""
    env = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    try:
        recording = record_episode(env, seed)
    finally:
        env.close()
    assert recording.success, recording.reason
    return recording


def drive(client: TeleopClient, actions: np.ndarray, *, first: int = 0) -> None:
    """Send actions (n, 12) in HDF5 order, one for each step that has been carried out since `first`."""
    stored = contract.hdf5_to_stored(actions)
    client.send("clock", clock="steps")
    sent, last = 0, first + len(stored)
    while client.frame.get("phase") != "review" and client.frame.get("step") != last:
        carried = client.frame.get("step", first) - first
        while sent < min(len(stored), carried + 40):
            client.send("action", action=[float(number) for number in stored[sent]])
            sent += 1
        client.receive(WAIT_S)


def saved_demo(path: Path, demo: str = "demo_0") -> dict[str, np.ndarray]:
    """All arrays of a demonstration in a file, by their path below it."""
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file[f"data/{demo}"].visititems(
            lambda name, item: found.__setitem__(name, item[()]) if isinstance(item, h5py.Dataset) else None
        )
    return found
