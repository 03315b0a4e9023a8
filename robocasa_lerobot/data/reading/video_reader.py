"""Pictures out of videos, with a bounded number of files open: a file opened once is not opened for each sample."""

from __future__ import annotations

import bisect
from collections import OrderedDict
from pathlib import Path
from typing import Any

import av
import numpy as np
import torch
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError

_TOLERANCE_S = 1e-4  # LeRobot's tolerance between the asked and the decoded time


class VideoReader:
    """Decodes single pictures; the files used last stay open, at most `max_open`."""

    def __init__(self, max_open: int) -> None:
        self.max_open = max_open
        self._open: OrderedDict[Path, Any] = OrderedDict()

    def __len__(self) -> int:
        """Number of files that are open."""
        return len(self._open)

    def frames(self, path: Path, times: NDArray[np.float64]) -> torch.Tensor:
        """The pictures at `times` (n,), in seconds, of any order and with repeats: uint8 (n, 3, height, width).

        Decoded as LeRobot's PyAV reader does, to equal bytes, and left in the order of the decoder's: each pixel's
        colours together.

        Raises:
            UserError: the file cannot be read, or has no picture at one of the times.
        """
        wanted = sorted({float(t) for t in times})
        try:
            found = self._decode(path, wanted)
        except (OSError, IndexError, av.error.FFmpegError) as error:  # no video stream in it is an IndexError
            self._close(path)
            raise UserError(f"{path}: cannot be decoded: {error}. Run `robocasa-lerobot verify`.") from error
        missing = [t for t in wanted if t not in found]
        if missing:
            raise UserError(f"{path}: no picture at {missing[0]:.4f} s. Run `robocasa-lerobot verify`.")
        return torch.from_numpy(np.stack([found[float(t)] for t in times])).permute(0, 3, 1, 2)

    def close(self) -> None:
        """Close all files."""
        for path in list(self._open):
            self._close(path)

    def _decode(self, path: Path, wanted: list[float]) -> dict[float, NDArray[np.uint8]]:
        container = self._container(path)
        stream = container.streams.video[0]
        # One unit before the first picture, as rounding could otherwise skip the key frame that it may be itself.
        container.seek(round(wanted[0] / stream.time_base) - 1, backward=True, any_frame=False, stream=stream)
        found: dict[float, NDArray[np.uint8]] = {}
        for frame in container.decode(stream):
            if frame.pts is None:
                continue
            time = float(frame.pts * stream.time_base)
            near = [
                t for t in wanted[bisect.bisect_left(wanted, time - _TOLERANCE_S) :][:2] if abs(t - time) < _TOLERANCE_S
            ]
            if near:
                picture = frame.to_ndarray(format="rgb24")
                found |= dict.fromkeys(near, picture)
            if time > wanted[-1] - _TOLERANCE_S:
                break
        return found

    def _container(self, path: Path) -> Any:
        if path not in self._open:
            while len(self._open) >= self.max_open:
                self._close(next(iter(self._open)))
            container = av.open(str(path))
            # Threads gain nothing on single small pictures, and wait for each other where cores are busy.
            container.streams.video[0].codec_context.thread_count = 1
            self._open[path] = container
        self._open.move_to_end(path)
        return self._open[path]

    def _close(self, path: Path) -> None:
        container = self._open.pop(path, None)
        if container is not None:
            container.close()

    def __getstate__(self) -> dict[str, Any]:
        """Worker processes open their own files."""
        return {"max_open": self.max_open, "_open": OrderedDict()}
