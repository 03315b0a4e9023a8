"""The batches of a phase, loaded here or by processes of their own, which outlive what asks this one to end."""

from __future__ import annotations

import pickle
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import popen_spawn_posix, resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from typing import Any

import torch

from robocasa_lerobot.data.mixture import StepBatches
from robocasa_lerobot.jobs.child_process import STOP_SIGNALS


def load_batches(batches: StepBatches, first: int, end: int, workers: int) -> Iterator[dict[str, Any]]:
    """Batches number `first` to `end` - 1 in their order, ahead of their use by so many processes.

    A signal often goes to every process of a job: from `timeout`, a cluster, an elastic launcher. The processes do
    not take it, so that there are batches until this one has saved.
    """
    loader = torch.utils.data.DataLoader(
        InFile(batches) if workers else batches,
        batch_size=None,  # an item is a whole batch
        sampler=range(first, end),
        num_workers=workers,
        prefetch_factor=2 if workers else None,
        multiprocessing_context=_LoaderContext() if workers else None,
        pin_memory=torch.cuda.is_available(),
    )
    if not workers:
        return iter(loader)
    with _deaf_children():
        return iter(loader)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes that are started inside do not take our signals: blocked ones are, from their first moment on."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        resource_tracker.ensure_running()  # multiprocessing's own, which unblocks SIGTERM here as it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class InFile(torch.utils.data.Dataset[dict[str, Any]]):
    """Batches that travel to other processes as a file.

    A pipe takes 64 KiB; what starts a process waits until that has imported everything and read the rest, and with it
    those that are to be started next: eight took 100 seconds here.
    """

    def __init__(self, batches: StepBatches) -> None:
        self._batches = batches
        self._folder = tempfile.TemporaryDirectory(prefix="robocasa_lerobot_")
        self._file = Path(self._folder.name) / "batches.pickle"
        self._file.write_bytes(pickle.dumps(batches))

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self._batches[index]

    def __getstate__(self) -> Path:
        return self._file

    def __setstate__(self, file: Path) -> None:
        self._batches = pickle.loads(file.read_bytes())


class _Popen(popen_spawn_posix.Popen):
    def terminate(self) -> None:
        """End one that hangs, or is left at the end of this process: SIGTERM would not, and be waited for for ever."""
        self.kill()


class _LoaderProcess(SpawnProcess):
    @staticmethod
    def _Popen(process_obj: Any) -> _Popen:  # noqa: N802  multiprocessing's name
        return _Popen(process_obj)


class _LoaderContext(SpawnContext):
    """New interpreters, because forked video decoders can hang."""

    Process = _LoaderProcess
