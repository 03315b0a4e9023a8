"""What a mixture of datasets is, as typed configuration; `configs/mixtures/` holds named ones."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UnknownNameError, UserError

# Exponent on the number of frames with which the published benchmark weights its datasets: P ~ L^0.4
# (RoboCasa365's Diffusion Policy and pi0 trainers; its GR00T trainer comes to L^1.4).
BENCHMARK_ALPHA = 0.4
# What is drawn of a dataset: one of its frames, or one of its episodes and then one of that one's frames.
DRAWN = ("frames", "episodes")
ROBOCASA365 = "robocasa365"  # the registry of the published datasets, in `datasets/` of the working directory

_COUNT = re.compile(r"(\d+)(?:_demos)?$")
_SHARE = re.compile(r"(\d+(?:\.\d+)?)%$")


@dataclass
class MemberConfig:
    """One dataset of a mixture, or a part of it.

    Attributes:
        root: folder of a LeRobotDataset v3.0, relative to the working directory; with a `repo_id`,
            `datasets/hub/<owner>/<name>` if it is not said.
        tasks: task names to keep (`task_name` of `meta/robocasa/episodes.jsonl`); None keeps all.
        episodes: episode indices to keep; None keeps all. Of all that is given here, each must hold.
        layouts: kitchens to keep, by their layout (`layout_id` of the same table); None keeps all.
        styles: likewise by their style.
        weight: how often the member is drawn, relative to the others; None: frames ** `alpha` of the mixture.
        make_fake: for debugging: write the tiny made-up dataset of `data/fake.py` at `root` if nothing is there.
        demos: of the episodes that are left, so many of each task: `50` (or `50_demos`) or `10%`, by the
            benchmark's rule (`contract.demo_subset`).
        group: class of the member, for `shares` of the mixture.
        repo_id: `owner/name` of a LeRobotDataset v3.0 on the hub, which training fetches to `root` if it is not there.
        frames: of the episodes' frames, those that start samples: `interventions`, which a person decided while a
            policy drove, or `autonomous`, which the policy decided; None is all. A dataset may be a member of each
            kind, with a weight of its own. Statistics are those of whole episodes.
    """

    root: str = ""
    tasks: list[str] | None = None
    episodes: list[int] | None = None
    weight: float | None = None
    make_fake: bool = False
    demos: str | None = None
    group: str | None = None
    layouts: list[int] | None = None
    styles: list[int] | None = None
    repo_id: str | None = None
    frames: str | None = None

    def __post_init__(self) -> None:
        _check_frames(self.frames)
        if self.repo_id is not None and not re.fullmatch(r"[\w.-]+/[\w.-]+", self.repo_id):
            raise UserError(f"mixture: repo_id is {self.repo_id!r}, expected OWNER/NAME of a dataset on the hub.")
        if not self.root and self.repo_id is None:
            raise UserError("mixture: a member needs the `root` of a dataset, or the `repo_id` of one on the hub.")
        self.root = self.root or f"datasets/hub/{self.repo_id}"
        what = f"mixture member {self.root!r}"
        self.demos = _check_part(what, self.weight, self.demos)
        _check_lists(what, tasks=self.tasks, episodes=self.episodes, layouts=self.layouts, styles=self.styles)


@dataclass
class SelectionConfig:
    """Datasets of a registry, one member of the mixture for each task, split and source.

    Attributes:
        registry: `robocasa365` (the published folders, in `datasets/`) or a file (`data/registry/registry.py`).
        task_set: a set of tasks such as `atomic_seen`; those of which nothing is published are left out.
        tasks: names of tasks, instead of a set or beside it.
        tasks_per_set: so many tasks of the set, the first of which there are data; None is all.
        split: `pretrain` or `target`; None is both.
        source: `human`, `mg` and so on; None is all that are there or can be downloaded.
        views: `lerobot`, or `lerobot_cotraining_cams` for pictures from the real cameras' views.
        demos: so many of each dataset, as for a member.
        weight: of each of the datasets, as for a member.
        group: class of the datasets, as for a member.
        layouts: kitchens to keep of each dataset, by their layout, as for a member.
        styles: likewise by their style.
        frames: kind of the frames that start samples, as for a member; datasets without any are left out.
    """

    registry: str = ROBOCASA365
    task_set: str | None = None
    tasks: list[str] | None = None
    tasks_per_set: int | None = None
    split: str | None = None
    source: str | None = None
    views: str = "lerobot"
    demos: str | None = None
    weight: float | None = None
    group: str | None = None
    layouts: list[int] | None = None
    styles: list[int] | None = None
    frames: str | None = None

    def __post_init__(self) -> None:
        _check_frames(self.frames)
        what = f"selection of {self.registry!r}"
        if self.tasks_per_set is not None and self.tasks_per_set < 1:
            raise UserError(f"{what}: tasks_per_set is {self.tasks_per_set}, expected at least 1.")
        self.demos = _check_part(what, self.weight, self.demos)
        _check_lists(what, tasks=self.tasks, layouts=self.layouts, styles=self.styles)


@dataclass
class MixtureConfig:
    """Datasets and how often each is drawn: a dataset by its weight, then one of its frames or episodes uniformly.

    Attributes:
        members: the datasets; either all or none of them (and of `select`) have a `weight`.
        alpha: without weights, a dataset of L frames is drawn with a probability proportional to L ** alpha:
            1 makes every frame equally likely, 0 every dataset.
        select: further members, by task set, split and source.
        shares: of each class (`group` of the members), such as `{real: 0.15, same_views: 0.3, other: 0.55}`; inside
            a class by `weight`, or equally without weights.
        draw: of a dataset, `frames` (all alike) or `episodes` (all alike, and then the frames of the one that is
            drawn), so that short episodes count more.
    """

    members: list[MemberConfig] = field(default_factory=list)
    alpha: float = BENCHMARK_ALPHA
    select: list[SelectionConfig] = field(default_factory=list)
    shares: dict[str, float] | None = None
    draw: str = DRAWN[0]

    @property
    def episodes_first(self) -> bool:
        """Whether an episode is drawn before one of its frames."""
        return self.draw != DRAWN[0]

    def __post_init__(self) -> None:
        if self.draw not in DRAWN:
            raise UnknownNameError("choice", self.draw, DRAWN, "(what a mixture may `draw` of a dataset)")
        if not math.isfinite(self.alpha):
            raise UserError(f"mixture: alpha is {self.alpha}, expected a number, such as 0.4 or 1.")
        parts: list[MemberConfig | SelectionConfig] = [*self.members, *self.select]
        if not parts:
            raise UserError(
                "mixture: no members; give at least one `{root: <folder of a LeRobotDataset>}`, or a `select`."
            )
        weighted = [part for part in parts if part.weight is not None]
        if weighted and len(weighted) != len(parts):
            plain = next(part for part in parts if part.weight is None)
            raise UserError(f"mixture: {_name(plain)} has no `weight` while others have one; give all or none.")
        if self.shares is not None:
            _check_shares(self.shares, parts)


@dataclass
class LoaderConfig:
    """How samples get from disk to the policy.

    Attributes:
        workers: loader processes; 0 loads in the training process, the best choice with cached frames.
        cache_frames: keep decoded frames in a memory-mapped file: true, false, or null for "if they fit".
        cache_budget_gb: what "if they fit" means, in 10^9 bytes for all datasets of a phase together.
        cache_dir: where frames, statistics and columns are kept; null is `<output_dir>/frame_cache`.
        image_size: height and width in pixels handed to the policy; null is the dataset's own size.
        cameras: whose pictures the policy gets, such as `robot0_eye_in_hand`; null is all of the data. Datasets of a
            mixture may differ in the others.
        cache_columns_above_gb: states, actions and other numbers of larger mixtures stay in memory-mapped files in
            the cache folder instead of memory (10^9 bytes for all datasets of a phase, in each loader process).
        cache_open_files: videos, and datasets' memory-mapped numbers and pictures, that a loader process keeps open at
            once.
    """

    workers: int = 0
    cache_frames: bool | None = None
    cache_budget_gb: float = 8.0
    cache_dir: str | None = None
    image_size: int | None = None
    cameras: list[str] | None = None
    cache_columns_above_gb: float = 2.0
    cache_open_files: int = 64

    def __post_init__(self) -> None:
        for name, least in (("cache_open_files", 1), ("image_size", 1), ("workers", 0)):
            value = getattr(self, name)
            if value is not None and value < least:
                raise UserError(f"loader: {name} is {value}, expected at least {least}.")
        _check_lists("loader", cameras=self.cameras)


def demo_count(demos: str, total: int) -> int:
    """How many of `total` demonstrations `50`, `50_demos` or `10%` are; a share is at least one."""
    count, share = _COUNT.fullmatch(demos), _SHARE.fullmatch(demos)
    if count:
        return min(total, int(count[1]))
    assert share, f"not checked: demos {demos!r}"
    return max(1, round(total * float(share[1]) / 100))


def _check_frames(kind: str | None) -> None:
    if kind is not None and kind not in contract.FRAME_KINDS:
        raise UnknownNameError("kind of frames", kind, contract.FRAME_KINDS, "(of a mixture's member)")


def _check_part(what: str, weight: float | None, demos: str | None) -> str | None:
    """`demos` as text, once both have been checked."""
    if weight is not None and not weight > 0:
        raise UserError(f"{what}: weight is {weight}, expected a number above 0.")
    if demos is None:
        return None
    text = str(demos).strip()
    count, share = _COUNT.fullmatch(text), _SHARE.fullmatch(text)
    if not (count and int(count[1]) > 0) and not (share and 0 < float(share[1]) <= 100):
        raise UserError(f"{what}: demos is {text!r}, expected a number (50, 50_demos) or a share (10%).")
    return text


def _check_lists(what: str, **lists: Sequence[Any] | None) -> None:
    for name, values in lists.items():
        if values is not None and (not values or len(set(values)) != len(values)):
            raise UserError(f"{what}: `{name}` is empty or has repeats: {values}.")


def _check_shares(shares: dict[str, float], parts: Sequence[MemberConfig | SelectionConfig]) -> None:
    for group, share in shares.items():
        if not share > 0:
            raise UserError(f"mixture: the share of {group!r} is {share}, expected a number above 0.")
        if group not in {part.group for part in parts}:
            raise UserError(f"mixture: no member has `group: {group}`, which has a share.")
    for part in parts:
        if part.group is None:
            raise UserError(f"mixture: {_name(part)} has no `group`, which `shares` needs: {sorted(shares)}.")
        if part.group not in shares:
            raise UnknownNameError("group", part.group, shares, f"({_name(part)}; groups are those in `shares`)")


def _name(part: MemberConfig | SelectionConfig) -> str:
    return repr(part.root) if isinstance(part, MemberConfig) else f"a selection of {part.registry!r}"
