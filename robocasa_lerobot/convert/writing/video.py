"""Videos of single episodes: what form they have, their frames, and files that many of them are joined in.

Joining copies packets as they are. Times are given anew, one frame after the other at the dataset's rate, so that no
rounding adds up and no gap is left between episodes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError

PIXEL_FORMAT = "yuv420p"
FILES_PER_CHUNK = 1000  # LeRobot's `chunks_size`


@dataclass(frozen=True)
class VideoForm:
    """What decides whether a video can stay as it is.

    `order` gives each packet's place in showing order; `longest_gop` is the longest run of packets that begins with a
    key frame; `open_gop` says that pictures come after a key frame but are shown before it, so that they are lost when
    playing starts there; `header` is the codec's out-of-band data, which one file has only once.
    """

    codec: str
    height: int
    width: int
    pixel_format: str
    fps: Fraction | None
    num_packets: int
    starts_with_key: bool
    longest_gop: int
    open_gop: bool
    order: tuple[int, ...]
    header: bytes

    @property
    def delay(self) -> int:
        """How many packets come before one that is shown earlier (B-frames), at most."""
        return max((place - shown for place, shown in enumerate(self.order)), default=0)

    def mismatch(self, codec: str, size: tuple[int, int], fps: int, max_gop: int) -> str | None:
        """Why it has to be encoded again, or None where its packets can be kept."""
        if self.codec != codec:
            return f"codec {self.codec}, not {codec}"
        if (self.height, self.width) != size:
            return f"{self.width}x{self.height} pixels, not {size[1]}x{size[0]}"
        if self.pixel_format != PIXEL_FORMAT:
            return f"pixel format {self.pixel_format}, not {PIXEL_FORMAT}"
        if self.fps != fps:
            return f"{self.fps} frames per second, not {fps}"
        if not self.starts_with_key:
            return "it does not start with a key frame"
        if self.open_gop:
            return "pictures that cannot be decoded from the key frame they follow (open GOP)"
        if self.longest_gop > max_gop:
            return f"up to {self.longest_gop} frames between key frames, more than {max_gop}"
        return None


def probe(path: Path) -> VideoForm:
    """Look at every packet of a video, decoding nothing.

    Raises:
        RejectedEpisodeError: it is no readable video.
    """
    try:
        with av.open(str(path)) as container:
            stream = _video_stream(container, path)
            context = stream.codec_context
            times, keys = [], []
            for packet in container.demux(stream):
                if packet.size:
                    times.append(packet.pts if packet.pts is not None else packet.dts)
                    keys.append(bool(packet.is_keyframe))
            if not times or None in times:
                raise RejectedEpisodeError(f"{path.name} has no frames with times: it is truncated.")
            order = np.empty(len(times), np.int64)
            order[np.argsort(np.array(times, np.int64), kind="stable")] = np.arange(len(times))
            starts = [*np.flatnonzero(keys).tolist(), len(times)]
            gops = [order[start:end] for start, end in pairwise(starts)]
            return VideoForm(
                codec=stream.codec.canonical_name,
                height=context.height,
                width=context.width,
                pixel_format=str(context.pix_fmt),
                fps=stream.average_rate,
                num_packets=len(times),
                starts_with_key=keys[0],
                longest_gop=int(np.diff(starts).max()) if len(starts) > 1 else len(times),
                open_gop=any(gop.min() < gop[0] for gop in gops),
                order=tuple(order.tolist()),
                header=bytes(context.extradata or b""),
            )
    except (av.FFmpegError, ValueError, MemoryError) as error:
        if isinstance(error, RejectedEpisodeError):
            raise
        raise RejectedEpisodeError(f"{path.name} cannot be read as video ({error}): truncated or damaged.") from None


def frames(path: Path) -> Iterator[av.VideoFrame]:
    """Decoded frames in showing order.

    Raises:
        RejectedEpisodeError: the decoder finds an error anywhere (it would hide it otherwise).
    """
    try:
        with av.open(str(path)) as container:
            stream = _video_stream(container, path)
            stream.codec_context.options = {"err_detect": "explode"}
            yield from container.decode(stream)
    except (av.FFmpegError, MemoryError) as error:
        raise RejectedEpisodeError(f"{path.name} cannot be decoded ({error}): truncated or damaged.") from None


def rgb(frame: av.VideoFrame, size: tuple[int, int]) -> NDArray[np.uint8]:
    """A frame as (H, W, 3) RGB; averaged over areas where `size` (height, width) is another than its own."""
    if (frame.height, frame.width) == size:
        return frame.to_ndarray(format="rgb24")
    return frame.reformat(width=size[1], height=size[0], format="rgb24", interpolation="AREA").to_ndarray()


def frame_digest(frame: av.VideoFrame) -> bytes:
    """Digest of a frame's decoded samples, without any conversion of colours."""
    return hashlib.blake2b(np.ascontiguousarray(frame.to_ndarray()).tobytes(), digest_size=16).digest()


def digests(path: Path, start_s: float = 0.0, count: int | None = None) -> list[bytes]:
    """`frame_digest` of `count` frames (None: all) from the key frame at `start_s` seconds on."""
    found: list[bytes] = []
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.time_base is not None
        first = round(start_s / stream.time_base)
        container.seek(first, stream=stream)
        for frame in container.decode(stream):
            if frame.pts is not None and frame.pts >= first and (count is None or len(found) < count):
                found.append(frame_digest(frame))
            elif count is not None and len(found) >= count:
                break
    return found


class VideoFiles:
    """The files of one camera of a dataset, in LeRobot's layout; episodes are appended to the last one.

    Args:
        root: folder of the dataset.
        key: feature of the camera.
        fps: frames per second.
        max_bytes: a file that has grown beyond is closed.
    """

    def __init__(self, root: Path, key: str, fps: int, max_bytes: int) -> None:
        self._root, self._key, self._fps, self._max_bytes = root, key, fps, max_bytes
        self._file = -1
        self._container: Any = None
        self._stream: Any = None
        self._header, self._delay, self._frames, self._bytes = b"", 0, 0, 0

    def append(self, path: Path, form: VideoForm) -> dict[str, float | int]:
        """Copy all packets of a video; gives the episode's `videos/<key>/...` entries.

        A new file is begun where the packets do not fit behind the present ones: another codec header, more
        reordering, or a full file.
        """
        if (
            self._container is None
            or form.header != self._header
            or form.delay > self._delay
            or self._bytes >= self._max_bytes
        ):
            self._begin(path, form)
        start = self._frames
        copied = 0
        with av.open(str(path)) as source:
            for packet in source.demux(source.streams.video[0]):
                if not packet.size:
                    continue
                packet.pts = start + form.order[copied]
                packet.dts = start + copied - self._delay
                packet.time_base = Fraction(1, self._fps)
                packet.duration = 1
                packet.stream = self._stream
                self._bytes += packet.size
                self._container.mux(packet)
                copied += 1
        assert copied == form.num_packets, f"{path} changed while it was copied"
        self._frames += copied
        prefix = f"videos/{self._key}"
        return {
            f"{prefix}/chunk_index": self._file // FILES_PER_CHUNK,
            f"{prefix}/file_index": self._file % FILES_PER_CHUNK,
            f"{prefix}/from_timestamp": start / self._fps,
            f"{prefix}/to_timestamp": self._frames / self._fps,
        }

    def close(self) -> None:
        """Complete the last file."""
        if self._container is not None:
            self._container.close()
            self._container = None

    def _begin(self, path: Path, form: VideoForm) -> None:
        self.close()
        self._file += 1
        chunk, file = divmod(self._file, FILES_PER_CHUNK)
        target = self._root / "videos" / self._key / f"chunk-{chunk:03d}" / f"file-{file:03d}.mp4"
        target.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(target), "w", options={"movflags": "faststart"})
        with av.open(str(path)) as source:
            self._stream = self._container.add_stream_from_template(source.streams.video[0], opaque=True)
        self._stream.time_base = Fraction(1, self._fps)
        self._header, self._delay, self._frames, self._bytes = form.header, form.delay, 0, 0


def _video_stream(container: Any, path: Path) -> Any:
    if not container.streams.video:
        raise RejectedEpisodeError(f"{path.name} holds no video.")
    return container.streams.video[0]
