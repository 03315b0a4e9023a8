"""Films of trials and attempts: streamed to the encoder while they run, read back as a few frames for a report."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError

# Pictures smaller than this are enlarged by a whole factor, so that a film of a policy with small inputs can be seen.
MIN_HEIGHT = 128
# Of kitchens: half the control rate and 192 pixels, since on a CPU rendering every step at full size would take longer
# than the trial or the attempt.
FILM_EVERY = 2
FILM_SIZE = 192
# As good as "superfast" at 24, by the signal-to-noise ratio of films of twenty scenes: a fifth larger, in two fifths of
# its time.
CRF = "25"
PRESET = "ultrafast"


def side_by_side(pixels: dict[str, NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The cameras of an observation, each (S, S, 3), as one picture (H, W, 3) with even sides, as h264 wants."""
    order = [camera for camera in contract.CAMERAS if camera in pixels] or list(pixels)
    picture = np.concatenate([pixels[camera] for camera in order], axis=1)
    factor = -(-MIN_HEIGHT // picture.shape[0])
    if factor > 1:
        picture = picture.repeat(factor, axis=0).repeat(factor, axis=1)
    height, width = picture.shape[:2]
    return np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")


class VideoWriter:
    """An mp4 (h264, yuv420p) that appears at `path` only when it is complete.

    Frames go to the encoder one by one, so memory does not grow with the length of the episode.
    """

    def __init__(self, path: Path, fps: int) -> None:
        self._path, self._part, self._fps = path, path.with_name(path.name + ".partial"), fps
        self._container: Any = None
        self._stream: Any = None

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Add a picture of shape (H, W, 3), uint8 RGB; all pictures have the size of the first."""
        import av

        if self._container is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._container = av.open(str(self._part), mode="w", format="mp4")
            options = {"crf": CRF, "preset": PRESET, "threads": "1"}
            self._stream = self._container.add_stream("libx264", rate=Fraction(self._fps), options=options)
            self._stream.height, self._stream.width = picture.shape[:2]
            self._stream.pix_fmt = "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        self._container.mux(self._stream.encode(frame))

    def close(self, keep: bool = True) -> None:
        """Finish the file and move it to its place, or remove what was written."""
        if self._container is None:
            return
        container, self._container = self._container, None
        try:
            try:
                if keep:
                    container.mux(self._stream.encode())
            finally:
                container.close()
            if keep:
                self._part.replace(self._path)
        finally:
            self._part.unlink(missing_ok=True)

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(keep=kind is None)


def frames_and_rate(path: Path) -> tuple[int, float]:
    """Number of frames of a video, and frames per second."""
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return stream.frames or sum(1 for _ in container.decode(stream)), float(stream.average_rate)


def read_frames(path: Path, indices: Sequence[int]) -> list[NDArray[np.uint8]]:
    """The frames (H, W, 3) at `indices` of a video, read in one pass."""
    import av

    wanted, found = set(indices), {}
    with av.open(str(path)) as container:
        for index, frame in enumerate(container.decode(video=0)):
            if index in wanted:
                found[index] = frame.to_ndarray(format="rgb24")
            if len(found) == len(wanted):
                break
    return [found[index] for index in indices if index in found]


class DamagedVideoError(UserError):
    """A video that cannot be read to its end, as one that was copied in part."""


def spread_frames(path: Path, count: int) -> list[tuple[float, NDArray[np.uint8]]]:
    """At most `count` evenly spaced frames (H, W, 3), the first and the last among them, each with its second.

    Raises:
        DamagedVideoError: it has fewer frames than it says, or is no video.
    """
    import av

    try:
        total, rate = frames_and_rate(path)
        count = min(count, total)
        indices = sorted({round(place * (total - 1) / max(1, count - 1)) for place in range(count)})
        pictures = read_frames(path, indices)
    except (av.FFmpegError, IndexError) as error:
        raise DamagedVideoError(f"{path} cannot be read as a video: {error}") from error
    if len(pictures) < len(indices):
        raise DamagedVideoError(f"{path} ends before its last frame: was it copied in part?")
    return [(index / rate, picture) for index, picture in zip(indices, pictures, strict=True)]
