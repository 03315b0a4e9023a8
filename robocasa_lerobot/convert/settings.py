"""What a conversion is asked to do, and what follows from it for the files at hand: the plan that workers carry out."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.convert.mapping import RobotMapping, choose_mapping
from robocasa_lerobot.convert.mjcf import AssetFinder, loadable, scene_names
from robocasa_lerobot.convert.source import Demo, DemoFile, RejectedEpisodeError, SourceError
from robocasa_lerobot.errors import UnknownNameError, UserError

# Raised when the written bytes change for the same input, so that shards of an older version are not taken up again.
FORMAT_VERSION = 1
# A shard is what a kill can lose and what a worker takes at a time: some seconds of work, but never so many shards
# that joining them costs more than making them.
SHARD_FRAMES = 250
MAX_SHARDS = 64


@dataclass(frozen=True)
class ConversionSettings:
    """What the user asked for.

    `cameras` None takes the robot's own; `image_size` (pixels, square) None keeps the size of stored pictures and
    renders at the contract's size.
    """

    asset_roots: tuple[str, ...] = ()
    cameras: tuple[str, ...] | None = None
    image_size: int | None = None
    instruction: str | None = None
    video_codec: str = "h264"
    render_preset: str = "fast"
    # Of datasets of videos: encode all of them again, or those with more frames from one key frame to the next.
    reencode: bool = False
    max_gop: int = 10

    def __post_init__(self) -> None:
        if self.max_gop < 1:
            raise UserError(f"the largest key frame interval is {self.max_gop} frames; at least 1 is needed.")
        if self.image_size is not None and (self.image_size < 16 or self.image_size % 2):
            raise UserError(
                f"the image size {self.image_size} is not possible: an even number >= 16 is needed (video)."
            )
        if self.cameras is not None and (not self.cameras or len(set(self.cameras)) != len(self.cameras)):
            raise UserError(f"cameras {', '.join(self.cameras) or '(none)'}: name each camera once, and at least one.")
        if self.instruction is not None and not self.instruction.strip():
            raise UserError("the instruction is empty: give some text, or leave the option out.")


@dataclass(frozen=True)
class SourceRecord:
    """One source file as it was when the conversion was planned."""

    file: str  # as the user gave it
    sha256: str
    size_bytes: int


@dataclass(frozen=True)
class Camera:
    """One camera of the dataset and where its pictures come from."""

    name: str
    height: int
    width: int


@dataclass(frozen=True)
class Shard:
    """Consecutive demos of one file, converted by one worker in one go."""

    file: str
    demos: tuple[str, ...]


@dataclass(frozen=True)
class Plan:
    """Everything that decides the bytes of the dataset, and how the work is cut, whatever the workers."""

    settings: ConversionSettings
    sources: tuple[SourceRecord, ...]
    mapping: RobotMapping
    cameras: tuple[Camera, ...]
    fps: int
    shards: tuple[Shard, ...]
    num_frames: int  # an upper bound: rejected episodes are counted

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """LeRobotDataset features."""
        return self.mapping.features({camera.name: (camera.height, camera.width) for camera in self.cameras})

    @property
    def fingerprint(self) -> str:
        """The same for the same settings and the same source bytes."""
        text = json.dumps([FORMAT_VERSION, asdict(self.settings), [asdict(s) for s in self.sources]], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def make_plan(files: Sequence[Path], settings: ConversionSettings) -> Plan:
    """Look into every file and decide robot, cameras, rate and shards.

    Raises:
        UserError: a file is unreadable or holds no usable demo, files do not fit into one dataset, a camera is
            unknown, or meshes are missing. Nothing has been written then.
    """
    if not files:
        raise UserError("no files to convert were given.")
    doubles = {file for file in files if files.count(file) > 1}
    if doubles:
        raise UserError(f"{min(doubles)} was given more than once.")
    roots = [Path(root) for root in settings.asset_roots]
    looks = [_look(file, settings, roots) for file in files]
    first = looks[0]
    for look in looks[1:]:
        for what, ours, theirs in (
            ("robot", first.mapping.robot_type, look.mapping.robot_type),
            ("state parts", first.mapping.state_parts, look.mapping.state_parts),
            ("action parts", first.mapping.action_parts, look.mapping.action_parts),
            ("rate in Hz", first.fps, look.fps),
            ("cameras", first.cameras, look.cameras),
        ):
            if ours != theirs:
                raise UserError(
                    f"{look.file} and {first.file} do not fit into one dataset: {what} {theirs} against {ours}. "
                    "Convert them into datasets of their own, or choose the same cameras and size for both."
                )
    num_frames = sum(length for look in looks for _, length in look.demos)
    target = max(SHARD_FRAMES, -(-num_frames // MAX_SHARDS))
    shards = [shard for look in looks for shard in _cut(look, target)]
    sources = tuple(SourceRecord(str(look.file), file_sha256(look.file), look.file.stat().st_size) for look in looks)
    return Plan(settings, sources, first.mapping, first.cameras, first.fps, tuple(shards), num_frames)


def file_sha256(file: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True)
class _Look:
    file: Path
    mapping: RobotMapping
    cameras: tuple[Camera, ...]
    fps: int
    demos: tuple[tuple[str, int], ...]  # name, number of steps (0 where it will be rejected)


def _look(path: Path, settings: ConversionSettings, roots: Sequence[Path]) -> _Look:
    with DemoFile(path) as file:
        reasons, demos = [], []
        sample: Demo | None = None
        for name in file.demo_names:
            try:
                demo = file.demo(name)
                demos.append((name, demo.length))
                sample = sample or demo
            except RejectedEpisodeError as error:
                demos.append((name, 0))
                reasons.append(f"{name}: {error}")
        if sample is None:
            raise SourceError(f"{path} has no usable demo; {reasons[0]} Record it again, or leave the file out.")
        try:
            mapping = choose_mapping(file, sample)
            cameras = _cameras(file, sample, mapping, settings)
            if needs_scene(sample, mapping, [camera.name for camera in cameras]):
                if sample.model_xml is None or sample.states is None:
                    lacking = "model_file attribute" if sample.model_xml is None else "states"
                    raise SourceError(
                        f"{path}: {sample.name} has no {lacking}, which is needed to render "
                        f"{', '.join(c.name for c in cameras)} or to compute the robot's state. "
                        f"Stored pictures: {', '.join(sample.image_cameras) or 'none'} (choose with --cameras)."
                    )
                loadable(sample.model_xml, AssetFinder(roots, file.asset))
        except RejectedEpisodeError as error:
            raise SourceError(f"{path}: {sample.name} cannot be used: {error}") from None
        return _Look(path, mapping, cameras, file.control_hz, tuple(demos))


def needs_scene(demo: Demo, mapping: RobotMapping, cameras: Sequence[str]) -> bool:
    """Whether pictures must be rendered or the state computed, so that the MJCF has to be loaded."""
    return mapping.recorded_states(demo) is None or any(camera not in demo.image_cameras for camera in cameras)


def _cameras(file: DemoFile, demo: Demo, mapping: RobotMapping, settings: ConversionSettings) -> tuple[Camera, ...]:
    in_scene = scene_names(demo.model_xml).cameras if demo.model_xml else ()
    available = tuple(dict.fromkeys((*demo.image_cameras, *in_scene)))
    cameras = []
    for name in settings.cameras or mapping.default_cameras:
        if name not in available:
            raise UnknownNameError("camera", name, available, f"({file.path}; choose with --cameras)")
        size = settings.image_size
        height, width = (size, size) if size is not None else (contract.IMAGE_SIZE, contract.IMAGE_SIZE)
        if name in demo.image_cameras and size is None:
            height, width = demo.image_shape(name)
            if height % 2 or width % 2:
                raise SourceError(
                    f"{file.path}: {name} is {height}x{width}; video needs even sizes: give --image-size."
                )
        cameras.append(Camera(name, height, width))
    if not cameras:
        raise SourceError(f"{file.path} has no cameras.")
    return tuple(cameras)


def _cut(look: _Look, target: int) -> list[Shard]:
    shards, names, frames = [], [], 0
    for name, length in look.demos:
        names.append(name)
        frames += length
        if frames >= target:
            shards.append(Shard(str(look.file), tuple(names)))
            names, frames = [], 0
    if names:
        shards.append(Shard(str(look.file), tuple(names)))
    return shards
