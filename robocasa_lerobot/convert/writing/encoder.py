"""A video encoder for LeRobotDatasets that never drops a frame, and image statistics from sampled pixels.

LeRobot 0.6.1's own streaming encoder is made for recording from real cameras: a full queue drops frames without
failing, and statistics of every frame cost more than encoding. This one takes each frame at once and counts every
packet. `encoding_process` runs it beside what makes the pictures, and takes statistics from evenly spaced frames.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from robocasa_lerobot.convert.writing.video import VideoForm

# Frames of one episode and camera that go into the statistics, evenly spaced, and about how many rows and columns of
# pixels of each (evenly spaced, too): 50 frames of 64 x 64 pixels take a sixteenth of the time of whole 256 x 256 ones.
SAMPLED_FRAMES = 50
SAMPLED_PIXELS = 64
QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)
# One frame at a time: with a second thread h264 takes as long and a fifth more processor time (`docs/decisions/0013`),
# which the process that makes the pictures needs. Not the number of cores: the bytes of a video depend on it.
ENCODER_THREADS = 1
# Constant rate factor and preset for each codec. Keyframes every 2 frames, as LeRobot has it: random access decodes
# at most one frame more than asked for. No B-frames: with them the decoding times of short episodes overlap where
# LeRobot joins video files, and it fails. No lookahead for hevc: x265 of PyAV 15 with one writes past its memory at
# some sizes (64x48 in 3 of 3 runs, without it at no size in 18), and two frames from keyframe to keyframe need none.
# h264 by "ultrafast" at 21: 0.30 ms a picture of a kitchen of 256x256 pixels instead of the 0.61 of "superfast" at 20,
# its signal-to-noise ratio 0.2 to 0.35 dB better at 64 to 256 pixels, decoded as fast or faster, a seventh larger. It
# has no B-frames, no macroblock trees and no lookahead, which a slower preset would have to do without by options:
# macroblock trees read memory that nobody has written, and of 60 runs up to 18 gave other bytes at 32 to 96 pixels.
CODECS: dict[str, dict[str, Any]] = {
    "h264": {"vcodec": "h264", "crf": 21, "preset": "ultrafast", "g": 2},
    "hevc": {
        **{"vcodec": "hevc", "crf": 20, "preset": "veryfast", "g": 2},
        "extra_options": {"bf": 0, "x265-params": "rc-lookahead=0:log-level=error"},
    },
    "av1": {"vcodec": "libsvtav1", "crf": 30, "preset": 12, "g": 2},
}
PIXEL_FORMAT = "yuv420p"
_LEVELS = 256
Histogram = NDArray[np.int64]  # (3, 256): how often each 8-bit level occurs in each channel


class EncodingError(RuntimeError):
    """A video does not hold what was given to the encoder."""


@dataclass(frozen=True)
class VideoSettings:
    """How videos are encoded: rate, FFmpeg's encoder, and its options; the pixel format is `PIXEL_FORMAT`."""

    fps: int
    encoder: str
    options: tuple[tuple[str, str], ...]

    @classmethod
    def of_codec(cls, codec: str, fps: int) -> VideoSettings:
        """Settings for a key of `CODECS`, with the options that LeRobot makes of it."""
        from lerobot.configs import RGBEncoderConfig  # heavy; the encoder's own process does not need it

        video = RGBEncoderConfig(**CODECS[codec])
        options = video.get_codec_options(ENCODER_THREADS, as_strings=True)
        assert video.pix_fmt == PIXEL_FORMAT, video.pix_fmt
        return cls(fps, video.vcodec, tuple(options.items()))


@dataclass(frozen=True)
class EncodedVideo:
    """A finished video of one episode and camera, the sampled pixels of it, and its form where that is known."""

    path: Path
    histogram: Histogram
    num_sampled: int  # frames
    form: VideoForm | None = None

    def statistics(self) -> dict[str, NDArray[Any]]:
        """Statistics (3, 1, 1) in [0, 1] of the sampled pixels, as LeRobot keeps them for each episode."""
        return unit_statistics(self.histogram, self.num_sampled)


class FramePreparation:
    """Makes planes of the pictures of an episode, and counts the levels of the sampled ones.

    Attributes: `histograms` and `num_sampled` (frames), by key.
    """

    def __init__(self, keys: Sequence[str], length: int) -> None:
        self.histograms: dict[str, Histogram] = {key: np.zeros((3, _LEVELS), np.int64) for key in keys}
        self.num_sampled = dict.fromkeys(keys, 0)
        self._seen = dict.fromkeys(keys, 0)
        self._wanted = sampled_frames(length)

    def prepared(self, key: str, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The planes of the next picture (H, W, 3) of a video.

        Raises:
            EncodingError: height or width is odd.
        """
        if self._seen[key] in self._wanted:
            self.histograms[key] += channel_histogram(picture)
            self.num_sampled[key] += 1
        self._seen[key] += 1
        return planes_of(picture)


class EpisodeEncoder:
    """Encodes one episode, one video for each key; its memory is a few frames, however long the episode is.

    Args:
        settings: rate and codec.
        keys: names of the videos.
        folder: an existing one; the videos come into folders of their own below it.
        length: number of frames that each video must get.
    """

    def __init__(self, settings: VideoSettings, keys: Sequence[str], folder: Path, length: int) -> None:
        assert length > 0, "an episode has frames"
        self._length = length
        self._videos: dict[str, _Video] = {}
        for key in keys:
            self._videos[key] = _Video(Path(tempfile.mkdtemp(dir=folder)) / f"{key}.mp4", settings)

    def feed(self, key: str, planes: NDArray[np.uint8]) -> None:
        """Encode the next frame of a video, given as `planes_of` gives it.

        Raises:
            EncodingError: an earlier frame of this video could not be encoded.
        """
        self._videos[key].add(planes)

    def finish(self) -> dict[str, Path]:
        """Close the videos; gives their files.

        Raises:
            EncodingError: a video has not as many frames as the episode, or its encoder failed.
        """
        for key, video in self._videos.items():
            video.finish()
            if not video.num_packets == video.num_frames == self._length:
                raise EncodingError(
                    f"{key}: {self._length} frames expected, {video.num_frames} encoded, {video.num_packets} written."
                )
        paths = {key: video.path for key, video in self._videos.items()}
        self._videos.clear()
        return paths

    def cancel(self) -> None:
        """Stop, and remove the videos, unless they are finished."""
        for video in self._videos.values():
            video.close()
            shutil.rmtree(video.path.parent, ignore_errors=True)
        self._videos.clear()


class _Video:
    def __init__(self, path: Path, settings: VideoSettings) -> None:
        self.path = path
        self.num_frames = self.num_packets = 0
        self._error: Exception | None = None
        self._time_base = Fraction(1, settings.fps)
        self._container = av.open(str(path), "w")
        self._stream: Any = self._container.add_stream(settings.encoder, settings.fps, options=dict(settings.options))
        self._stream.pix_fmt = PIXEL_FORMAT
        self._stream.time_base = self._time_base

    def add(self, planes: NDArray[np.uint8]) -> None:
        """Encode a frame; what goes wrong is reported by the next call."""
        self._check()
        try:
            if self.num_frames == 0:
                self._stream.height, self._stream.width = planes.shape[0] * 2 // 3, planes.shape[1]
            frame = av.VideoFrame.from_ndarray(planes, format=PIXEL_FORMAT)
            frame.pts, frame.time_base = self.num_frames, self._time_base
            self._write(self._stream.encode(frame))
            self.num_frames += 1
        except (av.FFmpegError, ValueError, OSError) as error:
            self._error = error

    def finish(self) -> None:
        """Write what the encoder still holds, and close the file."""
        try:
            if self.num_frames and self._error is None:
                self._write(self._stream.encode())
            self._container.close()
        except (av.FFmpegError, ValueError, OSError) as error:
            self._error = self._error or error
        self._check()

    def close(self) -> None:
        """Close the file without completing it."""
        with contextlib.suppress(av.FFmpegError, ValueError, OSError):  # it is thrown away
            self._container.close()

    def _check(self) -> None:
        if isinstance(self._error, OSError) and self._error.errno is not None:
            raise self._error  # a full disk or the like: not about this video
        if self._error is not None:
            raise EncodingError(f"{self.path.name}: {self._error}") from self._error

    def _write(self, packets: Sequence[Any]) -> None:
        for packet in packets:
            self._container.mux(packet)
            self.num_packets += 1


def planes_of(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (H, W, 3) RGB as the planes of `PIXEL_FORMAT` below each other, (H * 3 / 2, W) uint8.

    Colours as ITU-R BT.601 of limited range, which FFmpeg takes for granted; those of four pixels are averaged.

    Raises:
        EncodingError: height or width is odd.
    """
    import cv2  # takes a moment; many commands never need it

    height, width = picture.shape[:2]
    if height % 2 or width % 2:
        raise EncodingError(f"pictures of {height}x{width} pixels: the video format needs even numbers.")
    planes = cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420)
    # OpenCV takes the colour of one pixel of four: it is given the average in all of them.
    averaged = cv2.resize(picture, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
    averaged = cv2.resize(averaged, (width, height), interpolation=cv2.INTER_NEAREST)
    planes[height:] = cv2.cvtColor(averaged, cv2.COLOR_RGB2YUV_I420)[height:]
    return np.asarray(planes, np.uint8)


def sampled_frames(length: int) -> frozenset[int]:
    """The frames of an episode whose pixels go into the statistics."""
    return frozenset(np.linspace(0, length - 1, min(SAMPLED_FRAMES, length)).round().astype(int).tolist())


def channel_histogram(image: NDArray[np.uint8]) -> Histogram:
    """How often each level occurs in each channel of the sampled pixels of an image (H, W, 3) uint8: (3, 256)."""
    rows, columns = (slice(step // 2, None, step) for step in _steps(*image.shape[:2]))
    pixels = image[rows, columns]
    return np.stack([np.bincount(pixels[..., channel].ravel(), minlength=_LEVELS) for channel in range(3)])


def num_sampled_pixels(height: int, width: int) -> int:
    """How many pixels of an image go into its histogram."""
    rows, columns = (
        len(range(step // 2, size, step)) for size, step in zip((height, width), _steps(height, width), strict=True)
    )
    return rows * columns


def _steps(height: int, width: int) -> tuple[int, int]:
    return max(1, height // SAMPLED_PIXELS), max(1, width // SAMPLED_PIXELS)


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


def unit_statistics(histogram: Histogram, num_frames: int) -> dict[str, NDArray[Any]]:
    """`histogram_statistics` in LeRobot's layout: (3, 1, 1), in [0, 1]."""
    levels = histogram_statistics(histogram, num_frames)
    return {name: value if name == "count" else (value / 255).reshape(3, 1, 1) for name, value in levels.items()}
