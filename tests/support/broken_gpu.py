"""Policy servers on a stand-in for a GPU, which fails in the first process, and after that at every call there."""

from __future__ import annotations

from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from robocasa_lerobot.evaluation.actors.chunk_policy import ChunkPolicy, LoadedCheckpoint
from robocasa_lerobot.evaluation.run import policy_server
from robocasa_lerobot.evaluation.run.messages import ServerSettings

FOLDER = "BROKEN_GPU"  # variable of a folder in which each server's process leaves a file


class OnCpu(LoadedCheckpoint):
    """A checkpoint that is told to be on a GPU."""

    def __init__(self, source: Any, device: str, executed_steps: int | None) -> None:
        super().__init__(source, "cpu", executed_steps)


def server_main(parent: Connection, settings: ServerSettings, environment: dict[str, str]) -> None:
    """The engine's server in a process of its own, in which alone all of this is replaced."""
    import torch

    marks = Path(environment[FOLDER])
    number = len(list(marks.iterdir()))
    (marks / str(number)).touch()
    predict = ChunkPolicy.predict

    def synchronize(device: Any = None) -> None:
        if number == 0:
            raise RuntimeError("CUDA error: an illegal memory access was encountered")

    def predict_on_gpu(policy: ChunkPolicy, requests: Any) -> Any:
        synchronize()
        return predict(policy, requests)

    torch.cuda.synchronize = synchronize
    ChunkPolicy.predict = predict_on_gpu  # type: ignore[method-assign]
    policy_server.LoadedCheckpoint = OnCpu  # type: ignore[misc]
    policy_server.server_main(parent, settings, environment)
