"""A LeRobotDataset v3.0 written episode by episode, pictures going straight into the video encoder.

LeRobot's own writer spends as long on an episode's table as the encoder does on its pictures, and rewrites the whole
video file for every episode it appends (measured with LeRobot 0.6.1); its metadata writer is used as it is.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.stages import StageTrack
from robocasa_lerobot.convert.writing.encoder import EncodingError, Histogram, VideoSettings
from robocasa_lerobot.convert.writing.encoding_process import EncodingProcess
from robocasa_lerobot.convert.writing.files import DatasetFiles


@dataclass(frozen=True)
class _Pending:
    """An episode whose pictures are being encoded."""

    columns: Mapping[str, NDArray[Any]]
    task: str
    length: int
    scratch: Path
    stages: StageTrack | None


class DatasetWriter:
    """A dataset of one data file; `finalize` completes it.

    Args:
        encoder: the process that encodes the pictures, to be used by nobody else meanwhile.
        root: folder of the dataset, which must not exist.
        fps: frames per second.
        robot_type: name of the robot.
        features: LeRobot's, without those that every dataset has (time, indices).
        codec: key of `CODECS`.
    """

    def __init__(
        self, encoder: EncodingProcess, root: Path, fps: int, robot_type: str, features: Mapping[str, Any], codec: str
    ) -> None:
        self.root, self._codec = root, codec
        self._files = DatasetFiles(root, fps, robot_type, features)
        self._encoder, self._settings = encoder, VideoSettings.of_codec(codec, fps)
        self._pending: _Pending | None = None
        self._number = 0  # of episodes begun

    @property
    def histograms(self) -> dict[str, Histogram]:
        """Sampled pixels of all episodes so far for each video feature."""
        return self._files.histograms

    def add(
        self,
        columns: Mapping[str, NDArray[Any]],
        task: str,
        length: int,
        pictures: Iterable[Mapping[str, NDArray[np.uint8]]],
        progress: Callable[[int], None] = lambda _: None,
        rendered: bool = False,
        stages: StageTrack | None = None,
    ) -> None:
        """Append an episode of `length` steps.

        Args:
            columns: each feature but videos and indices, (T,) or (T, k), with the feature's dtype.
            task: the instruction.
            length: number of steps T.
            pictures: for each step, the picture (H, W, 3) of each video feature.
            progress: called with 1 after each step.
            rendered: pictures are being rendered, which takes longer than encoding them.
            stages: which stage each step belongs to, where the dataset has them.

        Raises:
            EncodingError: there are not T pictures; or the videos of the episode before could not be encoded, which
                nothing more can be added after.
            Exception: whatever `pictures` raises. Nothing of the episode is in the dataset then.
        """
        self._number += 1
        scratch = self.root / "encoding" / str(self._number)
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True)
        self._encoder.start_episode(self._settings, self._files.video_keys, scratch, length, takes_colours=rendered)
        given = 0
        try:
            for step in pictures:
                for key, picture in step.items():
                    self._encoder.feed(key, picture)
                given += 1
                progress(1)
            if given != length:
                raise EncodingError(f"{length} frames expected, {given} given.")
        except BaseException:
            self._encoder.cancel_episode()
            raise
        self._encoder.end_episode()
        # While this episode's last pictures are encoded, the one before is written.
        before, self._pending = self._pending, _Pending(columns, task, length, scratch, stages)
        self._complete(before)

    def finalize(self) -> None:
        """Complete the files; without this they have no footers and the dataset is lost."""
        last, self._pending = self._pending, None
        self._complete(last)
        shutil.rmtree(self.root / "encoding", ignore_errors=True)
        self._files.finalize(dict.fromkeys(self._files.video_keys, self._codec))

    def _complete(self, pending: _Pending | None) -> None:
        if pending is not None:
            videos = self._encoder.finished()
            self._files.append(pending.columns, [pending.task], pending.length, videos, stages=pending.stages)
            shutil.rmtree(pending.scratch)
