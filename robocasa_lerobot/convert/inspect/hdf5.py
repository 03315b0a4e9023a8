"""What an HDF5 file of demonstrations holds, of whatever layout: found by its structure, nothing converted."""

from __future__ import annotations

import contextlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot.convert.mapping.instruction import instruction_of
from robocasa_lerobot.convert.mapping.robot_mapping import RobotMapping
from robocasa_lerobot.convert.mapping.robots import choose_mapping
from robocasa_lerobot.convert.reading.demo import Demo
from robocasa_lerobot.convert.reading.demo_file import WHOLE_FILE, DemoFile
from robocasa_lerobot.convert.reading.hdf5 import RejectedEpisodeError
from robocasa_lerobot.convert.reading.layout import ABSOLUTE_ACTIONS, ACTION_KEYS, ACTIONS, DEFAULT_EPISODES, Layout
from robocasa_lerobot.convert.reading.mjcf import scene_names
from robocasa_lerobot.convert.reading.safe_scan import Survey, survey
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

_ACTION = re.compile(r"(^|/)actions?$")
_MAX_DEPTH = 3  # groups below the file in which episodes are looked for
_SHOWN_TEXT = 300  # characters of an attribute


@dataclass(frozen=True)
class DatasetShape:
    """A dataset below an episode: its shape in the first one, and in how many episodes it is."""

    shape: tuple[int, ...]
    dtype: str
    episodes: int


@dataclass
class FileReport:
    """What a file holds; `layout` is None where no episodes were found, `mapping` where no robot was recognised."""

    file: str
    size_bytes: int
    groups: tuple[str, ...]
    attributes: dict[str, Any] = field(default_factory=dict)
    layout: Layout | None = None
    env_name: str = "unknown"
    episodes: list[str] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    datasets: dict[str, DatasetShape] = field(default_factory=dict)
    episode_attributes: dict[str, str] = field(default_factory=dict)
    cameras: dict[str, tuple[int, ...]] = field(default_factory=dict)  # stored: key -> shape
    scene_cameras: tuple[str, ...] = ()
    masks: dict[str, int] = field(default_factory=dict)
    instructions: dict[str, int] = field(default_factory=dict)
    instruction_sources: dict[str, int] = field(default_factory=dict)
    fps: int | None = None
    fps_is_assumed: bool = False
    mapping: RobotMapping | None = None
    no_mapping: str = ""
    problems: dict[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return asdict(self)


def inspect_hdf5(path: Path) -> FileReport:
    """Look into an HDF5 file.

    Raises:
        SourceError: it cannot be read as HDF5.
    """
    found = survey(path) if path.is_file() else Survey()
    layout, groups = _find_layout(path, found)
    report = FileReport(str(path), path.stat().st_size, groups, layout=layout)
    if layout is None:
        return report
    with DemoFile(path, layout) as file:
        report.attributes = {key: _shortened(value) for key, value in file.attributes.items()}
        report.env_name = file.env_name
        report.episodes = list(file.demo_names)
        try:
            report.masks = {key: len(file.mask(key)) for key in file.masks}
        except UserError as error:
            report.problems["mask"] = str(error)
        try:
            report.fps, report.fps_is_assumed = file.control_hz, file.rate_is_assumed
        except UserError as error:
            report.problems["rate"] = str(error)
        sample = _walk(file, found, report)
        if sample is not None:
            try:
                report.scene_cameras = scene_names(sample.model_xml).cameras if sample.model_xml else ()
                report.mapping = choose_mapping(file, sample)
            except UserError as error:
                report.no_mapping = str(error)
    return report


def _walk(file: DemoFile, found: Survey, report: FileReport) -> Demo | None:
    """Note lengths, datasets and instructions of all episodes; gives the first usable one."""
    counts: Counter[str] = Counter()
    texts: Counter[str] = Counter()
    sources: Counter[str] = Counter()
    first: dict[str, tuple[tuple[int, ...], str]] = {}
    seen: dict[str, tuple[tuple[int, ...], str]] = {}  # in any episode, also such without steps
    sample: Demo | None = None
    for name in Bar(file.demo_names, unit="episode", desc="looking", leave=False):
        try:
            if trap := found.reason(file.place(name)):
                raise RejectedEpisodeError(trap)
            demo = file.demo(name)
            shapes = demo.shapes()
            counts.update(shapes.keys())
            seen = {**shapes, **seen}
            rows = shapes.get(file.layout.action_key, ((0,), ""))[0]
            if not rows or rows[0] == 0:
                raise RejectedEpisodeError(f"it has no steps in {file.layout.action_key!r}.")
            first = {**shapes, **first}
            report.lengths.append(rows[0])
            if sample is None:
                sample = demo
                report.episode_attributes = demo.attribute_kinds()
        except UserError as error:
            report.problems[name] = str(error)
            continue
        try:
            instruction = instruction_of(demo, file, None)
            texts[instruction.text] += 1
            sources[instruction.source] += 1
        except UserError:
            texts["(none recorded)"] += 1
    first = {**seen, **first}
    report.datasets = {key: DatasetShape(*first[key], counts[key]) for key in sorted(first)}
    report.cameras = {key: found.shape for key, found in report.datasets.items() if is_picture(found)}
    report.instructions = dict(texts.most_common())
    report.instruction_sources = dict(sources)
    return sample


def is_picture(found: DatasetShape) -> bool:
    """Whether a dataset can be a camera's: (T, H, W, 3) uint8."""
    return len(found.shape) == 4 and found.shape[3] == 3 and found.dtype == "uint8"


def _known_actions(file: DemoFile, demos: Sequence[str]) -> str | None:
    """What the first of some groups that opens calls its actions; None where that is `action`, as others call them."""
    for demo in demos:
        with contextlib.suppress(RejectedEpisodeError):
            inside = file.members(demo)
            if "action" in inside and ACTIONS not in inside:
                return None
            return next((key for key in ACTION_KEYS if key in inside), ACTIONS)
    return ACTIONS


def _find_layout(path: Path, surveyed: Survey) -> tuple[Layout | None, tuple[str, ...]]:
    """The episodes and their actions, where the structure shows them; and the names at the top of the file."""
    with DemoFile(path, Layout(episodes="/")) as whole:  # the checks of opening, and no assumption
        groups, children_of_data = whole.members("/"), whole.members("data")
        demos = [f"data/{name}" for name in children_of_data if re.fullmatch(r"demo_[0-9]+", name)]
        if demos and (key := _known_actions(whole, [demo for demo in demos if not surveyed.reason(f"/{demo}")])):
            return Layout(action_key=key), groups
        shapes = whole.demo(WHOLE_FILE).shapes()
    found: Counter[tuple[str, str]] = Counter()
    children: dict[tuple[str, str], set[str]] = {}
    for key in shapes:
        match = _ACTION.search(key)
        if match is None:
            continue
        pieces = key.split("/")
        if len(pieces) == 1:
            return Layout(episodes="/", action_key=key), groups
        # The episode is the group above the actions, however deep in it they are: the one with siblings alike.
        for depth in range(min(len(pieces) - 1, _MAX_DEPTH), 0, -1):
            place = "/".join(pieces[: depth - 1]), "/".join(pieces[depth:])
            found[place] += 1
            children.setdefault(place, set()).add(pieces[depth - 1])
    if not found:
        return None, groups
    parent, action_key = max(found, key=lambda place: (found[place], -len(place[1])))
    episodes = sorted(children[parent, action_key])
    prefix = _common([re.sub(r"\d+$", "", name) for name in episodes])
    pattern = f"{parent}/{prefix}*" if parent else f"{prefix}*"
    return Layout(episodes=DEFAULT_EPISODES if pattern == DEFAULT_EPISODES else pattern, action_key=action_key), groups


def _common(texts: list[str]) -> str:
    """The longest beginning that all have."""
    low, high = min(texts), max(texts)
    return low[: next((i for i, letter in enumerate(low) if letter != high[i]), len(low))]


def _shortened(value: Any) -> Any:
    text = value if isinstance(value, str) else repr(value) if isinstance(value, list) else None
    if text is None or len(text) <= _SHOWN_TEXT:
        return value
    return f"{text[:_SHOWN_TEXT]} ... ({len(text)} characters)"


def describe(report: FileReport) -> str:
    """The report for reading."""
    lines = [f"{report.file}: HDF5, {report.size_bytes:,} bytes"]
    if report.layout is None:
        lines.append("no episodes found: no group has a dataset `actions` or `action`")
        return "\n".join([*lines, f"at the top: {', '.join(report.groups) or 'nothing'}"])
    count = len(report.episodes)
    lines.append(f"episodes: {count} ({report.layout.episodes}: {report.episodes[0]} to {report.episodes[-1]})")
    if report.lengths:
        low, middle, high = (int(f(report.lengths)) for f in (np.min, np.median, np.max))
        rate = f"{report.fps} Hz" + (" (assumed: the file does not say)" if report.fps_is_assumed else "")
        lines.append(f"steps: {sum(report.lengths):,} (episodes of {low} to {high}, median {middle}), {rate}")
    lines.append(f"environment: {report.env_name}")
    lines += _section("attributes", (f"{key}: {value}" for key, value in report.attributes.items()))
    kinds = (f"{key}: {kind}" for key, kind in report.episode_attributes.items())
    lines += _section("attributes of an episode", kinds)
    shown = []
    for key, found in report.datasets.items():
        where = "" if found.episodes == count else f"  (in {found.episodes} of {count} episodes)"
        shown.append(f"{key}  {_shape(found.shape, report.lengths)} {found.dtype}{where}")
    lines += _section("datasets of an episode (T: steps)", shown)
    stored = [f"{key} ({shape[1]}x{shape[2]})" for key, shape in report.cameras.items()]
    lines.append(f"stored pictures: {', '.join(stored) or 'none'}")
    lines.append(f"cameras in the scene: {', '.join(report.scene_cameras) or 'none'}")
    lines.append(f"filter keys: {', '.join(f'{key} ({n})' for key, n in report.masks.items()) or 'none'}")
    told = [f"{n} x {text}" for text, n in list(report.instructions.items())[:10]]
    more = len(report.instructions) - len(told)
    lines += _section(
        f"instructions, from {', '.join(report.instruction_sources) or 'nowhere'}",
        [*told, *([f"... and {more} more"] if more > 0 else [])],
    )
    if report.mapping is not None:
        lines.append(f"robot: {report.mapping.robot_type}")
        for what, parts in (("state", report.mapping.state_parts), ("action", report.mapping.action_parts)):
            lines.append(f"  {what}: {', '.join(f'{part.name} {part.size}' for part in parts)}")
        if report.layout.action_key == ABSOLUTE_ACTIONS:
            lines.append(f"  there are absolute actions alone: convert with --action-key {ABSOLUTE_ACTIONS}")
        lines.append(f"  cameras taken by default: {', '.join(report.mapping.default_cameras)}")
    else:
        lines.append(f"robot: not recognised. {report.no_mapping}")
    lines += _section("problems", (f"{key}: {problem}" for key, problem in report.problems.items()))
    return "\n".join(lines)


def _section(title: str, items: Any) -> list[str]:
    shown = [f"  {item}" for item in items]
    return [f"{title}:", *shown] if shown else []


def _shape(shape: tuple[int, ...], lengths: list[int]) -> str:
    steps = bool(shape) and shape[0] in lengths[:1]
    return f"({', '.join(['T' if steps else str(shape[0]), *map(str, shape[1:])]) if shape else ''})"
