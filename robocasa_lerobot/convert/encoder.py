"""A video encoder for LeRobot's dataset writer that waits instead of dropping frames and samples its statistics.

LeRobot 0.6.1's own streaming encoder is made for recording from real cameras: a full queue drops frames without
failing, and statistics of every frame cost more than encoding. This one has the same methods, so the writer uses it
unchanged: a full queue blocks the producer, each packet is counted, and statistics come from evenly spaced frames.
"""

from __future__ import annotations

import queue
import shutil
import tempfile
import threading
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

# Frames of one episode and camera whose pixels go into the statistics, evenly spaced; all pixels of each.
SAMPLED_FRAMES = 50
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
_QUEUE_FRAMES = 16
_LEVELS = 256
Histogram = NDArray[np.int64]  # (3, 256): how often each 8-bit level occurs in each channel


class EncodingError(RuntimeError):
    """A video does not hold what was given to the encoder."""


class SamplingVideoEncoder:
    """Encodes one episode at a time, one thread for each camera.

    Set `episode_length` before the first frame of an episode: it says which frames are sampled, and how many there
    must be. `histograms` sums the sampled frames of all episodes so far for each camera.
    """

    def __init__(self, fps: int, codec: str, pixel_format: str, options: dict[str, str]) -> None:
        self.episode_length = 0
        self.histograms: dict[str, Histogram] = {}
        self._fps, self._codec, self._pixel_format, self._options = fps, codec, pixel_format, options
        self._threads: dict[str, _CameraThread] = {}

    def start_episode(
        self, video_keys: Sequence[str], temp_dir: Path, depth_video_keys: Sequence[str] | None = None
    ) -> None:
        """Open one video for each key in a temporary folder under `temp_dir` (called by LeRobot's writer)."""
        assert self.episode_length > 0, "episode_length is set before the first frame"
        assert not depth_video_keys, "depth is not converted"
        self.cancel_episode()
        count = min(SAMPLED_FRAMES, self.episode_length)
        sampled = frozenset(np.linspace(0, self.episode_length - 1, count).round().astype(int).tolist())
        for key in video_keys:
            path = Path(tempfile.mkdtemp(dir=temp_dir)) / f"{key}.mp4"
            self._threads[key] = _CameraThread(path, self._fps, self._codec, self._pixel_format, self._options, sampled)
            self._threads[key].start()

    def feed_frame(self, video_key: str, image: NDArray[np.uint8]) -> None:
        """Hand over the next frame (H, W, 3), which is not to be changed afterwards; waits while the queue is full."""
        self._threads[video_key].put(image)

    def finish_episode(self) -> dict[str, tuple[Path, dict[str, NDArray[Any]]]]:
        """Close the videos; gives path and statistics (min, max, mean, std, count, quantiles per channel) of each.

        Raises:
            EncodingError: a video has not as many frames as the episode, or its encoder failed.
        """
        for thread in self._threads.values():
            thread.put(None)
        results = {}
        for key, thread in self._threads.items():
            thread.join()
            thread.check()
            if not thread.num_packets == thread.num_frames == self.episode_length:
                raise EncodingError(
                    f"{key}: {self.episode_length} frames expected, {thread.num_frames} encoded, "
                    f"{thread.num_packets} written."
                )
            results[key] = (thread.path, histogram_statistics(thread.histogram, thread.num_sampled))
            self.histograms[key] = self.histograms.get(key, 0) + thread.histogram
        self._threads.clear()
        return results

    def cancel_episode(self) -> None:
        """Stop the present episode and remove its videos."""
        for thread in self._threads.values():
            thread.cancelled.set()
        for thread in self._threads.values():
            thread.join()
            shutil.rmtree(thread.path.parent, ignore_errors=True)
        self._threads.clear()

    def close(self) -> None:
        """Same as `cancel_episode` (called by LeRobot's writer at the end)."""
        self.cancel_episode()


class _CameraThread(threading.Thread):
    def __init__(
        self, path: Path, fps: int, codec: str, pixel_format: str, options: dict[str, str], sampled: frozenset[int]
    ) -> None:
        super().__init__(daemon=True)
        self.path = path
        self.num_frames = self.num_packets = self.num_sampled = 0
        self.histogram: Histogram = np.zeros((3, _LEVELS), np.int64)
        self.cancelled = threading.Event()
        self._error: Exception | None = None
        self._frames: queue.Queue[NDArray[np.uint8] | None] = queue.Queue(_QUEUE_FRAMES)
        self._fps, self._codec, self._pixel_format, self._options = fps, codec, pixel_format, options
        self._sampled = sampled

    def put(self, frame: NDArray[np.uint8] | None) -> None:
        while True:
            self.check()
            try:
                return self._frames.put(frame, timeout=0.5)
            except queue.Full:
                continue

    def check(self) -> None:
        if self._error is not None:
            raise EncodingError(f"{self.path.name}: {self._error}") from self._error

    def run(self) -> None:
        try:
            self._encode()
        except Exception as error:  # handed to the producer by `check`
            self._error = error

    def _encode(self) -> None:
        with av.open(str(self.path), "w") as container:
            stream = container.add_stream(self._codec, self._fps, options=self._options)
            stream.pix_fmt = self._pixel_format
            stream.time_base = Fraction(1, self._fps)
            while (frame := self._next()) is not None:
                if self.num_frames == 0:
                    stream.height, stream.width = frame.shape[:2]
                if self.num_frames in self._sampled:
                    self.histogram += channel_histogram(frame)
                    self.num_sampled += 1
                picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
                picture.pts, picture.time_base = self.num_frames, Fraction(1, self._fps)
                self._write(container, stream.encode(picture))
                self.num_frames += 1
            if self.num_frames and not self.cancelled.is_set():
                self._write(container, stream.encode())

    def _next(self) -> NDArray[np.uint8] | None:
        while not self.cancelled.is_set():
            try:
                return self._frames.get(timeout=0.2)
            except queue.Empty:
                continue
        return None

    def _write(self, container: Any, packets: Sequence[Any]) -> None:
        for packet in packets:
            container.mux(packet)
            self.num_packets += 1


def channel_histogram(image: NDArray[np.uint8]) -> Histogram:
    """How often each level occurs in each channel of an image (H, W, 3) uint8: (3, 256)."""
    return np.stack([np.bincount(image[..., channel].ravel(), minlength=_LEVELS) for channel in range(3)])


def histogram_statistics(histogram: Histogram, num_frames: int) -> dict[str, NDArray[Any]]:
    """Statistics of 8-bit pixels per channel (3,), in levels 0 to 255; `count` is the number of frames, as in LeRobot.

    A quantile is the smallest level that at least that share of the pixels does not exceed.
    """
    levels = np.arange(_LEVELS, dtype=np.float64)
    total = histogram.sum(axis=1, dtype=np.float64)
    mean = histogram @ levels / total
    variance = histogram @ levels**2 / total - mean**2
    cumulative = histogram.cumsum(axis=1)
    present = histogram > 0
    return {
        "min": present.argmax(axis=1).astype(np.float64),
        "max": (_LEVELS - 1 - present[:, ::-1].argmax(axis=1)).astype(np.float64),
        "mean": mean,
        "std": np.sqrt(np.maximum(variance, 0)),
        "count": np.array([num_frames]),
        **{
            f"q{round(q * 100):02d}": (cumulative >= (q * total)[:, None]).argmax(axis=1).astype(float)
            for q in QUANTILES
        },
    }
