"""Servers of policies in a thread of the test's process, and observations to ask them with."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.evaluation.actors.actor import ActingTime, Observation
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.serving.access import Access
from robocasa_lerobot.serving.host import Host
from robocasa_lerobot.serving.policy import Served, ServedPolicy
from robocasa_lerobot.serving.server import ServerSettings, serve

SIZE = 32  # of the pictures of `tiny_checkpoint`


@contextmanager
def serving(host: Host, protocol: str, token: str | None = None, **settings: Any) -> Iterator[int]:
    """A server on a free port of loopback; gives the port."""
    bound: queue.Queue[int | Exception] = queue.Queue()
    stopping: list[Any] = []

    async def run() -> None:
        stop = asyncio.Event()
        stopping.extend([asyncio.get_running_loop(), stop])
        await serve(host, ServerSettings(protocol, Access("127.0.0.1", 0, token), **settings), stop, bound.put)

    def main() -> None:
        try:
            asyncio.run(run())
        except Exception as error:
            bound.put(error)
            raise

    thread = threading.Thread(target=main)
    thread.start()
    try:
        port = bound.get(timeout=30)
        assert isinstance(port, int), port
        yield port
    finally:
        stopping[0].call_soon_threadsafe(stopping[1].set)
        thread.join(30)
        assert not thread.is_alive()
        assert host.close()


def observation(seed: int, size: int = SIZE) -> Observation:
    """As the env gives it, with random pictures and state."""
    rng = np.random.default_rng(seed)
    pixels = {camera: rng.integers(0, 256, (size, size, 3), dtype=np.uint8) for camera in contract.CAMERAS}
    return {"pixels": pixels, "agent_pos": rng.normal(size=contract.STATE_SIZE)}


def own_names(steps: list[Observation], instruction: str) -> dict[str, Any]:
    """Observations of consecutive steps by our own names."""
    pictures = {
        contract.image_key(camera): np.stack([one["pixels"][camera] for one in steps]) for camera in contract.CAMERAS
    }
    return {**pictures, contract.STATE_KEY: np.stack([one["agent_pos"] for one in steps]), "task": instruction}


def panda_omron_names(steps: list[Observation], instruction: str) -> dict[str, Any]:
    """The same by the names of RoboCasa365's GR00T fork."""
    pictures = {f"video.{camera}": np.stack([one["pixels"][camera] for one in steps]) for camera in contract.CAMERAS}
    state = contract.split_state(np.stack([one["agent_pos"] for one in steps]))
    parts = {f"state.{name}": values for name, values in state.items()}
    return {**pictures, **parts, "annotation.human.task_description": [instruction]}


def openpi_names(steps: list[Observation], instruction: str) -> dict[str, Any]:
    """The same by the names of RoboCasa365's openpi forks."""
    names = ("observation/image", "observation/right_image", "observation/wrist_image")
    pictures = {
        name: np.stack([one["pixels"][camera] for one in steps])
        for name, camera in zip(names, contract.CAMERAS, strict=True)
    }
    state = np.stack([one["agent_pos"] for one in steps])
    order = np.r_[7:10, 10:14, 0:3, 3:7, 14:16]  # end effector, base, gripper
    return {**pictures, "observation/state": state[:, order], "prompt": instruction}


class BlockedActor:
    """A policy that answers zeros when it is told to."""

    def __init__(self, begun: threading.Event, go: threading.Event) -> None:
        self.time = ActingTime()
        self._begun, self._go = begun, go

    def reset(self, seed: int, env: Any) -> None:
        """Nothing to forget."""

    def act(self, observation: Observation, instruction: str) -> np.ndarray:
        """Zeros, once `go` is set; "fail" raises, "nan" gives what is no action."""
        self._begun.set()
        assert self._go.wait(60)
        if instruction == "fail":
            raise ZeroDivisionError("the policy broke")
        value = np.nan if instruction == "nan" else 0.0
        return np.full(contract.ACTION_SIZE, value, dtype=np.float32)

    def sees(self, step: int) -> bool:
        """Never."""
        return False


def blocked_host(begun: threading.Event, go: threading.Event) -> Host:
    """A host of `BlockedActor`."""
    served = Served(PolicySource("blocked", "blocked", "blocked", "none"), (), 1, (0,), 1)
    return Host(ServedPolicy(served, None, lambda: BlockedActor(begun, go)))
