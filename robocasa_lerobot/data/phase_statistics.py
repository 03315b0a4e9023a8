"""With which statistics a later phase normalises: those it inherits, those of its own data, or of both together.

`keep` leaves what every input means to the weights as it is. `replace` suits the new data and shifts the inputs under
the weights, as stock LeRobot does when it fine-tunes. `pool` is for phases that are known beforehand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robocasa_lerobot.data.mixture import MixtureDataset
from robocasa_lerobot.data.statistics import Statistics, pooled_statistics
from robocasa_lerobot.errors import UnknownNameError, UserError


def keep(saved: Mapping[str, Mapping[str, Any]], dataset: MixtureDataset) -> Statistics:
    """The statistics of an earlier phase, checked to fit the features of this phase's data.

    Raises:
        UserError: the data have a number of which there are no statistics, or of another size.
    """
    for key, feature in dataset.numeric_features().items():
        if key not in saved:
            raise UnknownNameError("feature", key, saved, "(the statistics to keep lack it: `replace` or `pool` them)")
        found = np.shape(saved[key]["mean"])
        if found != tuple(feature["shape"]):
            raise UserError(
                f"feature {key!r}: the statistics to keep have shape {found}, the data {tuple(feature['shape'])}; "
                "`replace` or `pool` them."
            )
    return {key: {name: np.asarray(v) for name, v in values.items()} for key, values in saved.items()}


def replace(dataset: MixtureDataset) -> Statistics:
    """The statistics of this phase's data, each frame weighted as it is drawn."""
    return dataset.statistics()


def pool(datasets: Sequence[MixtureDataset], shares: Sequence[float]) -> Statistics:
    """Exact statistics over the frames of several phases' data; each phase has its share of the weight.

    A share that says what the policy has seen is the number of samples drawn in the phase. They need not sum to 1.
    """
    if len(datasets) != len(shares) or min(shares, default=0.0) <= 0:
        raise UserError(f"pooled statistics: {len(datasets)} mixtures with the shares {list(shares)}.")
    total = sum(shares)
    parts = [
        part for dataset, share in zip(datasets, shares, strict=True) for part in dataset.parts(scale=share / total)
    ]
    return pooled_statistics(parts)
