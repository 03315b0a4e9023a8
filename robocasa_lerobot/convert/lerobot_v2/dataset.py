"""LeRobot v2.0 and v2.1 dataset folders: what their `meta` files say, and where their episodes' files are.

Layout: `meta/info.json`, `meta/episodes.jsonl`, `meta/tasks.jsonl`, one parquet file for each episode, and one mp4 for
each episode and camera, at the places that the templates `data_path` and `video_path` of `info.json` give.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.demo_file import SourceError
from robocasa_lerobot.convert.reading.inputs import INFO_FILE
from robocasa_lerobot.errors import suggest

VERSIONS = ("v2.0", "v2.1")
EXTRAS = "extras"
# The only fields that a path template may hold, with at most two digits of width: a template is input like any other.
_FIELD = re.compile(r"\{(?:episode_chunk|episode_index|video_key)(?::0?\d{1,2}d)?\}")
# What annotation columns with a text's row end in; others, such as a stage's number, may be numbers of another kind.
_TEXTS = ("task_description", "task_name", "subtask", "subtask_name")
# Written anew for the dataset that is made; LeRobot adds them to every dataset.
INDEX_COLUMNS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@dataclass(frozen=True)
class EpisodeLine:
    """What `episodes.jsonl` says of an episode."""

    index: int
    length: int

    @property
    def name(self) -> str:
        """What the episode is called in records and options."""
        return f"episode_{self.index:06d}"


class V2Dataset:
    """The `meta` files of a dataset; nothing else is read.

    Raises:
        SourceError: a file is missing or is not what it should be, or the dataset has another version.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.info = _json_object(root / INFO_FILE)
        self.version = str(self.info.get("codebase_version"))
        if self.version not in VERSIONS:
            remedy = "it needs no conversion" if self.version.startswith("v3") else "bring it to v2.1 with LeRobot 0.3"
            raise SourceError(
                f"{root} is a LeRobot dataset of version {self.version!r}, expected one of {', '.join(VERSIONS)}: "
                f"{remedy}."
            )
        features = self.info.get("features")
        if not isinstance(features, dict) or not all(_is_feature(feature) for feature in features.values()):
            raise SourceError(f"{root / INFO_FILE} has no usable 'features' (name -> dtype and shape).")
        self.features: dict[str, dict[str, Any]] = features
        self.tasks = self._tasks()
        self.episodes = self._episodes()

    @cached_property
    def fps(self) -> int:
        """Frames per second.

        Raises:
            SourceError: not a positive whole number.
        """
        fps = self.info.get("fps")
        if not isinstance(fps, int | float) or isinstance(fps, bool) or fps <= 0 or round(fps) != fps:
            raise SourceError(f"{self.root / INFO_FILE} has fps {fps!r}; a positive whole number is needed.")
        return int(fps)

    @property
    def robot_type(self) -> str:
        """Name of the robot, or "unknown"."""
        robot = self.info.get("robot_type")
        return robot if isinstance(robot, str) and robot else "unknown"

    @cached_property
    def modality(self) -> dict[str, Any]:
        """GR00T's `meta/modality.json` (names and slices of the vectors), empty where there is none."""
        file = self.root / "meta" / "modality.json"
        return _json_object(file) if file.is_file() else {}

    @property
    def pictures(self) -> dict[str, dict[str, Any]]:
        """Declared features that hold pictures, depth maps included."""
        return {key: feature for key, feature in self.features.items() if contract.is_picture(feature)}

    @cached_property
    def annotation_columns(self) -> tuple[str, ...]:
        """Columns whose numbers are rows of `tasks.jsonl`, as `modality.json` or their name says."""
        numbers = [
            name
            for name, feature in self.features.items()
            if name.startswith("annotation.") and feature["dtype"] == "int64"
        ]
        declared = self.modality.get("annotation")
        if not isinstance(declared, dict):
            return tuple(numbers)
        # RoboCasa's own declares the description alone, and the other texts are rows of the same table.
        texts = [name for name in numbers if name.rpartition(".")[2] in _TEXTS]
        named = dict.fromkeys([*(f"annotation.{name}" for name in declared), *texts])
        return tuple(name for name in named if name in numbers)

    @cached_property
    def instruction_column(self) -> str:
        """The column that says which task row is an episode's instruction.

        RoboCasa and GR00T have further rows there (the task's name, a validity label), each with its own column.
        """
        for name in self.annotation_columns:
            if name.endswith("task_description"):
                return name
        return "task_index"

    @property
    def path(self) -> Path:
        """The folder."""
        return self.root

    @property
    def demo_names(self) -> tuple[str, ...]:
        """Names of the episodes, in order."""
        return tuple(line.name for line in self.episodes)

    @property
    def masks(self) -> tuple[str, ...]:
        """Filter keys, which this format does not have."""
        return ()

    def mask(self, key: str) -> tuple[str, ...]:
        """Episodes of a filter key; there is none."""
        raise KeyError(key)

    def data_file(self, episode: int) -> Path:
        """Where an episode's parquet file should be."""
        return self._path("data_path", episode)

    def video_file(self, episode: int, key: str) -> Path:
        """Where an episode's video should be."""
        return self._path("video_path", episode, key)

    def extras_folder(self, episode: int) -> Path:
        """Where RoboCasa keeps what an episode is replayed from."""
        return self.root / EXTRAS / f"episode_{episode:06d}"

    @cached_property
    def collection(self) -> dict[str, Any]:
        """RoboCasa's `extras/dataset_meta.json` (the attributes of the HDF5 file), empty where there is none."""
        file = self.root / EXTRAS / "dataset_meta.json"
        return _json_object(file) if file.is_file() else {}

    @cached_property
    def env_name(self) -> str:
        """Name of the environment as RoboCasa's extras have it, or "unknown"."""
        env_args = self.collection.get("env_args")
        if isinstance(env_args, str):
            try:
                env_args = json.loads(env_args)
            except json.JSONDecodeError:
                env_args = None
        names = (self.collection.get("env"), env_args.get("env_name") if isinstance(env_args, dict) else None)
        return next((name for name in names if isinstance(name, str) and name), "unknown")

    def _path(self, template_key: str, episode: int, video_key: str = "") -> Path:
        template = self.info.get(template_key)
        plain = _FIELD.sub("", template) if isinstance(template, str) else "{"
        if "{" in plain or "}" in plain or PurePosixPath(plain).is_absolute() or ".." in PurePosixPath(plain).parts:
            raise SourceError(
                f"{self.root / INFO_FILE}: {template_key} {template!r} is no path inside the dataset made of "
                "{episode_chunk}, {episode_index} and {video_key}."
            )
        assert isinstance(template, str)
        size = self.info.get("chunks_size")
        chunk = episode // size if isinstance(size, int) and size > 0 else 0
        relative = template.format(episode_chunk=chunk, episode_index=episode, video_key=video_key)
        if ".." in PurePosixPath(relative).parts:
            raise SourceError(f"{self.root / INFO_FILE}: {template_key} leads out of the dataset with {video_key!r}.")
        return self.root / relative

    def _tasks(self) -> dict[int, str]:
        file = self.root / "meta" / "tasks.jsonl"
        tasks: dict[int, str] = {}
        for number, line in _json_lines(file):
            index, text = line.get("task_index"), line.get("task")
            if not isinstance(index, int) or not isinstance(text, str) or index in tasks:
                raise SourceError(
                    f"{file} line {number}: expected one 'task' text for each 'task_index', found {line}."
                )
            tasks[index] = text
        return dict(sorted(tasks.items()))

    def _episodes(self) -> tuple[EpisodeLine, ...]:
        file = self.root / "meta" / "episodes.jsonl"
        episodes: dict[int, EpisodeLine] = {}
        for number, line in _json_lines(file):
            index, length = line.get("episode_index"), line.get("length")
            if not isinstance(index, int) or not isinstance(length, int) or index < 0 or index in episodes:
                raise SourceError(f"{file} line {number}: expected each 'episode_index' once with its 'length'.")
            episodes[index] = EpisodeLine(index, length)
        if not episodes:
            raise SourceError(f"{file} lists no episodes: there is nothing to convert.")
        return tuple(episodes[index] for index in sorted(episodes))


def camera_of(key: str) -> str:
    """Camera name of a picture feature."""
    return key.removeprefix(contract.IMAGE_PREFIX).removeprefix("observation.")


def _is_feature(feature: Any) -> bool:
    if not isinstance(feature, dict) or not isinstance(feature.get("dtype"), str):
        return False
    shape = feature.get("shape")
    return isinstance(shape, list) and all(isinstance(size, int) for size in shape)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        siblings = [path.name for path in file.parent.glob("*")] if file.parent.is_dir() else []
        raise SourceError(f"{file} is missing. {suggest(file.name, siblings)} Download the dataset again.") from None
    except (OSError, UnicodeDecodeError) as error:
        raise SourceError(f"{file} cannot be read ({error}). Download the dataset again.") from None


def _json_object(file: Path) -> dict[str, Any]:
    try:
        value = json.loads(_text(file))
    except (json.JSONDecodeError, RecursionError) as error:
        raise SourceError(f"{file} is not JSON ({error}). Download the dataset again.") from None
    if not isinstance(value, dict):
        raise SourceError(f"{file} holds a JSON {type(value).__name__}, expected an object.")
    return value


def _json_lines(file: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    # Not str.splitlines: it also splits at characters that JSON strings may hold.
    for number, text in enumerate(_text(file).split("\n"), start=1):
        if not text.strip():
            continue
        try:
            line = json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise SourceError(f"{file} line {number} is not JSON ({error}). Download the dataset again.") from None
        if not isinstance(line, dict):
            raise SourceError(f"{file} line {number} is a JSON {type(line).__name__}, expected an object.")
        yield number, line
