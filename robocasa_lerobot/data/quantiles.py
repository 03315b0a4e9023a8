"""Exact quantiles of more numbers than fit in memory, each with a weight.

A float's bits can be reordered into an integer that sorts as the float does. A pass over the data counts the weight of
each value of its highest 16 bits, which tells in which of these 65,536 bins a quantile lies; the next pass does the
same for the following 16 bits inside that bin, and so on: two passes for float32, four for float64.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_BITS = 16
_BINS = 1 << _BITS
# A sum of weights that should be equal to a level may miss it by rounding; relative, far below one frame's weight.
_ROUNDING = 1e-10


class QuantileSearch:
    """Quantiles of each of `size` columns: the smallest value that at least `levels` of the weight does not exceed.

    Give all data to `add`, then call `narrow`; `passes` times.
    """

    def __init__(self, size: int, levels: Sequence[float], dtype: np.dtype[Any]) -> None:
        self.size, self.levels, self.dtype = size, np.asarray(levels), dtype
        self.passes = dtype.itemsize * 8 // _BITS
        self._done = 0
        # For each column and level: the bits found so far, and the weight of all values below them.
        self._found: NDArray[np.uint64] = np.zeros((size, len(levels)), np.uint64)
        self._below = np.zeros((size, len(levels)))
        self._total = np.zeros(size)
        self._bins: list[dict[int, NDArray[np.float64]]] = [{0: np.zeros(_BINS)} for _ in range(size)]

    def add(self, values: NDArray[Any], weight: float) -> None:
        """Values (n, size), each of which weighs `weight`."""
        keys = _sortable(values)
        rest = self.dtype.itemsize * 8 - _BITS * (self._done + 1)  # bits below those of this pass
        digits = (keys >> keys.dtype.type(rest)) & keys.dtype.type(_BINS - 1)
        above = keys >> keys.dtype.type(rest + _BITS) if self._done else None
        for column in range(self.size):
            for prefix, bins in self._bins[column].items():
                chosen = digits[:, column] if above is None else digits[above[:, column] == prefix, column]
                if len(chosen):
                    counts = np.bincount(chosen)
                    bins[: len(counts)] += weight * counts

    def narrow(self) -> None:
        """End a pass over the data."""
        bins: list[dict[int, NDArray[np.float64]]] = []
        for column in range(self.size):
            if not self._done:
                self._total[column] = self._bins[column][0].sum()
            for number, level in enumerate(self.levels):
                weights = self._bins[column][int(self._found[column, number])]
                sums = self._below[column, number] + np.cumsum(weights)
                wanted = (level - _ROUNDING) * self._total[column]
                last = int(np.flatnonzero(weights)[-1])  # rounding must not lead beyond the largest value
                digit = min(int(np.searchsorted(sums, wanted, side="left")), last)
                self._below[column, number] = sums[digit] - weights[digit]
                self._found[column, number] = (int(self._found[column, number]) << _BITS) | digit
            bins.append({int(prefix): np.zeros(_BINS) for prefix in np.unique(self._found[column])})
        self._bins = bins
        self._done += 1

    def result(self) -> NDArray[Any]:
        """(levels, size), once all passes are done."""
        assert self._done == self.passes
        return _value(self._found.T.astype(f"u{self.dtype.itemsize}"), self.dtype)


def _sortable(values: NDArray[Any]) -> NDArray[Any]:
    """Unsigned integers in the order of the floats: negative ones have all bits turned, others the sign only."""
    canonical = np.ascontiguousarray(values) + values.dtype.type(0)  # -0 becomes 0
    bits = canonical.view(f"u{values.dtype.itemsize}")
    sign = bits.dtype.type(1 << (bits.dtype.itemsize * 8 - 1))
    out: NDArray[Any] = np.where(bits & sign, ~bits, bits | sign)
    return out


def _value(keys: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    sign = keys.dtype.type(1 << (keys.dtype.itemsize * 8 - 1))
    bits = np.where(keys & sign, keys & ~sign, ~keys)
    return np.ascontiguousarray(bits).view(dtype)
