"""Pieces of a long work on Ray, each in a worker process that ends with it; markers of completion are datatrove's.

datatrove's own Ray executor runs a piece in a daemonic process, which may not start processes of its own (a recording
on two cores does), and only logs that a piece failed.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import RaySettings
from robocasa_lerobot.jobs.pool import PoolExecutor

_GIB = 2**30
_SHOWN = 3


def run_with_ray(step: Callable[..., None], pieces: int, folder: Path, settings: RaySettings) -> None:
    """Run all pieces that are not complete, and wait for them; one that fails does not keep the others from ending.

    The cluster is the one at `RAY_ADDRESS`, or one that runs on this machine; where there is neither, Ray is started
    here, on loopback addresses, for as long as this process lives.

    Args:
        step: datatrove's step for one piece.
        pieces: their number.
        folder: for completion markers, on a file system that the nodes share.
        settings: what a piece asks for, and how many may run at a time.

    Raises:
        UserError: pieces failed, or ask for more than any node has; the causes are named.
    """
    import ray

    executor = PoolExecutor(pipeline=[step], tasks=pieces, workers=1, logging_dir=str(folder))
    waiting = list(executor.get_incomplete_ranks())
    if not waiting:
        return
    _connect()
    memory = settings.cpus * settings.mem_per_cpu_gb * _GIB
    _check_node(settings, memory)
    # A new worker process for each piece: OpenGL, torch and the pieces' own processes are not handed on.
    remote = ray.remote(num_cpus=settings.cpus, memory=memory, max_calls=1, max_retries=0)(_run_piece)
    shared = ray.put(executor)
    running: dict[Any, int] = {}
    failed: dict[int, str] = {}
    while waiting or running:
        while waiting and (settings.jobs < 1 or len(running) < settings.jobs):
            rank = waiting.pop(0)
            running[remote.options(name=f"piece {rank}").remote(shared, rank)] = rank
        for reference in ray.wait(list(running), num_returns=1)[0]:
            rank = running.pop(reference)
            try:
                ray.get(reference)
            except Exception as error:  # what a piece raises comes as an error that has the type of both
                failed[rank] = str(getattr(error, "cause", None) or error).strip()
    if failed:
        shown = "\n".join(f"piece {rank}: {failed[rank]}" for rank in sorted(failed)[:_SHOWN])
        raise UserError(f"{len(failed)} of {pieces} pieces failed with Ray; the same command runs them again.\n{shown}")


def _run_piece(executor: PoolExecutor, rank: int) -> None:
    executor.run_rank(rank)


def _connect() -> None:
    """Use the cluster that there is, or start Ray here."""
    import ray

    if ray.is_initialized():
        return
    quiet: dict[str, Any] = {"logging_level": "warning"}
    if "RAY_ADDRESS" in os.environ:
        ray.init(**quiet)
        return
    with contextlib.suppress(ConnectionError):
        ray.init(address="auto", **quiet)
        return
    ray.init(address="local", include_dashboard=False, _node_ip_address="127.0.0.1", **quiet)


def _check_node(settings: RaySettings, memory: int) -> None:
    """Ray waits for ever where no node is large enough."""
    import ray

    nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    if any(node.get("CPU", 0) >= settings.cpus and node.get("memory", 0) >= memory for node in nodes):
        return
    found = "; ".join(f"{node.get('CPU', 0):g} cores and {node.get('memory', 0) / _GIB:.1f} GiB" for node in nodes)
    raise UserError(
        f"no node of the Ray cluster is large enough for a piece: it asks for {settings.cpus} cores and "
        f"{memory / _GIB:.0f} GiB, found {found}. Give fewer --ray.cpus, or less --ray.mem_per_cpu_gb."
    )
