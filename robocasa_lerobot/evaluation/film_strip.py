"""Film strips for the report: a few frames of a trial's video, as JPEG data URIs."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.evaluation.report_data import PolicyResult
from robocasa_lerobot.evaluation.results import TrialRecord
from robocasa_lerobot.evaluation.video import frames_and_rate, read_frames

FRAMES = 6
JPEG_QUALITY = 82


@dataclass(frozen=True)
class Frame:
    """A moment of a trial: seconds of simulated time since the reset, and the picture as a data URI."""

    seconds: float
    uri: str


@dataclass(frozen=True)
class FilmStrip:
    """Moments of one filmed trial."""

    label: str
    record: TrialRecord
    frames: tuple[Frame, ...]


def choose_strips(policies: Sequence[PolicyResult], task: str) -> list[FilmStrip]:
    """A success and a failure on `task`, of the last policy that has one filmed (the most trained one is last)."""
    strips = []
    for success in (True, False):
        for policy in reversed(policies):
            strip = _first_strip(policy, task, success)
            if strip is not None:
                strips.append(strip)
                break
    return strips


def _first_strip(policy: PolicyResult, task: str, success: bool) -> FilmStrip | None:
    result = policy.task(task)
    for record in result.trials if result else ():
        if record.success is success and record.video is not None and (policy.folder / record.video).is_file():
            return FilmStrip(policy.label, record, tuple(make_frames(policy.folder / record.video)))
    return None


def make_frames(video: Path, count: int = FRAMES) -> list[Frame]:
    """`count` evenly spaced frames of a video, the first and the last among them."""
    total, rate = frames_and_rate(video)
    indices = sorted({round(i * (total - 1) / max(1, count - 1)) for i in range(min(count, total))})
    pictures = read_frames(video, indices)
    return [
        Frame(index / rate, data_uri(stack_cameras(picture))) for index, picture in zip(indices, pictures, strict=True)
    ]


def stack_cameras(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A side-by-side frame with the left view above the wrist view (the right view is left out to save space)."""
    height, width = picture.shape[:2]
    cameras = np.array_split(picture, max(1, round(width / height)), axis=1)
    shown = [cameras[0], cameras[-1]] if len(cameras) > 1 else cameras
    narrow = min(camera.shape[1] for camera in shown)
    return np.concatenate([camera[:, :narrow] for camera in shown], axis=0)


def data_uri(picture: NDArray[np.uint8]) -> str:
    """A picture (H, W, 3) as a JPEG data URI."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="JPEG", quality=JPEG_QUALITY, optimize=True)
    return "data:image/jpeg;base64," + base64.b64encode(buffer.getvalue()).decode()
