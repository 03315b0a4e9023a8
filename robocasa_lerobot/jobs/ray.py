"""Pieces of a long work on Ray, each in a worker process that ends with it; markers of completion are datatrove's.

datatrove's own Ray executor runs a piece in a daemonic process, which may not start processes of its own (a recording
on two cores does), and only logs that a piece failed.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import RaySettings
from robocasa_lerobot.jobs.pool import PoolExecutor

_GIB = 2**30
_SHOWN = 3
_OUR_VARIABLES = ("ROBOCASA_LEROBOT_", "MUJOCO_", "HF_")


def run_with_ray(
    step: Callable[..., None], pieces: int, folder: Path, settings: RaySettings, *, skip_complete: bool = True
) -> None:
    """Run all pieces that are not complete, and wait for them; one that fails does not keep the others from ending.

    The cluster is the one at `RAY_ADDRESS`, or one that runs on this machine; where there is neither, Ray is started
    here, on loopback addresses, for as long as this process lives.

    Args:
        step: datatrove's step for one piece.
        pieces: their number.
        folder: for completion markers, on a file system that the nodes share.
        settings: what a piece asks for, and how many may run at a time.
        skip_complete: False runs all pieces, for steps that find out themselves what is left of theirs.

    Raises:
        UserError: pieces failed, or ask for more than any node has; the causes are named.
    """
    import ray

    executor = PoolExecutor(
        pipeline=[step], tasks=pieces, workers=1, logging_dir=str(folder), skip_completed=skip_complete
    )
    waiting = list(executor.get_incomplete_ranks())
    if not waiting:
        return
    _connect()
    memory = settings.cpus * settings.mem_per_cpu_gb * _GIB
    _check_node(settings, memory)
    # A new worker process for each piece: OpenGL, torch and the pieces' own processes are not handed on.
    asked = {"num_cpus": settings.cpus, "num_gpus": settings.gpus, "memory": memory}
    secret, told = _handed_on()
    remote = ray.remote(**asked, max_calls=1, max_retries=0, runtime_env={"env_vars": told})(_run_piece)
    shared, here = ray.put(executor), str(Path.cwd())
    running: dict[Any, int] = {}
    failed: dict[int, str] = {}
    while waiting or running:
        while waiting and (settings.jobs < 1 or len(running) < settings.jobs):
            rank = waiting.pop(0)
            running[remote.options(name=f"piece {rank}").remote(shared, rank, here, secret)] = rank
        for reference in ray.wait(list(running), num_returns=1)[0]:
            rank = running.pop(reference)
            try:
                ray.get(reference)
            except Exception as error:  # what a piece raises comes as an error that has the type of both
                failed[rank] = str(getattr(error, "cause", None) or error).strip()
    if failed:
        shown = "\n".join(f"piece {rank}: {failed[rank]}" for rank in sorted(failed)[:_SHOWN])
        raise UserError(f"{len(failed)} of {pieces} pieces failed with Ray; the same command runs them again.\n{shown}")


def _handed_on() -> tuple[dict[str, str], dict[str, str]]:
    """Variables of the command that its pieces need: a cluster's processes have those with which Ray was started.

    Tokens come apart from the others, which Ray shows to everybody.
    """
    wanted = {name: value for name, value in os.environ.items() if name.startswith(_OUR_VARIABLES)}
    secret = {name: value for name, value in wanted.items() if "TOKEN" in name}
    return secret, {name: value for name, value in wanted.items() if name not in secret}


def _run_piece(executor: PoolExecutor, rank: int, folder: str, secret: Mapping[str, str]) -> None:
    """Run a piece in the folder in which the command was given: that of a cluster is where Ray was started."""
    os.environ.update(secret)
    try:
        os.chdir(folder)
    except OSError as error:
        raise UserError(
            f"the node {socket.gethostname()} has no folder {folder} ({error.strerror}): give the command in a folder "
            "that all nodes share."
        ) from None
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

    asked = {"CPU": settings.cpus, "memory": memory, "GPU": settings.gpus}
    nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    if any(all(node.get(name, 0) >= amount for name, amount in asked.items()) for node in nodes):
        return
    raise UserError(
        f"no node of the Ray cluster is large enough for a piece: it asks for {_in_words(asked)}, found "
        f"{'; '.join(map(_in_words, nodes))}. Give fewer --ray.cpus or --ray.gpus, or less --ray.mem_per_cpu_gb."
    )


def _in_words(resources: Mapping[str, float]) -> str:
    """What a piece asks for or a node has, in Ray's names."""
    cores, gpus, memory = (resources.get(name, 0) for name in ("CPU", "GPU", "memory"))
    return f"{cores:g} cores and {memory / _GIB:.4g} GiB" + (f" and {gpus:g} GPU(s)" if gpus else "")
