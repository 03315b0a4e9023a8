"""Which numbers are seeds of a scene, and which are counts of something."""

from __future__ import annotations

from typing import Any

import numpy as np

from robocasa_lerobot.errors import UserError

LARGEST_SEED = 2**63  # exclusive: infos, recordings and the status of workers hold seeds as int64
SEEDS = "a whole number from 0 to 2**63 - 1"


def is_seed(value: Any) -> bool:
    """Whether it is a whole number, Python's or NumPy's, that a scene can be made from."""
    return isinstance(value, (int, np.integer)) and 0 <= int(value) < LARGEST_SEED


def checked_seed(value: Any) -> int:
    """The seed as Python's own number.

    Raises:
        UserError: it is none.
    """
    if not is_seed(value):
        raise UserError(f"seed: found {value!r}, expected {SEEDS}.")
    return int(value)


def checked_count(what: str, value: Any, most: int | None = None) -> int:
    """A number of pixels or steps, from 1 on, as Python's own.

    Raises:
        UserError: it is none; `what` is how the message calls it.
    """
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < 1 or (most is not None and value > most):
        expected = "of at least 1" if most is None else f"from 1 to {most}"
        raise UserError(f"{what}: found {value!r}, expected a whole number {expected}.")
    return int(value)
