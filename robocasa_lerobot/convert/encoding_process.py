"""The video encoder in a process of its own, so that pictures are made and encoded at the same time.

PyAV and MuJoCo's renderer both keep Python's lock while they work, so threads of one process would take turns. Pictures
go through a pipe, sent by a thread: the process that makes them waits only when it is far ahead. A codec that crashes
ends the other process, not the conversion.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.encoder import (
    EncodedVideo,
    EncodingError,
    EpisodeEncoder,
    Histogram,
    VideoSettings,
    channel_histogram,
    planes_of,
    quiet_codecs,
    sampled_frames,
)

# Not `-m`: the module would be there twice, and so would the classes of its messages.
_PROGRAM = "import sys; from robocasa_lerobot.convert.encoding_process import serve; serve(*map(int, sys.argv[1:]))"
_AHEAD_BYTES = 24 << 20  # pictures that wait to be sent
_PIPE_BYTES = 1 << 20
_F_SETPIPE_SZ = 1031  # Linux
# The encoder takes what the renderer leaves: on two cores it would otherwise hold up the renderer's own threads, and
# states are converted 6 % slower. Where pictures wait for the encoder, the other process sleeps anyway.
_NICE = 10


@dataclass(frozen=True)
class _Start:
    """A new episode of `length` frames, whose videos are written into `folder`."""

    settings: VideoSettings
    keys: tuple[str, ...]
    folder: str
    length: int


@dataclass(frozen=True)
class _Picture:
    """The next frame of a video; the bytes of its planes follow."""

    key: str
    shape: tuple[int, ...]


class _End:
    """The episode has all its frames: its videos, or what went wrong, are sent back."""


class _Cancel:
    """The episode is thrown away; nothing is sent back."""


class EncodingProcess:
    """Encodes episodes one after the other in another process; use it in a `with` block, or `close` it.

    An episode that has been ended is encoded while the next one is begun: `finished` gives what has been ended, in
    order. The other process ends with this one, however that ends.
    """

    def __init__(self) -> None:
        down_read, down_write = os.pipe()
        up_read, up_write = os.pipe()
        with contextlib.suppress(OSError, ImportError):  # only faster
            import fcntl

            fcntl.fcntl(down_write, _F_SETPIPE_SZ, _PIPE_BYTES)
        places = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, str(down_read), str(up_write)],
            pass_fds=(down_read, up_write),
            stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
        )
        os.close(down_read)
        os.close(up_write)
        self._pipe = os.fdopen(down_write, "wb", buffering=0)
        self._answers = os.fdopen(up_read, "rb")
        self._waiting: queue.SimpleQueue[tuple[Any, NDArray[np.uint8] | None] | None] = queue.SimpleQueue()
        self._room = threading.Condition()
        self._bytes = 0
        self._broken: OSError | EncodingError | None = None
        self._sampled: queue.SimpleQueue[_Samples] = queue.SimpleQueue()
        self._received: queue.SimpleQueue[dict[str, Path] | Exception | None] = queue.SimpleQueue()
        # Both directions at any time, or both processes might wait for the other to read.
        self._threads = [threading.Thread(target=f, daemon=True) for f in (self._send_waiting, self._receive)]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> EncodingProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether the other process is there."""
        return self._broken is None and self._process.poll() is None

    def start_episode(self, settings: VideoSettings, keys: Sequence[str], folder: Path, length: int) -> None:
        """Begin an episode of `length` frames: one video for each key, somewhere below `folder`, which exists."""
        self._put(_Start(settings, tuple(keys), str(folder), length))

    def feed(self, key: str, picture: NDArray[np.uint8]) -> None:
        """Hand over the next frame (H, W, 3) of a video; it must not be changed afterwards.

        Raises:
            EncodingError: the other process is gone.
        """
        self._put(_Picture(key, picture.shape), picture)

    def end_episode(self) -> None:
        """Say that all frames have been handed over."""
        self._put(_End())

    def cancel_episode(self) -> None:
        """Throw the episode away that was begun and not ended; its files go."""
        with contextlib.suppress(EncodingError):  # the other process is gone, and says so where it matters
            self._put(_Cancel())

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
        samples = self._sampled.get()
        if isinstance(answer, Exception):
            raise answer
        return {key: EncodedVideo(path, samples.histograms[key], samples.taken[key]) for key, path in answer.items()}

    def close(self) -> None:
        """End the other process; what it has not finished is lost."""
        self._waiting.put(None)
        self._process.kill()
        self._process.wait()
        for thread in self._threads:
            thread.join()
        self._pipe.close()
        self._answers.close()

    def _put(self, message: Any, picture: NDArray[np.uint8] | None = None) -> None:
        with self._room:
            while self._bytes > _AHEAD_BYTES and self._broken is None:
                self._room.wait()
            if self._broken is not None:
                raise self._gone()
            self._bytes += 0 if picture is None else picture.nbytes
        self._waiting.put((message, picture))

    def _send_waiting(self) -> None:
        samples: _Samples | None = None
        while (item := self._waiting.get()) is not None:
            message, picture = item
            try:
                if isinstance(message, _Start):
                    samples = _Samples(message.keys, message.length)
                elif isinstance(message, _End):
                    assert samples is not None
                    self._sampled.put(samples)
                if self._broken is None:
                    self._send(message, picture, samples)
            except (OSError, EncodingError) as error:
                self._broken = error
            with self._room:
                self._bytes -= 0 if picture is None else picture.nbytes
                self._room.notify()

    def _send(self, message: Any, picture: NDArray[np.uint8] | None, samples: _Samples | None) -> None:
        if picture is None:
            _write_all(self._pipe, pickle.dumps(message))
            return
        assert samples is not None
        samples.add(message.key, picture)
        planes = planes_of(picture)
        _write_all(self._pipe, pickle.dumps(_Picture(message.key, planes.shape)))
        _write_all(self._pipe, planes.reshape(-1).data)

    def _receive(self) -> None:
        with contextlib.suppress(EOFError, OSError, pickle.UnpicklingError):  # the other process is gone
            while True:
                self._received.put(pickle.load(self._answers))
        self._received.put(None)

    def _gone(self) -> EncodingError:
        if isinstance(self._broken, EncodingError):
            return self._broken
        try:
            status = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            return EncodingError("the encoder's process does not answer.")
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        return EncodingError(f"the encoder's process ended with {how}.")


class _Samples:
    """Levels of the sampled pixels of an episode, for each video."""

    def __init__(self, keys: Sequence[str], length: int) -> None:
        self.histograms: dict[str, Histogram] = {key: np.zeros((3, 256), np.int64) for key in keys}
        self.taken = dict.fromkeys(keys, 0)
        self._seen = dict.fromkeys(keys, 0)
        self._wanted = sampled_frames(length)

    def add(self, key: str, picture: NDArray[np.uint8]) -> None:
        """Count the pixels of the next frame of a video, if it is one that is sampled."""
        if self._seen[key] in self._wanted:
            self.histograms[key] += channel_histogram(picture)
            self.taken[key] += 1
        self._seen[key] += 1


def _write_all(pipe: Any, content: bytes | memoryview) -> None:
    left = memoryview(content)
    while left:
        left = left[pipe.write(left) :]


class SharedEncoder:
    """The one `EncodingProcess` of a process, started when it is first wanted, since starting takes a moment."""

    def __init__(self) -> None:
        self._encoder: EncodingProcess | None = None

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
        if self._encoder is not None and not self._encoder.alive:
            self.close()
        if self._encoder is None:
            self._encoder = EncodingProcess()
        return self._encoder

    def close(self) -> None:
        """End the process, if it runs."""
        if self._encoder is not None:
            self._encoder.close()
            self._encoder = None


shared_encoder = SharedEncoder()


def serve(down: int, up: int) -> None:
    """The other process: encode what comes through a pipe until that is closed, and answer through another one.

    Args:
        down: file descriptor to read messages and pictures from.
        up: file descriptor to write answers to.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a user's Ctrl-C: the process that sends pictures ends this one
    os.nice(_NICE)
    quiet_codecs()
    episode = _Episode()
    buffers: dict[tuple[int, ...], NDArray[np.uint8]] = {}
    with os.fdopen(down, "rb") as pipe, os.fdopen(up, "wb") as answers, contextlib.suppress(BrokenPipeError, EOFError):
        while True:
            message = pickle.load(pipe)
            planes = None
            if isinstance(message, _Picture):
                if message.shape not in buffers:
                    buffers[message.shape] = np.empty(message.shape, np.uint8)
                planes = buffers[message.shape]
                if pipe.readinto(planes.reshape(-1).data) != planes.nbytes:
                    return
            answer = episode.take(message, planes)
            if answer is not None:
                pickle.dump(answer, answers)
                answers.flush()


class _Episode:
    """What is being encoded; after a failure the rest of an episode is let pass."""

    def __init__(self) -> None:
        self._encoder: EpisodeEncoder | None = None
        self._failure: Exception | None = None

    def take(self, message: Any, planes: NDArray[np.uint8] | None) -> dict[str, Path] | Exception | None:
        """Act on a message; gives the answer to be sent, if there is one."""
        answer: dict[str, Path] | None = None
        try:
            if isinstance(message, _Start):
                self._failure = None
                folder = Path(message.folder)
                self._encoder = EpisodeEncoder(message.settings, message.keys, folder, message.length)
            elif isinstance(message, _Cancel):
                self._cancel()
            elif self._encoder is not None:
                if planes is not None:
                    self._encoder.feed(message.key, planes)
                else:
                    answer = self._encoder.finish()
        except Exception as error:  # raised in the other process
            self._failure = error
            self._cancel()
        return (answer if self._failure is None else self._failure) if isinstance(message, _End) else None

    def _cancel(self) -> None:
        if self._encoder is not None:
            self._encoder.cancel()
        self._encoder = None
