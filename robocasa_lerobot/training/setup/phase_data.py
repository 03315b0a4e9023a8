"""Mixtures put together: samples of earlier phases among those of a later one, and statistics over several."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from robocasa_lerobot.data.mixture import MixtureDataset, open_mixture
from robocasa_lerobot.data.mixture_config import MemberConfig, MixtureConfig
from robocasa_lerobot.data.reading.source import DatasetSource
from robocasa_lerobot.data.statistics import Statistics
from robocasa_lerobot.training.config.experiment import ExperimentConfig, PhaseConfig
from robocasa_lerobot.training.weights.checkpoint import last_checkpoint

type Opened = dict[Path, DatasetSource]


def open_phase_data(experiment: ExperimentConfig, phase: PhaseConfig, opened: Opened | None = None) -> MixtureDataset:
    """The phase's mixture, with its share of earlier phases' samples.

    A dataset is opened once, however many phases have it; `opened` carries those that are open already.

    Raises:
        UserError: as `open_mixture`.
    """
    opened = {} if opened is None else opened
    own = open_mixture(phase.mixture, experiment.data_loader, opened)
    earlier = experiment.replayed(phase)
    if phase.replay is None or not earlier:
        return own
    again = [open_mixture(other.mixture, experiment.data_loader, opened) for other in earlier]
    shares = [1 - phase.replay.share, *[phase.replay.share / len(again)] * len(again)]
    return open_mixture(joined([own, *again], shares), experiment.data_loader, opened)


def needed_mixtures(experiment: ExperimentConfig, phase: PhaseConfig) -> list[MixtureConfig]:
    """The mixtures that a phase opens: its own and what it replays, and to pool statistics those of phases before."""
    begun = last_checkpoint(Path(experiment.output_dir) / phase.name) is not None  # which has its statistics already
    opened = [phase, *(experiment.ancestors(phase) if phase.statistics == "pool" and not begun else ())]
    return [part.mixture for one in opened for part in (one, *experiment.replayed(one))]


def pooled(
    experiment: ExperimentConfig, phase: PhaseConfig, dataset: MixtureDataset, images: bool = True
) -> Statistics:
    """Exact statistics over the frames of this phase's data and of those it builds on.

    Each phase counts by the samples drawn in it, each frame in it as often as it is drawn. Without `images`, of the
    numbers alone.
    """
    earlier = experiment.ancestors(phase)
    assert earlier, "the experiment has been checked: it pools only where a phase starts from another"
    samples = [other.steps * other.batch_size for other in [phase, *earlier]]
    shares = [count / sum(samples) for count in samples]
    opened = dict(dataset.sources)
    before = [open_phase_data(experiment, other, opened) for other in earlier]
    return open_mixture(joined([dataset, *before], shares), experiment.data_loader, opened).statistics(images)


def joined(datasets: Sequence[MixtureDataset], shares: Sequence[float]) -> MixtureConfig:
    """One mixture that draws from each of several by its share, and inside each as it does.

    What several have is one member of it, with the weights added. Of each it draws frames or episodes as of the first.
    """
    members: dict[str, MemberConfig] = {}
    for dataset, share in zip(datasets, shares, strict=True):
        for member, probability in zip(dataset.config.members, dataset.probabilities, strict=True):
            plain = dataclasses.replace(member, weight=None, group=None)
            weight = members[repr(plain)].weight or 0.0 if repr(plain) in members else 0.0
            members[repr(plain)] = dataclasses.replace(plain, weight=weight + float(probability * share))
    return MixtureConfig(members=list(members.values()), draw=datasets[0].config.draw)
