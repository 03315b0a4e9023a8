"""A weighted mixture of LeRobot datasets that reads like one: items, metadata, statistics, sampling.

Numbers come from memory, pictures from the frame cache or, without one, from LeRobot's own reader.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.data.alike import check_alike, unseen_pictures
from robocasa_lerobot.data.members import with_frames
from robocasa_lerobot.data.mixture_config import LoaderConfig, MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.decisions import frame_pool
from robocasa_lerobot.data.reading.frame_cache import FrameCache, cache_bytes, open_or_build
from robocasa_lerobot.data.reading.pictures import PictureReader
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.reading.windows import Bounds
from robocasa_lerobot.data.registry.registry import resolve_mixture
from robocasa_lerobot.data.sampler import MixtureSampler, mixture_probabilities
from robocasa_lerobot.data.statistics import (
    Part,
    Statistics,
    cached_statistics,
    pooled_statistics,
)
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.workers import memory_bytes

Item = dict[str, Any]


@dataclass
class MixtureMeta:
    """The part of LeRobot's dataset metadata that policies and processors read, for the whole mixture."""

    features: dict[str, dict[str, Any]]
    fps: int
    robot_type: str | None
    tasks: list[str]
    total_frames: int
    total_episodes: int
    stats: Statistics | None = None
    repo_id: str = "mixture"
    has_language_columns: bool = False

    @property
    def camera_keys(self) -> list[str]:
        """Features that are pictures."""
        return [key for key, feature in self.features.items() if contract.is_picture(feature)]


class MixtureDataset(torch.utils.data.Dataset[Item]):
    """Items as LeRobot's datasets give them, over the members of a mixture.

    `config` is the mixture with its selections written out as members (`data/registry/registry.py`).
    An item has every column of the frame, and for the keys of `delta_timestamps` a leading time axis and
    `<key>_is_pad` (true where the window leaves the episode and repeats its edge; so does one that leaves a run of the
    frames that are asked for, in members that ask for a kind). Images are uint8
    (time, 3, H, W), other floats float32; `task` is the instruction and `task_index` its place in `meta.tasks`.
    Index i counts the frames of the first member's dataset, then of the second's, and so on. Datasets in `opened` are
    not opened again, and those that are opened are added to it. Members without any frame of the kind that they ask
    for are left out of `config`, unless none would be left.

    Raises:
        UserError: members that do not fit each other, or that have no such episodes.
    """

    def __init__(
        self,
        config: MixtureConfig,
        image_size: int | None = None,
        loader: LoaderConfig | None = None,
        opened: dict[Path, DatasetSource] | None = None,
    ) -> None:
        config, loader = resolve_mixture(config), loader or LoaderConfig()
        self.image_size = image_size if image_size is not None else loader.image_size
        image_size = self.image_size
        self._deltas: dict[str, list[int]] = {}
        self._picture_size: tuple[int, int] | None = None
        self._caches: dict[Path, FrameCache] = {}
        self._pictures = PictureReader(loader.cache_open_files)
        self._recent: OrderedDict[Path, None] = OrderedDict()  # sources with mapped columns, the last used at the end
        self._recent_caches: OrderedDict[Path, None] = OrderedDict()  # and those with mapped pictures
        self._max_open = loader.cache_open_files
        self._cache_dir = Path(loader.cache_dir) if loader.cache_dir else None
        opened = {} if opened is None else opened
        for root in dict.fromkeys(Path(member.root) for member in config.members):
            if root not in opened:
                opened[root] = DatasetSource(root)
        config, self._members = with_frames(config, opened)
        self.config = config
        self.sources = {root: opened[root] for root in dict.fromkeys(Path(member.root) for member in config.members)}
        every = {key: feature for source in self.sources.values() for key, feature in source.features.items()}
        self._unseen = unseen_pictures(every, loader.cameras)
        check_alike(list(self.sources.values()), self._unseen, any_image_size=image_size is not None)
        # Whether the numbers of all datasets stay on disk, mapped into memory as they are used.
        self._mapped = sum(s.column_bytes for s in self.sources.values()) > loader.cache_columns_above_gb * 1e9
        tasks = sorted({text for source in self.sources.values() for text in source.instructions})
        number = {text: index for index, text in enumerate(tasks)}
        # Index in the mixture's tasks of each task index of a dataset.
        self._task_index = {
            root: np.array([number[text] for text in source.instructions]) for root, source in self.sources.items()
        }
        places = {root: place for place, root in enumerate(self.sources)}
        self._source_list = list(self.sources.values())
        self._place = np.array([places[Path(member.root)] for member in config.members])  # of each member's source
        frames = [m.frames for m in self._members]
        weights = [member.weight for member in config.members if member.weight is not None]
        groups = [str(member.group) for member in config.members]
        self.probabilities = mixture_probabilities(frames, weights or None, config.alpha, groups, config.shares)
        self._offsets = np.cumsum([0, *(m.source.total_frames for m in self._members)])
        first = self._members[0].source
        self.meta = MixtureMeta(
            features={
                key: self._feature(feature) for key, feature in first.features.items() if key not in self._unseen
            },
            fps=first.fps,
            robot_type=first.robot_type,
            tasks=tasks,
            total_frames=sum(frames),
            total_episodes=sum(len(m.episodes) for m in self._members),
        )

    def _feature(self, feature: Mapping[str, Any]) -> dict[str, Any]:
        if self.image_size is None or not contract.is_picture(feature):
            return dict(feature)
        return {**feature, "shape": (self.image_size, self.image_size, 3)}

    def __len__(self) -> int:
        return int(self._offsets[-1])

    @property
    def fingerprint(self) -> str:
        """Hash of the data of all members."""
        return hashlib.sha256("-".join(source.fingerprint for source in self._source_list).encode()).hexdigest()

    @property
    def selection_fingerprint(self) -> str:
        """Hash of what is drawn of the data: episodes of each member, which of their frames, and how often."""
        digest = hashlib.sha256()
        for place, part, probability in zip(self._place, self._members, self.probabilities, strict=True):
            digest.update(f"{place} {part.kind} {probability:.9g} {len(part.episodes)} ".encode())
            digest.update(part.episodes.astype("<i8").tobytes())
        if self.config.episodes_first:  # said only then: phases that began before there was a choice go on
            digest.update(self.config.draw.encode())
        return digest.hexdigest()

    def episodes_of(self, member: MemberConfig) -> NDArray[np.int64]:
        """Indices in its dataset, ascending, of the episodes of a member of `config`."""
        return self._members[self.config.members.index(member)].episodes

    def describe(self) -> str:
        """A line for each member: episodes, frames, and how often it is drawn."""
        lines = []
        for member, part, probability in zip(self.config.members, self._members, self.probabilities, strict=True):
            tasks = ", ".join(member.tasks) if member.tasks else "all tasks"
            for name, kitchens in (("layouts", member.layouts), ("styles", member.styles)):
                tasks += f"; {name} {', '.join(map(str, kitchens))}" if kitchens else ""
            tasks += f"; {member.frames}" if member.frames else ""
            tasks += f"; without {', '.join(part.source.depth)}" if part.source.depth else ""
            counts = f"{len(part.episodes)} episodes, {part.frames} frames"
            counts += ", an episode first" if self.config.episodes_first else ""
            lines.append(f"{member.root} ({tasks}): {counts}, {probability:.{1 if probability >= 0.01 else 3}%}")
        return "\n".join(lines)

    def statistics(self, images: bool = True) -> Statistics:
        """Pooled statistics of the frames that the mixture draws, weighted as it draws their datasets.

        Without `images`, of the numbers alone. With a cache folder they are computed once for all processes.
        """
        if self._cache_dir is None:
            return pooled_statistics(self._parts(), images, self._unseen)
        return cached_statistics(self._parts(), self._cache_dir, images, self._unseen)

    def _parts(self) -> list[Part]:
        shares = zip(self._members, self.probabilities, strict=True)
        return [Part(member.source, member.episodes, float(share), self._use) for member, share in shares]

    def sampler(self, seed: int, drop_last_frames: int = 0) -> MixtureSampler:
        """The sampler over the mixture; the last frames of each episode can be kept from starting a sample."""
        pools = [frame_pool(m.source, m.episodes, m.wanted, drop_last_frames) for m in self._members]
        return MixtureSampler(pools, self.probabilities, seed, episodes_first=self.config.episodes_first)

    def set_windows(self, delta_timestamps: Mapping[str, Sequence[float]] | None) -> None:
        """The window of each key, in seconds relative to the frame, as LeRobot's `delta_timestamps`."""
        windows = delta_timestamps or {}
        self._deltas = {key: [round(t * self.meta.fps) for t in times] for key, times in windows.items()}

    def set_picture_size(self, size: tuple[int, int] | None) -> None:
        """Hand out pictures at (height, width) `size` where that is smaller than what the features say.

        For a policy that would bring them to this size anyway: less to cache, to move and to compute.
        """
        height, width = self._feature_size()
        self._picture_size = size if size is not None and size[0] * size[1] < height * width else None
        self._caches.clear()
        self._recent_caches.clear()

    def cache_frames(self, cache_dir: Path, budget_bytes: float | None = None) -> bool:
        """Decode every picture once and read it from disk from then on; the pictures are the same.

        Returns:
            False where it was left out, because the frames take more than the budget or are no video.
        """
        self._cache_dir = self._cache_dir or cache_dir
        needed = self.cached_bytes()
        if not needed or (budget_bytes is not None and sum(needed.values()) > budget_bytes):
            return False
        keys, size = self.meta.camera_keys, self._picture_size or self._feature_size()
        scattered = sum(needed.values()) > memory_bytes() // 2
        for root, source in self.sources.items():
            self._caches[root] = open_or_build(self._use(source), keys, size, cache_dir, scattered)
        return True

    def cached_bytes(self) -> dict[Path, int]:
        """Bytes on disk of each dataset's pictures, once they are decoded; none where they are no video."""
        keys = self.meta.camera_keys
        videos = (source.features[key]["dtype"] == "video" for source in self.sources.values() for key in keys)
        if not keys or not all(videos):
            return {}
        size = self._picture_size or self._feature_size()
        return {root: cache_bytes(source, keys, size) for root, source in self.sources.items()}

    def _feature_size(self) -> tuple[int, int]:
        """Height and width of the pictures; cameras of different sizes cannot be handed out together."""
        shapes = {tuple(self.meta.features[key]["shape"][:2]) for key in self.meta.camera_keys}
        if len(shapes) > 1:
            raise UserError(f"cameras have different sizes {sorted(shapes)}; set `loader.image_size` to one for all.")
        return shapes.pop() if shapes else (0, 0)

    def __getitem__(self, index: int) -> Item:
        member = int(np.searchsorted(self._offsets, index, side="right")) - 1
        batch = self.batch(np.array([member]), np.array([index - self._offsets[member]]))
        return {key: value[0] for key, value in batch.items()}

    def batch(self, members: NDArray[np.int64], frames: NDArray[np.int64]) -> Item:
        """A collated batch: frame `frames[i]` of the dataset of member `members[i]`, for each i."""
        order: list[NDArray[np.int64]] = []
        parts: list[Item] = []
        places = self._place[members]
        for place in dict.fromkeys(places.tolist()):
            chosen = np.flatnonzero(places == place)
            order.append(chosen)
            parts.append(self._read(self._use(self._source_list[place]), frames[chosen], members[chosen]))
        if len(parts) == 1:
            return parts[0]
        back = np.argsort(np.concatenate(order))
        out: Item = {}
        for key, first in parts[0].items():
            if isinstance(first, torch.Tensor):
                out[key] = torch.cat([part[key] for part in parts])[torch.from_numpy(back)]
            else:
                joined = [value for part in parts for value in part[key]]
                out[key] = [joined[i] for i in back]
        return out

    def _read(self, source: DatasetSource, frames: NDArray[np.int64], members: NDArray[np.int64]) -> Item:
        bounds = self._bounds(source, frames, members)
        out = self._read_pictures(source, frames, bounds)
        for key, column in source.columns.items():
            indices, padded = self._window(key, frames, bounds)
            out[key] = torch.from_numpy(column[indices])
            if padded is not None:
                out[f"{key}_is_pad"] = torch.from_numpy(padded)
        task = self._task_index[source.root][source.columns["task_index"][frames]]
        out["task_index"] = torch.from_numpy(task)
        out["task"] = [self.meta.tasks[i] for i in task]
        return out

    def _read_pictures(self, source: DatasetSource, frames: NDArray[np.int64], bounds: Bounds) -> Item:
        keys, out = self.meta.camera_keys, Item()
        if not keys:
            return out
        cache = self._caches.get(source.root)
        if cache:
            _use_one(source.root, self._recent_caches, self._caches, self._max_open)
        for key in keys:
            indices, padded = self._window(key, frames, bounds)
            if cache:
                out[key] = cache.frames(key, indices)
            else:
                size = self._picture_size or self._feature_size()
                images = self._pictures.frames(source, key, indices.ravel(), size)
                out[key] = images.reshape(*indices.shape, *images.shape[-3:])
            if padded is not None:
                out[f"{key}_is_pad"] = torch.from_numpy(padded)
        return out

    def _use(self, source: DatasetSource) -> DatasetSource:
        """The source, ready to be read; with mapped columns, those of another one may be closed for it."""
        if not self._mapped:
            return source
        if self._cache_dir is None:
            total = sum(s.column_bytes for s in self._source_list)
            raise UserError(
                f"states and actions of the mixture take {total / 1e9:.1f} GB, more memory than "
                "`loader.cache_columns_above_gb` allows; set `loader.cache_dir` to a folder for files to map instead."
            )
        source.column_cache = self._cache_dir
        _use_one(source.root, self._recent, self.sources, self._max_open)
        return source

    def _bounds(self, source: DatasetSource, frames: NDArray[np.int64], members: NDArray[np.int64]) -> Bounds:
        """Of the windows around frames: their episodes, and where a kind of frame is drawn, its run."""
        episode = source.columns["episode_index"][frames]
        starts, last = source.starts[episode], source.ends[episode] - 1
        first = starts
        for number in np.unique(members).tolist():
            if (run := self._members[number].run) is not None:
                first = np.where(members == number, run[0][frames], first)
                last = np.where(members == number, run[1][frames], last)
        return Bounds(starts, last, first)

    def _window(
        self, key: str, frames: NDArray[np.int64], bounds: Bounds
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_] | None]:
        """Dataset indices of a key's window, (n,) or (n, time), and where it is out of bounds."""
        if key not in self._deltas:
            return frames, None
        return bounds.window(frames, self._deltas[key], of_actions=key == contract.ACTION_KEY)


def check_share(batch_size: int, processes: int) -> None:
    """Whether processes can have equal shares of the samples that go through the policy at once.

    Raises:
        UserError: they cannot.
    """
    if batch_size % processes:
        raise UserError(f"batch of {batch_size} samples cannot be shared by {processes} processes; use a multiple.")


class StepBatches(torch.utils.data.Dataset[Item]):
    """Item i is the i-th batch of a phase for this process: what a loader needs to start anywhere.

    Batch number i holds the samples i * batch_size .. (i + 1) * batch_size - 1; process `rank` of `processes`
    gets an equal consecutive share, so that together they see the same samples whatever their number.
    """

    def __init__(
        self, dataset: MixtureDataset, sampler: MixtureSampler, batch_size: int, rank: int = 0, processes: int = 1
    ) -> None:
        check_share(batch_size, processes)
        self.dataset, self.sampler = dataset, sampler
        self.batch_size, self._share, self._rank = batch_size, batch_size // processes, rank

    def __getitem__(self, index: int) -> Item:
        position = index * self.batch_size + self._rank * self._share
        return self.dataset.batch(*self.sampler.draw(position, self._share))


def open_mixture(
    config: MixtureConfig, loader: LoaderConfig, opened: dict[Path, DatasetSource] | None = None
) -> MixtureDataset:
    """The mixture with the fake datasets made that it asks for; pictures are not cached yet. `opened` as above."""
    for member in config.members:
        if member.make_fake and not Path(member.root).exists():
            from robocasa_lerobot.data.fake import write_fake_dataset

            write_fake_dataset(Path(member.root))
    return MixtureDataset(config, loader=loader, opened=opened)


def _use_one(
    root: Path, recent: OrderedDict[Path, None], files: Mapping[Path, DatasetSource | FrameCache], most: int
) -> None:
    """Note that the files of a dataset are used; beyond `most`, those that were not for longest are closed."""
    recent[root] = None
    recent.move_to_end(root)
    while len(recent) > most:
        files[recent.popitem(last=False)[0]].close()
