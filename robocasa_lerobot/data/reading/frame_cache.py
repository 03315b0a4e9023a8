"""Decoded frames of a dataset as memory-mapped arrays, because decoding video is what a CPU spends its time on.

A cache is a folder with one `<camera feature>.npy` per camera, uint8 (frames, 3, height, width), row i being
the dataset's frame i. It is filled next to its final place and renamed when complete; a filling that was
killed continues with the episode where it stopped.
"""

from __future__ import annotations

import functools
import hashlib
import json
import mmap
import sys
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.datasets.video_utils import decode_video_frames
from numpy.typing import NDArray

from robocasa_lerobot.data.reading.cache_disk import check_disk
from robocasa_lerobot.data.reading.resize import resize_images
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jobs.locks import locked
from robocasa_lerobot.jobs.workers import cores_here
from robocasa_lerobot.progress import Bar

FORMAT = 1  # counted up when the content of a cache changes
_BLOCK = 512  # bytes of the unit of `st_blocks`, whatever the file system's own is
_AHEAD = 4000  # frames of each camera, 0.8 GB before they are made smaller
_TOLERANCE_S = 1e-4  # LeRobot's tolerance between the asked and the decoded timestamp


def cache_bytes(source: DatasetSource, keys: Sequence[str], size: tuple[int, int]) -> int:
    """Bytes that a cache of all frames of `source` takes."""
    return source.total_frames * len(keys) * 3 * size[0] * size[1]


class FrameCache:
    """A complete cache, opened for reading.

    `scattered` is for caches that memory cannot hold, each frame of which is read from the disk again: no more than
    that frame is. Otherwise the system reads megabytes around each, which soon has all of a small cache in memory. Of
    33 GB, 24 GiB of memory and batches of 64 frames from three cameras, a batch takes 4 ms instead of 130.
    """

    def __init__(self, folder: Path, scattered: bool = False) -> None:
        self.folder, self.scattered = folder, scattered and hasattr(mmap, "MADV_RANDOM")

    @functools.cached_property
    def _arrays(self) -> dict[str, NDArray[np.uint8]]:
        keys = json.loads((self.folder / "cache.json").read_text())["keys"]
        arrays = {key: np.load(self.folder / f"{key}.npy", mmap_mode="r") for key in keys}
        if self.scattered:
            for array in arrays.values():
                _mapped(array).madvise(mmap.MADV_RANDOM)
        return arrays

    def frames(self, key: str, indices: NDArray[np.int64]) -> torch.Tensor:
        """Frames of a camera feature: uint8 (*indices.shape, 3, height, width)."""
        array = self._arrays[key]
        if self.scattered:
            _fetch(array, indices)
        return torch.from_numpy(array[indices])

    def close(self) -> None:
        """Let go of the files until they are used again: a mapped file keeps its descriptor."""
        self.__dict__.pop("_arrays", None)

    def __getstate__(self) -> dict[str, Any]:
        """A worker process maps the files itself; the arrays must not travel."""
        return {"folder": self.folder, "scattered": self.scattered}


def _mapped(array: NDArray[np.uint8]) -> mmap.mmap:
    assert isinstance(array.base, mmap.mmap)
    return array.base


def _fetch(array: NDArray[np.uint8], indices: NDArray[np.int64]) -> None:
    """Have the system read rows of a mapped file all at once, instead of page by page as they are used."""
    mapped, length = _mapped(array), array[0].nbytes
    first = len(mapped) - array.nbytes  # the file's header, or what of it the mapping has
    for start in (first + indices.ravel() * length).tolist():
        page = start - start % mmap.PAGESIZE
        mapped.madvise(mmap.MADV_WILLNEED, page, start + length - page)


def open_or_build(
    source: DatasetSource, keys: Sequence[str], size: tuple[int, int], cache_dir: Path, scattered: bool = False
) -> FrameCache:
    """The cache of the camera features `keys` of `source` at (height, width) `size`, decoded if not there yet.

    `scattered` is how it is read, see `FrameCache`. Several processes may ask at once: one decodes, the others wait.

    Raises:
        UserError: too little free disk for it, or a video that lacks frames.
    """
    text = json.dumps([FORMAT, source.fingerprint, sorted(keys), list(size)])
    name = f"{source.root.name}_{size[0]}x{size[1]}_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    folder, partial = cache_dir / name, cache_dir / f"{name}.partial"
    cache_dir.mkdir(parents=True, exist_ok=True)
    with locked(cache_dir / f"{name}.lock", wait=True):
        if not folder.is_dir():
            remedy = ", a smaller `loader.image_size`, or `loader.cache_frames: false`"
            needed = cache_bytes(source, keys, size) - _allocated(partial)
            check_disk(needed, cache_dir, "the frame cache", remedy)
            _fill(source, sorted(keys), size, partial)
            partial.rename(folder)
    return FrameCache(folder, scattered)


def _allocated(folder: Path) -> int:
    """Bytes that the files of a folder take on the disk: those of a filling that was killed have holes."""
    return sum(path.stat().st_blocks * _BLOCK for path in folder.glob("*.npy"))


def _fill(source: DatasetSource, keys: list[str], size: tuple[int, int], folder: Path) -> None:
    progress = folder / "cache.json"
    done = json.loads(progress.read_text())["episodes"] if progress.is_file() else 0
    folder.mkdir(exist_ok=True)
    shape = (source.total_frames, 3, *size)
    mode: Any = "r+" if done else "w+"
    arrays = {
        key: np.lib.format.open_memmap(folder / f"{key}.npy", mode=mode, dtype=np.uint8, shape=None if done else shape)
        for key in keys
    }
    episodes = Bar(
        _decoded(source, keys, size, range(done, len(source.starts))),
        initial=done,
        total=len(source.starts),
        desc=f"decoding {source.root.name}",
        unit="episode",
        mininterval=0.2 if sys.stderr.isatty() else 10.0,  # seconds; a log file needs few lines
    )
    for episode, where, frames in episodes:
        for key, array in arrays.items():
            array[where] = frames[key].numpy()
            array.flush()
        write_text(progress, json.dumps({"episodes": episode + 1, "keys": keys}))


def _decoded(
    source: DatasetSource, keys: Sequence[str], size: tuple[int, int], episodes: Iterable[int]
) -> Iterator[tuple[int, slice, dict[str, torch.Tensor]]]:
    """Episodes in order, with their rows and their frames of each camera; later ones are decoded meanwhile.

    As many at once as keep all cores busy, but none beyond the first while more frames than `_AHEAD` are waiting.
    """
    timestamps, cores = source.columns["timestamp"], cores_here()
    begun: deque[tuple[int, slice, dict[str, Future[torch.Tensor]]]] = deque()
    left, waiting = iter(episodes), 0
    pool = ThreadPoolExecutor(max_workers=max(cores, len(keys)))
    try:
        while True:
            while not begun or (len(begun) <= cores // len(keys) and waiting < _AHEAD):
                episode = next(left, None)
                if episode is None:
                    break
                where = slice(int(source.starts[episode]), int(source.ends[episode]))
                jobs = {key: pool.submit(_decode, source, key, episode, timestamps[where], size) for key in keys}
                begun.append((episode, where, jobs))
                waiting += where.stop - where.start
            if not begun:
                return
            episode, where, jobs = begun.popleft()
            frames = {key: job.result() for key, job in jobs.items()}
            waiting -= where.stop - where.start
            yield episode, where, frames
    finally:  # what nobody will take is not decoded
        pool.shutdown(cancel_futures=True)


def _decode(
    source: DatasetSource, key: str, episode: int, timestamps: NDArray[np.float32], size: tuple[int, int]
) -> torch.Tensor:
    path, start = source.video(episode, key)
    shifted = [start + float(t) for t in timestamps]
    try:
        frames = decode_video_frames(path, shifted, _TOLERANCE_S, backend="pyav", return_uint8=True)
    except Exception as error:
        raise UserError(f"{path}: cannot decode episode {episode}: {error}. Run `robocasa-lerobot verify`.") from error
    return resize_images(frames, size)
