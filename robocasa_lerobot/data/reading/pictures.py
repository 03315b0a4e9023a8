"""Pictures of a dataset that is not in the frame cache, from its videos or, stored singly, through LeRobot's reader."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from numpy.typing import NDArray

from robocasa_lerobot.data.reading.resize import AT_ONCE, resize_images
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.reading.video_reader import VideoReader

_FAR = 4  # frames; key frames are 2 apart in the videos that our converter and LeRobot write
_MAX_LEROBOT = 8  # of LeRobot's datasets; each takes seconds to open and keeps its tables


class PictureReader:
    """Reads frames of camera features; at most `max_open` videos are open at once."""

    def __init__(self, max_open: int) -> None:
        self.videos = VideoReader(max_open)
        self._others: OrderedDict[Path, LeRobotDataset] = OrderedDict()

    def frames(
        self, source: DatasetSource, key: str, indices: NDArray[np.int64], size: tuple[int, int]
    ) -> torch.Tensor:
        """The frames of the dataset with the given indices (n,) at (height, width) `size`: (n, 3, *size), uint8.

        Raises:
            UserError: a video cannot be read.
        """
        distinct, back = np.unique(indices, return_inverse=True)
        feature = source.features[key]
        if feature["dtype"] != "video":
            others = self._lerobot(source)
            # LeRobot gives pictures that are stored singly as floats, whatever it is asked for.
            singly = (others[int(index)][key].mul(255).round().to(torch.uint8) for index in distinct)
            return torch.stack([resize_images(picture, size) for picture in singly])[torch.from_numpy(back)]
        parts: list[torch.Tensor] = []
        read: list[torch.Tensor] = []  # and not resized yet
        episodes = np.searchsorted(source.ends, distinct, side="right")
        for episode in np.unique(episodes):
            inside = distinct[episodes == episode] - source.starts[episode]
            path, start = source.video(int(episode), key)
            for run in _runs(inside):
                read.append(self.videos.frames(path, start + run / source.fps))
                if sum(map(len, read)) >= AT_ONCE:
                    parts.append(resize_images(torch.cat(read), size))
                    read = []
        if read:
            parts.append(resize_images(torch.cat(read), size))
        return torch.cat(parts)[torch.from_numpy(back)].contiguous()

    def _lerobot(self, source: DatasetSource) -> LeRobotDataset:
        root = source.root
        if root not in self._others:
            while len(self._others) >= _MAX_LEROBOT:
                self._others.popitem(last=False)
            self._others[root] = LeRobotDataset(root.name, root=root, return_uint8=True, video_backend="pyav")
        self._others.move_to_end(root)
        return self._others[root]

    def __getstate__(self) -> dict[str, Any]:
        """Worker processes open their own datasets."""
        return {**self.__dict__, "_others": OrderedDict()}


def _runs(frames: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Ascending frames, parted where decoding all that lies between would take longer than to seek anew."""
    return np.split(frames, np.flatnonzero(np.diff(frames) > _FAR) + 1)
