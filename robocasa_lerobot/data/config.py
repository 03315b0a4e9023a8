"""What a mixture of datasets is, as typed configuration; `configs/mixtures/` holds named ones."""

from __future__ import annotations

from dataclasses import dataclass, field

from robocasa_lerobot.errors import UserError

# Exponent on the number of frames with which the published benchmark weights its datasets: P ~ L^0.4
# (RoboCasa365's Diffusion Policy and pi0 trainers).
BENCHMARK_ALPHA = 0.4


@dataclass
class MemberConfig:
    """One dataset of a mixture, or a part of it.

    Attributes:
        root: folder of a LeRobotDataset v3.0, relative to the working directory.
        tasks: task names to keep (`task_name` of `meta/robocasa/episodes.jsonl`); None keeps all.
        episodes: episode indices to keep; None keeps all. With `tasks`, both must hold.
        weight: how often the member is drawn, relative to the others; None: frames ** `alpha` of the mixture.
        make_fake: for debugging: write the tiny made-up dataset of `data/fake.py` at `root` if nothing is there.
    """

    root: str
    tasks: list[str] | None = None
    episodes: list[int] | None = None
    weight: float | None = None
    make_fake: bool = False

    def __post_init__(self) -> None:
        if self.weight is not None and not self.weight > 0:
            raise UserError(f"mixture member {self.root!r}: weight is {self.weight}, expected a number above 0.")
        for name, values in (("tasks", self.tasks), ("episodes", self.episodes)):
            if values is not None and (not values or len(set(values)) != len(values)):
                raise UserError(f"mixture member {self.root!r}: `{name}` is empty or has repeats: {values}.")


@dataclass
class MixtureConfig:
    """Datasets and how often each is drawn: a dataset by its weight, then one of its frames uniformly.

    Attributes:
        members: the datasets; either all or none of them have a `weight`.
        alpha: without weights, a dataset of L frames is drawn with a probability proportional to L ** alpha:
            1 makes every frame equally likely, 0 every dataset.
    """

    members: list[MemberConfig] = field(default_factory=list)
    alpha: float = BENCHMARK_ALPHA

    def __post_init__(self) -> None:
        if not self.members:
            raise UserError("mixture: no members; give at least one `{root: <folder of a LeRobotDataset>}`.")
        weighted = [member for member in self.members if member.weight is not None]
        if weighted and len(weighted) != len(self.members):
            plain = next(member.root for member in self.members if member.weight is None)
            raise UserError(f"mixture: {plain!r} has no `weight` while others have one; give all or none.")


@dataclass
class LoaderConfig:
    """How samples get from disk to the policy.

    Attributes:
        workers: loader processes; 0 loads in the training process, the best choice with cached frames.
        cache_frames: keep decoded frames in a memory-mapped file: true, false, or null for "if they fit".
        cache_budget_gb: what "if they fit" means, in 10^9 bytes for all datasets of a phase together.
        cache_dir: where the frames are kept; null is `<output_dir>/frame_cache`.
        image_size: height and width in pixels handed to the policy; null is the dataset's own size.
    """

    workers: int = 0
    cache_frames: bool | None = None
    cache_budget_gb: float = 8.0
    cache_dir: str | None = None
    image_size: int | None = None
