"""What a chunked policy looks back at: the same rule for its own queue and for a trial's."""

from __future__ import annotations

from collections.abc import Sequence


class LookBack[Seen]:
    """The observations of an episode that a chunk, now or later, is predicted from.

    Before the episode's start its first observation counts, as in training.

    Args:
        offsets: control steps, ascending up to 0, the newest.
        every: actions that are executed of each chunk.
    """

    def __init__(self, offsets: Sequence[int], every: int) -> None:
        self._offsets, self._every = tuple(offsets), every
        self._seen: dict[int, Seen] = {}  # by step

    def sees(self, step: int) -> bool:
        """Whether a chunk that is predicted at step `step` or later looks at it."""
        return any((step - offset) % self._every == 0 for offset in self._offsets)

    def note(self, step: int, observation: Seen) -> None:
        """Keep an observation if it `sees` it."""
        if self.sees(step):
            self._seen[step] = observation

    def at(self, step: int) -> tuple[Seen, ...]:
        """The observations for a chunk that is predicted at step `step`, oldest first; what is older is forgotten."""
        found = tuple(self._seen[max(0, step + offset)] for offset in self._offsets)
        oldest = step + self._offsets[0]
        self._seen = {at: one for at, one in self._seen.items() if at == 0 or at > oldest}
        return found
