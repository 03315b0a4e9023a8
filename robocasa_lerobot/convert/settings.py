"""What a conversion is asked to do, and what follows from it for the files at hand: the plan that workers carry out."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.convert.mapping.custom import parse_mapping
from robocasa_lerobot.convert.mapping.instruction import instruction_of, template_fields
from robocasa_lerobot.convert.mapping.robot_mapping import RobotMapping
from robocasa_lerobot.convert.mapping.robots import choose_mapping
from robocasa_lerobot.convert.reading.decisions import decisions_of
from robocasa_lerobot.convert.reading.demo import Demo, RejectedEpisodeError, SourceError
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.inputs import check_image_size
from robocasa_lerobot.convert.reading.layout import ACTION_KEYS, Layout
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable, scene_names
from robocasa_lerobot.convert.reading.safe_scan import survey
from robocasa_lerobot.convert.reading.selection import check_selection, select
from robocasa_lerobot.convert.reading.stages import has_stages
from robocasa_lerobot.convert.writing.stages import stage_features
from robocasa_lerobot.errors import UnknownNameError, UserError

# Raised when the written bytes change for the same input, so that shards of an older version are not taken up again.
FORMAT_VERSION = 5
_STAGES_VERSION = 1  # the same for datasets with stages
# A shard is what a kill can lose and what a worker takes at a time: some seconds of work, but never so many shards
# that joining them costs more than making them.
SHARD_FRAMES = 1000
_MIN_SHARD_FRAMES = 125
_WANTED_SHARDS = 4  # of little work, so that several processes have something to do
MAX_SHARDS = 64
# Starting a worker imports LeRobot and MuJoCo (about 6 s of CPU time); below this much work that does not pay: 3,150
# frames took as long with two workers as with one.
MIN_FRAMES_PER_WORKER = 2000
# A worker draws in one process and encodes in another: on two cores a second one made conversion from states 11 %
# slower, and that of stored pictures 3 % faster (`benchmarks/results/convert_speed.json`).
CORES_PER_WORKER = 2
_MAX_FAILURES = 10  # demos without a known robot, camera or mesh, after which no other is tried
_ASSUMED = "are assumed (another one: `inspect --draft-mapping`, `convert --mapping`)"


@dataclass(frozen=True)
class ConversionSettings:
    """What the user asked for.

    `cameras` None takes the robot's own; `image_size` (pixels, square) None keeps the size of stored pictures and
    renders at the contract's size. `instruction` may be a template (`instruction.py`), and comes before a recorded one
    with `replace_instruction`. `filter_key`, `demos` and `demos_seed` select episodes (`selection.py`). `extra_columns`
    are HDF5 paths below an episode; who decided each step (`reading/decisions.py`) is taken along without being named
    where all demos say it. `mapping` is the JSON text of a mapping file (`custom_mapping.read_mapping`).
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
    replace_instruction: bool = False
    filter_key: str | None = None
    demos: str | None = None
    demos_seed: int = 0
    action_key: str = "actions"
    extra_columns: tuple[str, ...] = ()
    mapping: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "extra_columns", tuple(self.extra_columns))  # a list where it comes from JSON
        if self.max_gop < 1:
            raise UserError(f"the largest key frame interval is {self.max_gop} frames; at least 1 is needed.")
        check_image_size(self.image_size)
        if self.cameras is not None and (not self.cameras or len(set(self.cameras)) != len(self.cameras)):
            raise UserError(f"cameras {', '.join(self.cameras) or '(none)'}: name each camera once, and at least one.")
        if self.instruction is not None and not self.instruction.strip():
            raise UserError("the instruction is empty: give some text, or leave the option out.")
        if self.instruction is not None:
            template_fields(self.instruction)
        check_selection(self.filter_key, self.demos)
        if self.action_key not in ACTION_KEYS:
            raise UnknownNameError("action key", self.action_key, ACTION_KEYS)
        if self.mapping is not None and self.action_key != ACTION_KEYS[0]:
            raise UserError("--action-key and --mapping exclude each other: the mapping file names the actions' keys.")
        for key in self.extra_columns:
            if key.startswith("/") or any(piece in ("", ".", "..") for piece in key.split("/")):
                raise UserError(f"extra column {key!r}: a path below an episode is needed, such as obs/object.")
        if len(set(self.extra_columns)) != len(self.extra_columns):
            raise UserError("extra columns: name each once.")

    @property
    def layout(self) -> Layout:
        """How HDF5 files are read."""
        layout = parse_mapping(self.mapping) if self.mapping is not None else Layout(action_key=self.action_key)
        return replace(layout, extra_columns=self.extra_columns, model_roots=self.asset_roots)

    def select(self, file: DemoFile) -> tuple[str, ...]:
        """Names of the demos of a file that are converted."""
        return select(file, self.filter_key, self.demos, self.demos_seed)


@dataclass(frozen=True)
class SourceRecord:
    """One source file as it was when the conversion was planned."""

    file: str  # as the user gave it
    sha256: str
    size_bytes: int
    demos: tuple[str, ...] | None = None  # those selected, None for all


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
    rejected: tuple[tuple[str, str], ...] = ()  # those of them that are not to be opened, and why
    mapping: RobotMapping | None = None  # of its own file: equal parts may stand elsewhere in another one


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
    stages: bool = field(default=False, kw_only=True)  # whether any source says which stage its steps belong to
    notes: tuple[str, ...] = field(default=(), kw_only=True)  # for the user: what was assumed, left out or changed

    @property
    def features(self) -> dict[str, dict[str, Any]]:
        """LeRobotDataset features."""
        features = self.mapping.features({camera.name: (camera.height, camera.width) for camera in self.cameras})
        return features | (stage_features() if self.stages else {})

    @property
    def fingerprint(self) -> str:
        """The same for the same settings and the same source bytes."""
        content = [FORMAT_VERSION, asdict(self.settings), [asdict(s) for s in self.sources]]
        text = json.dumps([*content, _STAGES_VERSION] if self.stages else content, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def make_plan(files: Sequence[Path], settings: ConversionSettings) -> Plan:
    """Look into every file and decide robot, cameras, rate and shards.

    Raises:
        UserError: a file is unreadable or holds no usable demo, files do not fit into one dataset, a camera is
            unknown, or meshes are missing. Nothing has been written then.
    """
    check_request(files, settings)
    roots = [Path(root) for root in settings.asset_roots]
    with ThreadPoolExecutor(1) as pool:
        hashes = [pool.submit(file_sha256, file) for file in files]  # meanwhile they are looked into
        try:
            looks = [_look(file, settings, roots) for file in files]
            told = [key for key in looks[0].decisions if all(key in look.decisions for look in looks)]
            if more := tuple(key for key in told if key not in settings.extra_columns):
                settings = replace(settings, extra_columns=(*settings.extra_columns, *more))
                looks = [_look(file, settings, roots) for file in files]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        sources = tuple(_source(look, digest.result()) for look, digest in zip(looks, hashes, strict=True))
    copies = _copies(looks)
    first = looks[0]
    for look in looks[1:]:
        for what, ours, theirs in (
            ("robot", first.mapping.robot_type, look.mapping.robot_type),
            ("state parts", first.mapping.state_parts, look.mapping.state_parts),
            ("action parts", first.mapping.action_parts, look.mapping.action_parts),
            ("extra columns", first.mapping.extra_columns, look.mapping.extra_columns),
            ("rate in Hz", first.fps, look.fps),
            ("cameras", first.cameras, look.cameras),
        ):
            if ours != theirs:
                raise UserError(
                    f"{look.file} and {first.file} do not fit into one dataset: {what} {theirs} against {ours}. "
                    "Convert them into datasets of their own, or choose the same cameras and size for both."
                )
    num_frames = sum(length for look in looks for _, length in look.demos)
    target = shard_frames(num_frames, SHARD_FRAMES)
    shards = [shard for look in looks for shard in _cut(look, target, copies)]
    return Plan(
        settings,
        sources,
        first.mapping,
        first.cameras,
        first.fps,
        tuple(shards),
        num_frames,
        stages=any(look.stages for look in looks),
        notes=tuple(f"{look.file} tells no rate: {look.fps} Hz {_ASSUMED}" for look in looks if look.rate_is_assumed),
    )


def check_request(files: Sequence[Path], settings: ConversionSettings) -> None:
    """What can be said before any file is opened, of HDF5 files and dataset folders.

    Raises:
        UserError: there are no files, one was given twice, or there is no instruction to replace the recorded ones.
    """
    if not files:
        raise UserError("no files to convert were given.")
    doubles = {file for file in files if files.count(file) > 1}
    if doubles:
        raise UserError(f"{min(doubles)} was given more than once.")
    robot = settings.layout.robot
    if settings.replace_instruction and settings.instruction is None and (robot is None or not robot.instruction.text):
        raise UserError("--replace-instruction has nothing to take instead: give --instruction TEXT, or leave it out.")


def shard_frames(num_frames: int, most: int) -> int:
    """How many frames go into a shard of so many in all: `most`, fewer of little work, more of very much."""
    few = max(_MIN_SHARD_FRAMES, num_frames // _WANTED_SHARDS)
    return max(min(most, few), -(-num_frames // MAX_SHARDS))


def file_sha256(file: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _source(look: _Look, sha256: str) -> SourceRecord:
    selected = None if look.all_demos else tuple(name for name, _ in look.demos)
    return SourceRecord(str(look.file), sha256, look.file.stat().st_size, selected)


@dataclass(frozen=True)
class _Look:
    file: Path
    mapping: RobotMapping
    cameras: tuple[Camera, ...]
    fps: int
    demos: tuple[tuple[str, int], ...]  # name, number of steps (0 where it will be rejected)
    strays: dict[str, str]  # groups that are not named as demos are, and why they are none
    all_demos: bool
    traps: dict[str, str]  # demos that end the process that reads them, and how
    digests: dict[str, str]  # of whole demos
    stages: bool  # whether a demo says which stage its steps belong to
    decisions: tuple[str, ...]  # what all demos say about who decided
    rate_is_assumed: bool


def _look(path: Path, settings: ConversionSettings, roots: Sequence[Path]) -> _Look:
    if not path.is_file():
        DemoFile(path)  # names the mistake
    layout = settings.layout
    found = survey(path, layout.episodes)
    with DemoFile(path, layout) as file:
        demos: list[tuple[str, int]] = []
        widths: dict[str, int] = {}
        reasons: list[str] = []
        selected = settings.select(file)
        traps = {name: reason for name in selected if (reason := found.reason(file.place(name)))}
        for name in selected:
            try:
                if name in traps:
                    raise RejectedEpisodeError(traps[name])
                demo = file.demo(name)
                demos.append((name, demo.length))
                widths[name] = demo.actions.shape[1]
            except RejectedEpisodeError as error:
                demos.append((name, 0))
                reasons.append(f"{name}: {error}")
        if not widths:
            raise SourceError(f"{path} has no usable demo; {reasons[0]} Record it again, or leave the file out.")
        mapping, cameras = _robot_and_cameras(file, widths, settings, roots)
        digests = {name: found.digests[file.place(name)] for name in widths if file.place(name) in found.digests}
        all_demos = len(selected) == len(file.demo_names)
        # Who names demos has not asked for others.
        strays = file.strays() if settings.filter_key is None and settings.demos is None else {}
        stages = any(has_stages(file.demo(name)) for name in widths)
        decisions = decisions_of(file.demo(name) for name in widths)
        return _Look(
            *(path, mapping, cameras, file.control_hz, tuple(demos), strays, all_demos, traps, digests, stages),
            decisions,
            file.rate_is_assumed,
        )


def _robot_and_cameras(
    file: DemoFile, widths: dict[str, int], settings: ConversionSettings, roots: Sequence[Path]
) -> tuple[RobotMapping, tuple[Camera, ...]]:
    """Judged by the first good demo of those with the most frequent number of actions."""
    usual = Counter(widths.values()).most_common(1)[0][0]
    failure: UserError | None = None
    failures = 0
    for name in (name for name, width in widths.items() if width == usual):
        try:
            return _judge(file, file.demo(name), settings, roots)
        except RejectedEpisodeError as error:
            failure = failure or SourceError(f"{file.path}: {name} cannot be used: {error}")
        except UserError as error:  # more likely about the whole file
            failure, failures = error if failures == 0 else failure, failures + 1
            if failures == _MAX_FAILURES:
                break
    assert failure is not None
    raise failure


def _judge(
    file: DemoFile, sample: Demo, settings: ConversionSettings, roots: Sequence[Path]
) -> tuple[RobotMapping, tuple[Camera, ...]]:
    mapping = choose_mapping(file, sample)
    instruction_of(sample, file, settings.instruction, settings.replace_instruction)
    cameras = _cameras(file, sample, mapping, settings)
    if needs_scene(sample, mapping, [camera.name for camera in cameras]):
        if sample.model_xml is None or sample.states is None:
            lacking = "model_file attribute" if sample.model_xml is None else "states"
            raise SourceError(
                f"{file.path}: {sample.name} has no {lacking}, which is needed to render "
                f"{', '.join(c.name for c in cameras)} or to compute the robot's state. "
                f"Stored pictures: {', '.join(sample.image_cameras) or 'none'} (choose with --cameras)."
            )
        loadable(sample.model_xml, AssetFinder(roots, file.asset))
    return mapping, cameras


def _copies(looks: Sequence[_Look]) -> dict[tuple[Path, str], str]:
    """For each demo (file, name) that is a copy of an earlier one: a sentence that names that one."""
    first: dict[str, tuple[Path, str]] = {}
    copies: dict[tuple[Path, str], str] = {}
    for look in looks:
        for name, digest in look.digests.items():
            file, earlier = first.setdefault(digest, (look.file, name))
            if (file, earlier) != (look.file, name):
                where = earlier if file == look.file else f"{earlier} of {file}"
                copies[look.file, name] = f"it is a copy of {where}: numbers, attributes and first pictures are equal."
    return copies


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


def _cut(look: _Look, target: int, copies: Mapping[tuple[Path, str], str]) -> list[Shard]:
    rejected = look.traps | {name: reason for (file, name), reason in copies.items() if file == look.file} | look.strays
    shards: list[Shard] = []
    names = list(look.strays)
    frames = 0
    for position, (name, length) in enumerate(look.demos, start=1):
        names.append(name)
        frames += length
        if frames >= target or position == len(look.demos):
            reasons = tuple((name, rejected[name]) for name in names if name in rejected)
            shards.append(Shard(str(look.file), tuple(names), reasons, look.mapping))
            names, frames = [], 0
    return shards
