"""The video encoder in a process of its own, so that pictures are made and encoded at the same time.

PyAV and MuJoCo's renderer both keep Python's lock while they work, so threads of one process would take turns. Pictures
go through shared memory: the process that makes them waits only when it is far ahead. A codec that crashes ends the
other process, not the conversion.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.writing.encoder import (
    EncodedVideo,
    EncodingError,
    EpisodeEncoder,
    FramePreparation,
    VideoSettings,
)
from robocasa_lerobot.convert.writing.frame_ring import FrameReceiver, FrameSender
from robocasa_lerobot.jobs.child_process import start_serving
from robocasa_lerobot.quiet import quiet_codecs

if TYPE_CHECKING:
    from robocasa_lerobot.convert.writing.video import VideoForm


@dataclass(frozen=True)
class _Start:
    """A new episode of `length` frames, whose videos are written into `folder`."""

    settings: VideoSettings
    keys: tuple[str, ...]
    folder: str
    length: int
    takes_colours: bool


@dataclass(frozen=True)
class _Picture:
    """The next frame of a video, or its place: planes, or colours, as the episode has it."""

    key: str
    shape: tuple[int, ...]
    frame: int | NDArray[np.uint8]


class _End:
    """The episode has all its frames: its videos, or what went wrong, are sent back."""


class _Cancel:
    """The episode is thrown away; nothing is sent back."""


# The videos, with the preparation and the videos' forms where the other process did that; or what went wrong.
_Answer = tuple[dict[str, Path], FramePreparation | None, "dict[str, VideoForm]"] | Exception


class EncodingProcess:
    """Encodes episodes one after the other in another process; use it in a `with` block, or `close` it.

    An episode that has been ended is encoded while the next one is begun: `finished` gives what has been ended, in
    order. The other process ends with this one, however that ends.
    """

    def __init__(self) -> None:
        down_read, down_write = os.pipe()
        up_read, up_write = os.pipe()
        self._frames: FrameSender | None = None
        with contextlib.suppress(OSError):  # files may not grow (`ulimit -f`): through the pipe then
            self._frames = FrameSender()
        passed = (down_read, up_write, *(self._frames.descriptors if self._frames else ()))
        self._process = start_serving(__name__, passed)
        os.close(down_read)
        os.close(up_write)
        if self._frames:
            self._frames.others_only()
        self._pipe = os.fdopen(down_write, "wb", buffering=0)
        self._answers = os.fdopen(up_read, "rb")
        self._broken = self._takes_colours = False
        self._preparation: FramePreparation | None = None
        self._prepared: deque[FramePreparation] = deque()
        self._received: queue.SimpleQueue[_Answer | None] = queue.SimpleQueue()
        # Answers are read at any time, or both processes might wait for the other to read.
        self._reader = threading.Thread(target=self._receive, daemon=True)
        self._reader.start()

    def __enter__(self) -> EncodingProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether the other process is there."""
        return not self._broken and self._process.poll() is None

    def start_episode(
        self, settings: VideoSettings, keys: Sequence[str], folder: Path, length: int, takes_colours: bool = False
    ) -> None:
        """Begin an episode.

        Args:
            settings: codec and rate.
            keys: one video for each.
            folder: an existing one, somewhere below which the videos come.
            length: number of frames.
            takes_colours: making the pictures takes longer than encoding them, so the other process makes the planes.
        """
        self._preparation, self._takes_colours = FramePreparation(keys, length), takes_colours
        self._tell(_Start(settings, tuple(keys), str(folder), length, takes_colours))

    def feed(self, key: str, picture: NDArray[np.uint8]) -> None:
        """Hand over the next frame (H, W, 3) of a video.

        Raises:
            EncodingError: the other process is gone, or the picture has an odd height or width.
        """
        assert self._preparation is not None, "an episode has been started"
        frame = picture if self._takes_colours else self._preparation.prepared(key, picture)
        try:
            where = self._frames.put(frame) if self._frames else frame
        except OSError:
            raise self._gone() from None
        self._tell(_Picture(key, frame.shape, where))

    def end_episode(self) -> None:
        """Say that all frames have been handed over."""
        assert self._preparation is not None, "an episode has been started"
        self._prepared.append(self._preparation)
        self._tell(_End())

    def cancel_episode(self) -> None:
        """Throw the episode away that was begun and not ended; its files go."""
        with contextlib.suppress(EncodingError):  # the other process is gone, and says so where it matters
            self._tell(_Cancel())

    def finished(self) -> dict[str, EncodedVideo]:
        """Wait for the first episode that has been ended and not been asked for.

        Raises:
            EncodingError: a video has not as many frames as the episode, or its encoder failed or crashed.
            OSError: writing failed (a full disk).
        """
        answer = self._received.get()
        if answer is None:
            self._received.put(None)  # for whoever asks again
            raise self._gone()
        here = self._prepared.popleft()
        if isinstance(answer, Exception):
            raise answer
        paths, there, forms = answer
        frames = here if there is None else there
        return {
            key: EncodedVideo(path, frames.histograms[key], frames.num_sampled[key], forms.get(key))
            for key, path in paths.items()
        }

    def close(self) -> None:
        """End the other process; what it has not finished is lost."""
        self._process.kill()
        self._process.wait()
        self._reader.join()
        with contextlib.suppress(OSError):
            self._pipe.close()
        self._answers.close()
        if self._frames:
            self._frames.close()

    def _tell(self, message: Any) -> None:
        try:
            left = memoryview(pickle.dumps(message))
            while left:
                left = left[self._pipe.write(left) :]
        except (OSError, ValueError):  # closed from the other side, or from this one
            raise self._gone() from None

    def _receive(self) -> None:
        with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):  # the other process is gone
            while True:
                self._received.put(pickle.load(self._answers))
        self._received.put(None)

    def _gone(self) -> EncodingError:
        self._broken = True
        try:
            status = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return EncodingError("the encoder's process does not answer.")
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        return EncodingError(f"the encoder's process ended with {how}.")


class SharedEncoder:
    """The one `EncodingProcess` of a process, started when it is first wanted, since starting takes a moment."""

    def __init__(self) -> None:
        self._encoder: EncodingProcess | None = None
        self._owner = os.getpid()

    @contextlib.contextmanager
    def borrowed(self) -> Iterator[EncodingProcess]:
        """The process; it is ended if the block fails, since nobody knows what it still holds."""
        encoder = self.started()
        try:
            yield encoder
        except BaseException:
            self.close()
            raise

    def started(self) -> EncodingProcess:
        """Start the process, unless it runs."""
        if self._owner != os.getpid():
            self._encoder, self._owner = None, os.getpid()  # a fork must not write into its parent's pipe
        if self._encoder is not None and not self._encoder.alive:
            self.close()
        if self._encoder is None:
            self._encoder = EncodingProcess()
        return self._encoder

    def close(self) -> None:
        """End the process, if it runs."""
        if self._encoder is not None and self._owner == os.getpid():
            self._encoder.close()
            self._encoder = None


shared_encoder = SharedEncoder()


def serve(down: int, up: int, *frames: int) -> None:
    """The other process: encode what comes until the pipe is closed, and answer through another one.

    Args:
        down: file descriptor to read messages from.
        up: file descriptor to write answers to.
        frames: file descriptors of a `FrameReceiver`, if frames come through shared memory.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a user's Ctrl-C: the process that sends pictures ends this one
    quiet_codecs()
    episode, receiver = _Episode(), FrameReceiver(*frames) if frames else None
    with os.fdopen(down, "rb") as pipe, os.fdopen(up, "wb") as answers, contextlib.suppress(BrokenPipeError, EOFError):
        while True:
            message = pickle.load(pipe)
            if isinstance(message, _Picture):
                where = message.frame
                if not isinstance(where, int):
                    episode.take(message, where)
                    continue
                assert receiver is not None
                with receiver.taken(where, message.shape) as frame:
                    episode.take(message, frame)
            elif (answer := episode.take(message)) is not None:
                pickle.dump(answer, answers)
                answers.flush()


class _Episode:
    """The episode being encoded; after a failure the rest of an episode is let pass."""

    def __init__(self) -> None:
        self._encoder: EpisodeEncoder | None = None
        self._frames: FramePreparation | None = None  # where they come as colours
        self._failure: Exception | None = None

    def take(self, message: Any, frame: NDArray[np.uint8] | None = None) -> _Answer | None:
        """Act on a message; gives the answer to be sent, if there is one."""
        paths: dict[str, Path] = {}
        forms: dict[str, VideoForm] = {}
        try:
            if isinstance(message, _Start):
                self._start(message)
            elif isinstance(message, _Cancel):
                self._cancel()
            elif self._encoder is not None:
                if frame is not None:
                    planes = frame if self._frames is None else self._frames.prepared(message.key, frame)
                    self._encoder.feed(message.key, planes)
                else:
                    paths = self._encoder.finish()
                    if self._frames is not None:
                        from robocasa_lerobot.convert.writing.video import probe  # takes a moment to import

                        forms = {key: probe(path) for key, path in paths.items()}
        except Exception as error:  # raised in the other process
            self._failure = error
            self._cancel()
        if not isinstance(message, _End):
            return None
        return (paths, self._frames, forms) if self._failure is None else self._failure

    def _start(self, message: _Start) -> None:
        self._failure = self._frames = None
        if message.takes_colours:
            self._frames = FramePreparation(message.keys, message.length)
        self._encoder = EpisodeEncoder(message.settings, message.keys, Path(message.folder), message.length)

    def _cancel(self) -> None:
        if self._encoder is not None:
            self._encoder.cancel()
        self._encoder = None
