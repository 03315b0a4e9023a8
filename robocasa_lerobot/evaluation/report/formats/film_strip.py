"""Films for the report: a few frames of a trial's video as pictures, and the video itself, small enough to embed."""

from __future__ import annotations

import base64
import io
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.report.model import Film, Frame
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.video import DamagedVideoError, frames_and_rate, spread_frames

FRAMES = 6
JPEG_QUALITY = 80
# A page that is mailed and opened on a phone: pictures and films together stay below this, text and charts aside.
BUDGET_BYTES = 8_000_000
MAX_FILMS = 12
CLIP_SECONDS = 12.0
CLIP_FPS = 10
CLIP_HEIGHT = 240


def choose_films(data: ReportData, embed: bool = True, budget: int = BUDGET_BYTES) -> list[Film]:
    """Successes and failures of as many tasks as fit the budget; each of the last policy that has one filmed.

    The most trained policy is last. A success and a failure of one task are taken together; tasks are taken in turn
    over the whole list, so that films do not all come from its beginning.
    """
    found = [(task, chosen) for task in data.task_names if (chosen := _chosen(data.single, task))]
    # Tasks with both a success and a failure first.
    found.sort(key=lambda pair: -len(pair[1]))
    step = max(1, len(found) // max(1, MAX_FILMS // 2))
    films: list[Film] = []
    paths, spent = [], 0
    for policy, record in [one for _, chosen in found[::step] for one in chosen][:MAX_FILMS]:
        try:
            film = _film(policy, record)
        except DamagedVideoError:  # as one that is missing
            continue
        size = sum(len(frame.uri) for frame in film.frames)
        if spent + size > budget:
            break
        films.append(film)
        paths.append(policy.folder / str(record.video))
        spent += size
    # Pictures of every film come before the moving picture of any.
    for index, path in enumerate(paths if embed else []):
        video, speed = clip(path)
        if spent + len(video) <= budget:
            films[index] = replace(films[index], video=video, speed=speed)
            spent += len(video)
    return films


def _chosen(policies: Sequence[PolicyResult], task: str) -> list[tuple[PolicyResult, TrialRecord]]:
    out = []
    for success in (True, False):
        for policy in reversed(policies):
            record = _first_filmed(policy, task, success)
            if record is not None:
                out.append((policy, record))
                break
    return out


def _first_filmed(policy: PolicyResult, task: str, success: bool) -> TrialRecord | None:
    result = policy.task(task)
    for record in result.trials if result else ():
        if record.success is success and record.video is not None and (policy.folder / record.video).is_file():
            return record
    return None


def _film(policy: PolicyResult, record: TrialRecord) -> Film:
    facts = [f"seed {record.seed}"]
    facts += [f"layout {record.layout_id}, style {record.style_id}"] if record.layout_id is not None else []
    facts += [f"{record.steps} steps"]
    facts += [f"{name.replace('_', ' ')}: {'met' if term.final else 'not met'}" for name, term in record.terms.items()]
    return Film(
        title=f"{record.task} · {policy.label}, trial {record.trial}",
        success=record.success,
        facts=" · ".join(facts),
        instruction=record.instruction,
        frames=tuple(make_frames(policy.folder / str(record.video))),
    )


def make_frames(video: Path, count: int = FRAMES) -> list[Frame]:
    """`count` evenly spaced frames of a video, the first and the last among them."""
    return [Frame(second, data_uri(stack_cameras(picture))) for second, picture in spread_frames(video, count)]


def clip(video: Path) -> tuple[str, float]:
    """The video as an mp4 data URI of at most CLIP_SECONDS, and how many times faster than real time it is.

    A longer one is sped up by leaving frames out, never cut: its end is what a failure is about.
    """
    import av

    total, rate = frames_and_rate(video)
    speed = max(1.0, total / rate / CLIP_SECONDS)
    count = max(1, min(total, round(total / rate / speed * CLIP_FPS)))
    wanted = {round(i * (total - 1) / max(1, count - 1)) for i in range(count)}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip.mp4"
        options = {"movflags": "+faststart"}
        with av.open(str(video)) as source, av.open(str(path), mode="w", options=options) as target:
            stream = target.add_stream("libx264", rate=Fraction(CLIP_FPS))
            stream.options = {"crf": "31", "preset": "slow"}
            stream.pix_fmt = "yuv420p"
            kept = 0
            for index, frame in enumerate(source.decode(video=0)):
                if index not in wanted:
                    continue
                scale = min(1.0, CLIP_HEIGHT / frame.height)
                width, height = (max(2, round(side * scale / 2) * 2) for side in (frame.width, frame.height))
                if kept == 0:
                    stream.width, stream.height = width, height
                picture = frame.reformat(stream.width, stream.height, "yuv420p")
                picture.pts, picture.time_base = kept, Fraction(1, CLIP_FPS)
                target.mux(stream.encode(picture))
                kept += 1
            target.mux(stream.encode())
        encoded = base64.b64encode(path.read_bytes()).decode()
    return "data:video/mp4;base64," + encoded, total / rate / (kept / CLIP_FPS)


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
