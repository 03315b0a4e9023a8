"""Pictures through shared memory: all of them, unharmed, whatever their sizes, and no hang where an end is gone."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest

from robocasa_lerobot.convert.writing.frame_ring import FrameReceiver, FrameSender


def _ends(ahead_bytes: int) -> tuple[FrameSender, FrameReceiver]:
    sender = FrameSender(ahead_bytes)
    receiver = FrameReceiver(*map(os.dup, sender.descriptors))
    sender.others_only()
    return sender, receiver


@pytest.mark.parametrize("ahead_bytes", [1, 700, 5000])
def test_pictures_of_all_sizes_arrive_unharmed(ahead_bytes: int) -> None:
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 256, rng.integers(0, 40, 2), dtype=np.uint8) for _ in range(600)]
    sender, receiver = _ends(ahead_bytes)
    told: list[tuple[int, tuple[int, ...]]] = []
    ready = threading.Semaphore(0)
    arrived: list[np.ndarray] = []

    def take() -> None:
        pause = np.random.default_rng(1)
        for _ in pictures:
            ready.acquire()
            with receiver.taken(*told.pop(0)) as picture:
                if pause.random() < 0.1:
                    threading.Event().wait(0.002)
                arrived.append(picture.copy())

    thread = threading.Thread(target=take)
    thread.start()
    most = 0
    for picture in pictures:
        start = sender.put(picture)
        most = max(most, start + picture.nbytes)
        told.append((start, picture.shape))
        ready.release()
    thread.join()
    assert most <= max(ahead_bytes, 2 * 39 * 39)
    for picture, other in zip(pictures, arrived, strict=True):
        np.testing.assert_array_equal(picture, other)
    sender.close()


def test_an_end_that_is_gone_is_noticed() -> None:
    sender, receiver = _ends(100)
    sender.put(np.zeros(80, np.uint8))
    os.close(receiver._taken)
    with pytest.raises(BrokenPipeError):
        sender.put(np.zeros(80, np.uint8))
    sender.close()


def test_a_picture_larger_than_the_memory_is_refused() -> None:
    sender, _ = _ends(100)
    with pytest.raises(ValueError, match="at most"):
        sender.put(np.broadcast_to(np.zeros(1, np.uint8), (1 << 15, 1 << 15, 3)))
    sender.close()
