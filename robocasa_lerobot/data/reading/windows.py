"""Windows of frames around frames: what a sample reads of the time before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Bounds:
    """Indices of the first and last frames that the windows around some frames may reach, (n,) each.

    Attributes:
        first: that may be seen.
        last: that may be seen or learned.
        first_action: that may be learned, since somebody else decided on what was done before.
    """

    first: Indices
    last: Indices
    first_action: Indices

    def window(
        self, frames: Indices, deltas: Sequence[int], of_actions: bool = False
    ) -> tuple[Indices, NDArray[np.bool_]]:
        """The frames so many steps from each, (n, time), and which of them are repeated edges, out of bounds."""
        wanted = frames[:, None] + np.asarray(deltas, dtype=np.int64)
        first, last = (self.first_action if of_actions else self.first)[:, None], self.last[:, None]
        return np.clip(wanted, first, last), (wanted < first) | (wanted > last)
