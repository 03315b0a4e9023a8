"""A dataset's episodes drawn again from their kept states: other cameras, sizes or presets, everything else as it was.

Only the pictures are made anew. Tables of data and tasks, extras and our records are copied as they are; the entries of
the episodes, `info.json`, `stats.json` and `modality.json` change in what they say of pictures.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.convert.lerobot_v3 import ExportedDataset, ExportedEpisode
from robocasa_lerobot.convert.reading.demo_file import RejectedEpisodeError
from robocasa_lerobot.convert.reading.extras import read_scene, read_states
from robocasa_lerobot.convert.reading.inputs import check_image_size
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable, scene_names
from robocasa_lerobot.convert.record_files import EXTRAS, kept_assets
from robocasa_lerobot.convert.rerender.camera_configs import check_camera_configs, with_cameras
from robocasa_lerobot.convert.scenes.prefetch import ScenesAhead
from robocasa_lerobot.convert.settings import SHARD_FRAMES, Camera, shard_frames
from robocasa_lerobot.convert.writing.encoder import CODECS
from robocasa_lerobot.errors import UnknownNameError, UserError

# Raised when the written bytes change for the same input.
RENDER_VERSION = 2
SOURCE_FORMAT = "LeRobotDataset v3.0, rendered again"
_RECORD = "meta/robocasa/conversion.json"


@dataclass(frozen=True)
class RenderSettings:
    """What the user asked for.

    `cameras` None takes those of the dataset; `image_size` (pixels, square) None their size; `cam_configs` is the JSON
    text of cameras to move or add (`camera_configs.read_camera_configs`).
    """

    cameras: tuple[str, ...] | None = None
    image_size: int | None = None
    render_preset: str = "fast"
    video_codec: str = "h264"
    cam_configs: str = "{}"
    asset_roots: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_image_size(self.image_size)
        if self.cameras is not None and (not self.cameras or len(set(self.cameras)) != len(self.cameras)):
            raise UserError(f"cameras {', '.join(self.cameras) or '(none)'}: name each camera once, and at least one.")
        if self.video_codec not in CODECS:
            raise UnknownNameError("video codec", self.video_codec, CODECS)
        configs = check_camera_configs(json.loads(self.cam_configs))
        object.__setattr__(self, "cam_configs", json.dumps(configs, sort_keys=True))


@dataclass(frozen=True)
class RenderPlan:
    """Everything that decides the bytes of the new dataset, and how the work is cut: episodes by number."""

    settings: RenderSettings
    source: Path
    stamp: str
    cameras: tuple[Camera, ...]
    pieces: tuple[tuple[int, ...], ...]
    num_frames: int

    @cached_property
    def dataset(self) -> ExportedDataset:
        """The dataset that is rendered again."""
        return ExportedDataset(self.source)

    @property
    def fingerprint(self) -> str:
        """The same for the same settings and the same untouched dataset."""
        text = json.dumps([RENDER_VERSION, asdict(self.settings), self.stamp], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "dataset"}


def make_render_plan(source: Path, settings: RenderSettings) -> RenderPlan:
    """Look at a dataset and decide cameras and pieces.

    Raises:
        UserError: it is no LeRobotDataset v3.0, an episode lacks its model or states, a camera is in no scene, or
            meshes are missing. Nothing has been written then.
    """
    source = source.absolute()
    dataset = ExportedDataset(source)
    # Cameras that an earlier rendering moved or added stay where it put them, in all that is not said anew.
    earlier, now = _record(source).get("settings", {}).get("cam_configs", {}), json.loads(settings.cam_configs)
    merged = {name: earlier.get(name, {}) | now.get(name, {}) for name in earlier | now}
    settings = replace(settings, cam_configs=json.dumps(merged, sort_keys=True))
    for episode in dataset.episodes:
        for name in ("model.xml.gz", "states.npz"):
            if not (dataset.extras(episode) / name).is_file():
                raise UserError(
                    f"episode {episode.index} of {source} cannot be rendered: {dataset.extras(episode) / name} is not "
                    "there. Datasets keep it where `convert` had states and model_file; convert the recording again."
                )
    cameras = _cameras(dataset, settings)
    plan = RenderPlan(settings, source, _stamp(source), cameras, (), 0)
    try:
        xml, _ = ExportedScene.of(plan, dataset.episodes[0])()
    except RejectedEpisodeError as error:
        raise UserError(f"episode {dataset.episodes[0].index} of {source} cannot be rendered: {error}") from None
    known = scene_names(xml).cameras
    for camera in cameras:
        if camera.name not in known:
            raise UnknownNameError("camera", camera.name, known, "(describe a new one with --cam-configs FILE)")
    num_frames = sum(episode.length for episode in dataset.episodes)
    pieces = _cut(dataset.episodes, shard_frames(num_frames, SHARD_FRAMES))
    return RenderPlan(settings, source, plan.stamp, cameras, pieces, num_frames)


@dataclass(frozen=True)
class ExportedScene:
    """Where the scene of an episode is found; calling it gives the loadable MJCF and its files, as `loadable` does."""

    file: Path
    cam_configs: str
    asset_roots: tuple[Path, ...]

    @classmethod
    def of(cls, plan: RenderPlan, episode: ExportedEpisode) -> Self:
        """Of an episode of the dataset that is rendered again."""
        file = plan.dataset.extras(episode) / "model.xml.gz"
        return cls(file, plan.settings.cam_configs, tuple(_asset_roots(plan, episode)))

    def __call__(self) -> tuple[str, dict[str, bytes]]:
        """Read the MJCF, put its cameras in place, and find its files.

        Raises:
            RejectedEpisodeError: it cannot be read, or as `loadable`.
            MissingAssetsError: as `loadable`.
        """
        xml = with_cameras(read_scene(self.file), json.loads(self.cam_configs))
        return loadable(xml, AssetFinder(self.asset_roots))


class EpisodePictures:
    """The pictures of one episode, rendered step by step; use it in a `with` block.

    Its scene is taken from `ahead`, if that has it.

    Raises:
        RejectedEpisodeError: its model or states cannot be used.
        MissingAssetsError: meshes or textures were not found.
    """

    def __init__(self, plan: RenderPlan, episode: ExportedEpisode, ahead: ScenesAhead | None = None) -> None:
        from robocasa_lerobot.convert.render import Scene
        from robocasa_lerobot.convert.scenes.compiled import CompiledScene

        self._cameras = plan.cameras
        self.states = read_states(plan.dataset.extras(episode) / "states.npz", episode.length)
        source = ExportedScene.of(plan, episode)
        compiled = ahead.take(source) if ahead is not None else None
        self._scene = Scene(compiled or CompiledScene.of(*source(), preset=plan.settings.render_preset))

    def __enter__(self) -> EpisodePictures:
        return self

    def __exit__(self, *_: object) -> None:
        self._scene.close()

    def __iter__(self) -> Iterator[dict[str, NDArray[np.uint8]]]:
        for step in range(len(self.states)):
            yield self.at(step)

    def at(self, step: int) -> dict[str, NDArray[np.uint8]]:
        """For each video feature, the picture (H, W, 3) at a step."""
        self._scene.set_state(self.states[step])
        pictures = self._scene.pictures(self._cameras)
        return {contract.image_key(camera.name): pictures[camera.name] for camera in self._cameras}


def _asset_roots(plan: RenderPlan, episode: ExportedEpisode) -> list[Path]:
    """Where the files of an episode's scene may be: what its source held, the user's folders, the recorded ones."""
    record = recorded(plan.source)
    kept = [
        plan.source / EXTRAS / kept_assets(str(source.get("sha256")))
        for source in record.get("sources", [])
        if source.get("file") == episode.source_file
    ]
    before = [Path(root) for root in record.get("settings", {}).get("asset_roots", [])]
    given = [Path(root) for root in plan.settings.asset_roots]
    return [*(root for root in kept if root.is_dir()), *given, *(root for root in before if root.is_dir())]


def recorded(root: Path) -> dict[str, Any]:
    """How a dataset was converted, empty where this project did not write it; of the first one, if rendered again."""
    record = _record(root)
    while "source_conversion" in record:
        record = record["source_conversion"]
    return record


def _record(root: Path) -> dict[str, Any]:
    file = root / _RECORD
    return dict(json.loads(file.read_text(encoding="utf-8"))) if file.is_file() else {}


def _cameras(dataset: ExportedDataset, settings: RenderSettings) -> tuple[Camera, ...]:
    named = settings.cameras
    if named is None:
        added = [name for name in json.loads(settings.cam_configs) if name not in dataset.cameras]
        named = (*dataset.cameras, *added)
    if not named:
        raise UserError(f"{dataset.root} has no cameras: name them with --cameras.")
    cameras = []
    for name in named:
        height = width = settings.image_size or contract.IMAGE_SIZE
        if settings.image_size is None and name in dataset.cameras:
            height, width, _ = dataset.features[dataset.cameras[name]]["shape"]
        cameras.append(Camera(name, height, width))
    return tuple(cameras)


def _cut(episodes: Sequence[ExportedEpisode], target: int) -> tuple[tuple[int, ...], ...]:
    pieces: list[tuple[int, ...]] = []
    numbers: list[int] = []
    frames = 0
    for episode in episodes:
        numbers.append(episode.index)
        frames += episode.length
        if frames >= target:
            pieces.append(tuple(numbers))
            numbers, frames = [], 0
    return (*pieces, tuple(numbers)) if numbers else tuple(pieces)


def _stamp(root: Path) -> str:
    """Changes when any file of the dataset but its videos is touched."""
    digest = hashlib.sha256((root / "meta" / "info.json").read_bytes())
    for folder in ("meta", "data", EXTRAS):
        for file in sorted((root / folder).rglob("*")):
            if file.is_file():
                status = file.stat()
                digest.update(f"{file.relative_to(root)} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()
