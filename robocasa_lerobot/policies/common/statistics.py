"""Dataset statistics made safe for normalisation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

CONSTANT_RANGE = 1e-3  # a component with less between its ends counts as constant, where a policy has no range itself
_QUANTILES = (("q01", "q99"), ("q10", "q90"))


def widen_constant_components(
    stats: Mapping[str, Mapping[str, Any]], keys: Iterable[str], constant_range: float
) -> dict[str, dict[str, Any]]:
    """Statistics in which components that hardly vary are centred and keep their scale.

    Min-max normalisation divides by max - min. For a component that is constant in the data (a torso that never
    moves, a base that stays put) this is division by nothing: a value that differs in the seventh digit becomes
    enormous, and so does the whole component in a later training phase that keeps the statistics. Diffusion
    Policy's rule is used instead: where the range is below `constant_range`, the range becomes 2 around its
    middle (min-max then only subtracts the middle), and a standard deviation becomes 1. A component that moves, but
    so seldom that a pair of quantiles does not see it, gets min and max in their places.

    Args:
        stats: LeRobot's statistics, feature -> name -> array of shape (components,). Left untouched.
        keys: features to treat, those with vectors of components.
        constant_range: components with max - min below this, in the component's own unit, count as constant.

    Returns:
        A copy of `stats` with the features in `keys` treated, where they have `min` and `max`.
    """
    out: dict[str, dict[str, Any]] = {key: dict(value) for key, value in stats.items()}
    for key in keys:
        if key not in out or "min" not in out[key] or "max" not in out[key]:
            continue
        low = np.asarray(out[key]["min"], dtype=np.float64)
        high = np.asarray(out[key]["max"], dtype=np.float64)
        constant = (high - low) < constant_range
        for lower, upper in _QUANTILES:
            if lower in out[key] and upper in out[key]:
                below, above = (np.asarray(out[key][name], dtype=np.float64) for name in (lower, upper))
                narrow = (above - below) < constant_range
                out[key][lower] = np.where(narrow, low, below)
                out[key][upper] = np.where(narrow, high, above)
        middle = (low + high) / 2
        for names, offset in ((("min", "q01", "q10"), -1.0), (("max", "q99", "q90"), 1.0)):
            for name in names:
                if name in out[key]:
                    out[key][name] = np.where(constant, middle + offset, np.asarray(out[key][name], dtype=np.float64))
        if "std" in out[key]:
            out[key]["std"] = np.where(constant, 1.0, np.asarray(out[key]["std"], dtype=np.float64))
    return out


def leave_components(
    stats: Mapping[str, Mapping[str, Any]], key: str, components: Sequence[int]
) -> dict[str, dict[str, Any]]:
    """Statistics with which normalisation leaves `components` of feature `key` as they are; a copy.

    Raises:
        IndexError: the feature has fewer components.
    """
    out: dict[str, dict[str, Any]] = {name: dict(value) for name, value in stats.items()}
    neutral = {"min": -1.0, "max": 1.0, "q01": -1.0, "q99": 1.0, "q10": -1.0, "q90": 1.0, "mean": 0.0, "std": 1.0}
    for name, value in neutral.items():
        if name in out.get(key, {}):
            array = np.array(out[key][name], dtype=np.float64)
            array[list(components)] = value
            out[key][name] = array
    return out
