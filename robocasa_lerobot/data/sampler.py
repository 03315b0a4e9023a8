"""Which frame is which sample of the training: a pure function of a seed and a position.

Nothing is stored and nothing is shared: sample number `p` of a phase is the same whatever the number of
processes and loader workers, and wherever training was interrupted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError

_WORDS = 4  # 64-bit words that one Philox counter value yields
_UNIT = 2.0**-53  # a 53-bit integer times this is a float64 in [0, 1)


@dataclass(frozen=True)
class FramePool:
    """The frames of one mixture member that may start a sample, as runs of consecutive frames.

    Attributes:
        starts: (runs,) first frame of each run, as an index of the dataset.
        lengths: (runs,) frames of each run.
        of_episodes: (episodes,) frames of each episode, in the order of the runs; None: each run is an episode.
    """

    starts: NDArray[np.int64]
    lengths: NDArray[np.int64]
    of_episodes: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ends", np.cumsum(self.lengths))
        counts = self.lengths if self.of_episodes is None else self.of_episodes
        object.__setattr__(self, "episode_ends", np.cumsum(counts))

    @property
    def size(self) -> int:
        """Number of frames."""
        return int(self.lengths.sum())

    def frame(self, rank: NDArray[np.int64]) -> NDArray[np.int64]:
        """Dataset index of the frames with the given rank (0 .. size - 1) among the pool's frames."""
        ends: NDArray[np.int64] = self.__dict__["ends"]
        run = np.searchsorted(ends, rank, side="right")
        return self.starts[run] + rank - (ends[run] - self.lengths[run])

    def any_frame(self, unit: NDArray[np.float64]) -> NDArray[np.int64]:
        """Dataset index of a frame for each of `unit` in [0, 1): all frames alike."""
        return self.frame((unit * self.size).astype(np.int64))

    def frame_of_any_episode(
        self, episode_unit: NDArray[np.float64], frame_unit: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """Dataset index of a frame for each pair in [0, 1): all episodes alike, and in each all its frames."""
        ends: NDArray[np.int64] = self.__dict__["episode_ends"]
        episode = (episode_unit * len(ends)).astype(np.int64)
        begin = np.where(episode > 0, ends[episode - 1], 0)
        return self.frame(begin + (frame_unit * (ends[episode] - begin)).astype(np.int64))


def mixture_probabilities(
    frames: Sequence[int],
    weights: Sequence[float] | None = None,
    alpha: float = 0.4,
    groups: Sequence[str] | None = None,
    shares: Mapping[str, float] | None = None,
) -> NDArray[np.float64]:
    """Probability of each dataset; all together are 1.

    Proportional to `weights` if given, else to frames ** alpha. With `shares`, the datasets of a class (`groups[i]`)
    have its share together, divided by `weights`, or equally without them (RoboCasa365's co-training with real data).

    Raises:
        UserError: a dataset has no frames.
    """
    counts = np.asarray(frames, dtype=np.float64)
    if (counts <= 0).any():
        raise UserError(f"mixture: member number {int(np.argmin(counts))} has no frames to draw from.")
    if shares is None:
        # Relative to the largest, so that no power of a count overflows.
        raw = (counts / counts.max()) ** alpha if weights is None else np.asarray(weights, dtype=np.float64)
        return raw / raw.sum()
    assert groups is not None
    assert set(groups) == set(shares)
    raw = np.ones(len(counts)) if weights is None else np.asarray(weights, dtype=np.float64)
    out = np.zeros(len(counts))
    for group, share in shares.items():
        of_group = np.array([name == group for name in groups])
        out[of_group] = share * raw[of_group] / raw[of_group].sum()
    return out / out.sum()


class MixtureSampler:
    """Draws (member, frame) pairs: a member by its probability, then one of its frames uniformly.

    With `episodes_first` one of its episodes uniformly, and then one of that one's frames.
    Position `p` uses the words of counter `p` of a Philox generator (Salmon et al. 2011, "Parallel random
    numbers: as easy as 1, 2, 3") keyed on the seed, so any position can be drawn alone and in any order.
    """

    def __init__(
        self,
        pools: Sequence[FramePool],
        probabilities: NDArray[np.float64],
        seed: int,
        episodes_first: bool = False,
    ) -> None:
        if len(pools) != len(probabilities):
            raise UserError(f"sampler: {len(pools)} pools but {len(probabilities)} probabilities.")
        self.pools, self.probabilities, self.seed = list(pools), probabilities, seed
        self.episodes_first = episodes_first
        self._upper = np.cumsum(probabilities)
        self._upper[-1] = 1.0  # against rounding: a draw is always below it

    def draw(self, position: int, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Members (count,) and dataset frame indices (count,) of the samples `position .. position + count - 1`."""
        words = np.random.Philox(key=self.seed, counter=position).random_raw(_WORDS * count).reshape(count, _WORDS)
        unit = (words >> np.uint64(11)).astype(np.float64) * _UNIT
        members = np.searchsorted(self._upper, unit[:, 0], side="right").astype(np.int64)
        frames = np.empty(count, dtype=np.int64)
        for member in np.unique(members):
            chosen, pool = members == member, self.pools[member]
            if self.episodes_first:
                frames[chosen] = pool.frame_of_any_episode(unit[chosen, 1], unit[chosen, 2])
            else:
                frames[chosen] = pool.any_frame(unit[chosen, 1])
        return members, frames
