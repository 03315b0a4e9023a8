"""Memory that two processes share, through which one hands pictures to the other without copying them into a pipe.

Nobody else can see the memory, and it is gone when both processes are, however they end. What has been taken out is
told through a pipe, one byte for each picture: neither process needs a lock, or a thread that waits.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import select
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.anonymous_file import anonymous_file

# The largest picture that goes through; memory is taken only where pictures have been.
_MAX_BYTES = 1 << 30
_MOST_WAITING = 4096  # so many bytes fit into any pipe
AHEAD_BYTES = 24 << 20  # pictures that wait, unless a single one is larger


class FrameSender:
    """The end into which pictures are put. Give `descriptors` to the other process, then call `others_only`.

    Raises:
        OSError: the system has no such memory, or does not let files grow.
    """

    def __init__(self, ahead_bytes: int = AHEAD_BYTES) -> None:
        self._ahead = ahead_bytes
        self._file = anonymous_file("pictures")
        try:
            os.ftruncate(self._file, _MAX_BYTES)
        except OSError:
            os.close(self._file)
            raise
        self._memory = mmap.mmap(self._file, _MAX_BYTES)
        self._taken, self._taken_there = os.pipe()
        os.set_blocking(self._taken, False)
        self._waiting: deque[tuple[int, int]] = deque()  # first byte of each picture, and the one after its last

    @property
    def descriptors(self) -> tuple[int, int]:
        """File descriptors from which the other process makes its `FrameReceiver`."""
        return self._file, self._taken_there

    def others_only(self) -> None:
        """Let go of what only the other process needs, so that its end is noticed."""
        os.close(self._file)
        os.close(self._taken_there)

    def put(self, picture: NDArray[np.uint8]) -> int:
        """Copy a picture into the memory, waiting for room; gives its place.

        Raises:
            BrokenPipeError: the other process is gone.
            ValueError: it is larger than the memory.
        """
        size = picture.nbytes
        if size > _MAX_BYTES:
            raise ValueError(f"a picture of {size} bytes; at most {_MAX_BYTES} can be handed over.")
        self._collect()
        while (start := self._room(size)) is None:
            select.select([self._taken], [], [])
            self._collect()
        if size:
            np.frombuffer(self._memory, np.uint8, size, start).reshape(picture.shape)[...] = picture
        self._waiting.append((start, start + size))
        return start

    def close(self) -> None:
        """Let go of the memory."""
        os.close(self._taken)
        with contextlib.suppress(BufferError):  # an array of it is still looked at: it goes with that
            self._memory.close()

    def _collect(self) -> None:
        """Forget the pictures that have been taken."""
        try:
            done = os.read(self._taken, _MOST_WAITING)
        except BlockingIOError:
            return
        if not done:
            raise BrokenPipeError("the process that takes pictures is gone")
        for _ in done:
            self._waiting.popleft()

    def _room(self, size: int) -> int | None:
        """Where a picture can be put now; None where the oldest ones must be taken first."""
        if not self._waiting:
            return 0
        if len(self._waiting) == _MOST_WAITING:
            return None
        first, end = self._waiting[0][0], self._waiting[-1][1]
        if end <= first:  # those behind the oldest have begun again at the front
            return end if end + size <= first else None
        if end + size <= max(self._ahead, size):
            return end
        return 0 if size <= first else None


class FrameReceiver:
    """The end out of which pictures are taken.

    Args:
        memory: file descriptor of the memory.
        taken: file descriptor of the pipe that tells what has been taken.
    """

    def __init__(self, memory: int, taken: int) -> None:
        self._memory = mmap.mmap(memory, _MAX_BYTES, prot=mmap.PROT_READ)
        os.close(memory)
        self._taken = taken

    @contextlib.contextmanager
    def taken(self, start: int, shape: tuple[int, ...]) -> Iterator[NDArray[np.uint8]]:
        """The picture at a place, to be read within the block; afterwards its place is given back."""
        yield np.frombuffer(self._memory, np.uint8, int(np.prod(shape)), start).reshape(shape)
        os.write(self._taken, b"\0")
