"""A client's session, and what its requests may say beside the observation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

_LIMIT = 2**63


class RequestError(ValueError):
    """A request that cannot be answered: the text names the key, what was found and what was expected."""


class Session:
    """The requests of one client, trial by trial: seed and number of each, where it does not give them itself.

    Args:
        server_seed: of the server.
        index: of the session among all of the server, from 0.
    """

    def __init__(self, server_seed: int, index: int) -> None:
        self._stream = np.random.SeedSequence([server_seed, index])
        self._seed, self._number = self._own_seed(), 0
        self.actor: Any = None  # of a policy that acts step by step, with its queues

    def begin(self, seed: int | None = None) -> None:
        """A new trial; its noise comes from `seed`, else from the session's own stream."""
        self._seed, self._number = self._own_seed() if seed is None else seed, 0

    def next(self, seed: int | None = None, number: int | None = None) -> tuple[int, int]:
        """Seed and number of the next request: the client's own, else a trial's seed and its requests counted."""
        if seed is not None and seed != self._seed:
            self._seed, self._number = seed, 0
        if number is not None:
            self._number = number
        self._number += 1
        return self._seed, self._number - 1

    def _own_seed(self) -> int:
        return int(self._stream.spawn(1)[0].generate_state(1, dtype=np.uint64)[0] >> 1)


def whole_number(message: Mapping[Any, Any], key: str) -> int | None:
    """A number of 0 or more, None where the message has no such key.

    Raises:
        RequestError: anything else.
    """
    value = message.get(key)
    if value is None:
        return None
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(()).item()
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= int(value) < _LIMIT:
        raise RequestError(f"{key}: found {value!r:.60}, expected a whole number from 0 to 2^63 - 1.")
    return int(value)
