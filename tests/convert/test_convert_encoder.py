"""The encoder in its own process: every frame, colours, statistics, failures and crashes."""

from __future__ import annotations

import errno
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import psutil
import pytest
from convert_support import moving_pictures

from robocasa_lerobot.convert.writing import encoding_process
from robocasa_lerobot.convert.writing.encoder import (
    CODECS,
    EncodingError,
    EpisodeEncoder,
    VideoSettings,
    channel_histogram,
    planes_of,
    sampled_frames,
)
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess, SharedEncoder

SETTINGS = VideoSettings(20, "h264", (("preset", "ultrafast"), ("g", "2"), ("bf", "0")))


@pytest.fixture
def encoder() -> Iterator[EncodingProcess]:
    with EncodingProcess() as process:
        yield process


def _decoded(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


@pytest.mark.parametrize("takes_colours", [False, True])
def test_every_frame_is_kept_however_fast_they_come(
    takes_colours: bool, encoder: EncodingProcess, tmp_path: Path
) -> None:
    pictures = {"a": moving_pictures(300, 64, 1), "b": moving_pictures(300, 64, 2)[:, :, :48]}
    encoder.start_episode(SETTINGS, list(pictures), tmp_path, 300, takes_colours)
    for step in range(300):
        for key, values in pictures.items():
            encoder.feed(key, values[step])
    encoder.end_episode()
    for key, video in encoder.finished().items():
        frames = _decoded(video.path)
        assert len(frames) == 300
        for step in (0, 151, 299):
            errors = [np.mean((frames[step].astype(int) - picture) ** 2) for picture in pictures[key].astype(int)]
            assert errors[step] <= min(errors)
        sampled = sorted(sampled_frames(300))
        np.testing.assert_array_equal(video.histogram, sum(channel_histogram(pictures[key][step]) for step in sampled))
        assert video.statistics()["count"] == [len(sampled)]


def test_frames_arrive_where_no_memory_can_be_shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> None:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    monkeypatch.setattr(encoding_process, "FrameSender", refused)
    found = []
    for _ in range(2):
        with EncodingProcess() as encoder:
            encoder.start_episode(SETTINGS, ["a"], tmp_path, 40)
            for picture in moving_pictures(40, 64, 1):
                encoder.feed("a", picture)
            encoder.end_episode()
            found.append(encoder.finished()["a"].path.read_bytes())
        monkeypatch.undo()
    assert found[0] == found[1]


def test_many_ended_episodes_wait_to_be_asked_for(encoder: EncodingProcess, tmp_path: Path) -> None:
    """More answers than a pipe holds: neither process waits for the other forever."""
    keys = [f"camera{number}" for number in range(8)]
    for _ in range(12):
        encoder.start_episode(SETTINGS, keys, tmp_path, 2, True)
        for _ in range(2):
            for key in keys:
                encoder.feed(key, np.zeros((16, 16, 3), np.uint8))
        encoder.end_episode()
    for _ in range(12):
        assert [len(_decoded(video.path)) for video in encoder.finished().values()] == [2] * 8


def test_a_wrong_number_of_frames_is_refused_and_the_next_episode_goes_on(
    encoder: EncodingProcess, tmp_path: Path
) -> None:
    for length, given in ((4, 3), (3, 3)):
        encoder.start_episode(SETTINGS, ["a"], tmp_path, length)
        for _ in range(given):
            encoder.feed("a", np.zeros((64, 64, 3), np.uint8))
        encoder.end_episode()
    with pytest.raises(EncodingError, match="4 frames expected"):
        encoder.finished()
    assert len(_decoded(encoder.finished()["a"].path)) == 3
    assert len(list(tmp_path.iterdir())) == 1  # the files of the first are gone


@pytest.mark.parametrize("takes_colours", [False, True])
def test_odd_sizes_are_refused(takes_colours: bool, encoder: EncodingProcess, tmp_path: Path) -> None:
    encoder.start_episode(SETTINGS, ["a"], tmp_path, 1, takes_colours)
    # Which of the three hears of it is a race.
    with pytest.raises(EncodingError, match="63x63 pixels"):  # noqa: PT012
        encoder.feed("a", np.zeros((63, 63, 3), np.uint8))
        encoder.end_episode()
        encoder.finished()


def test_an_episode_that_is_cancelled_leaves_nothing(encoder: EncodingProcess, tmp_path: Path) -> None:
    encoder.start_episode(SETTINGS, ["a"], tmp_path, 9)
    encoder.feed("a", np.zeros((64, 64, 3), np.uint8))
    encoder.cancel_episode()
    encoder.start_episode(SETTINGS, ["b"], tmp_path, 1)
    encoder.feed("b", np.zeros((64, 64, 3), np.uint8))
    encoder.end_episode()
    video = encoder.finished()["b"]
    assert list(tmp_path.glob("*/*")) == [video.path]


def test_a_folder_that_is_not_there_is_reported(encoder: EncodingProcess, tmp_path: Path) -> None:
    encoder.start_episode(SETTINGS, ["a"], tmp_path / "nowhere", 1)
    encoder.feed("a", np.zeros((64, 64, 3), np.uint8))
    encoder.end_episode()
    with pytest.raises(FileNotFoundError):
        encoder.finished()


def test_a_crash_of_the_codec_is_an_error_not_a_hang(tmp_path: Path) -> None:
    shared = SharedEncoder()
    with pytest.raises(EncodingError, match="SIGSEGV"), shared.borrowed() as encoder:  # noqa: PT012
        child = psutil.Process(encoder._process.pid)
        encoder.start_episode(SETTINGS, ["a"], tmp_path, 100_000)
        child.send_signal(signal.SIGSEGV)
        for _ in range(100_000):
            encoder.feed("a", np.zeros((256, 256, 3), np.uint8))
    with shared.borrowed() as encoder:  # a new one
        assert encoder.alive
    shared.close()
    assert not psutil.pid_exists(child.pid)


def test_the_process_ends_with_the_one_that_started_it() -> None:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        encoder = EncodingProcess()
        os.write(writing, str(encoder._process.pid).encode())
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    number = int(os.read(reading, 32))
    os.close(reading)
    os.close(writing)
    deadline = time.monotonic() + 20
    while psutil.pid_exists(number) and psutil.Process(number).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_planes_hold_the_colours() -> None:
    """Luma of each pixel and the colours' average of four by ITU-R BT.601, limited range."""
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, (12, 16, 3), dtype=np.uint8)
    weights = np.array([[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]) / 255
    luma = 16 + picture @ weights[0]
    average = picture.reshape(6, 2, 8, 2, 3).mean((1, 3))
    blue, red = (128 + average @ weights[row] for row in (1, 2))
    planes = planes_of(picture).astype(float)
    assert planes.shape == (18, 16)
    assert np.abs(planes[:12] - luma).max() <= 1
    assert np.abs(planes[12:].reshape(2, 6, 8) - np.stack([blue, red])).max() <= 1.5


@pytest.mark.parametrize("codec", CODECS)
def test_settings_are_those_that_lerobot_makes_of_the_codec(codec: str) -> None:
    from lerobot.configs import RGBEncoderConfig

    settings = VideoSettings.of_codec(codec, 30)
    config = RGBEncoderConfig(**CODECS[codec])
    assert settings.encoder == config.vcodec
    assert dict(settings.options) == config.get_codec_options(1, as_strings=True)


@pytest.mark.costly
@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("size", [32, 48, 96])
def test_the_same_pictures_give_the_same_bytes(codec: str, size: int, tmp_path: Path) -> None:
    """Whatever lies in the memory that codecs take."""
    settings = VideoSettings.of_codec(codec, 20)
    planes = {str(seed): [planes_of(p) for p in moving_pictures(12, size, seed)] for seed in range(3)}
    found = set()
    for run in range(5 if codec == "av1" else 25):
        junk = [np.random.default_rng(run).integers(0, 256, 200_000, dtype=np.uint8) for _ in range(20)]
        del junk
        folder = tmp_path / str(run)
        folder.mkdir()
        episode = EpisodeEncoder(settings, list(planes), folder, 12)
        for step in range(12):
            for key, frames in planes.items():
                episode.feed(key, frames[step])
        found.add(tuple(path.read_bytes() for path in episode.finish().values()))
    assert len(found) == 1
