"""MuJoCo's own warnings, which say when a simulation has left the numbers that make sense."""

from __future__ import annotations

from typing import Any


class PhysicsWarnings:
    """Counts MuJoCo's warnings from now on; of an env without MuJoCo there are none.

    Where positions, velocities or accelerations go bad, MuJoCo warns and resets the state: what comes after is no
    longer the trial.
    """

    def __init__(self, env: Any) -> None:
        self._data: Any = getattr(env, "data", None)
        self._bad: dict[int, str] = {}
        self._names: list[str] = []
        if not hasattr(self._data, "warning"):
            self._data = None
            return
        import mujoco

        kinds = mujoco.mjtWarning
        self._names = [str(kinds(i).name).removeprefix("mjWARN_").lower() for i in range(int(kinds.mjNWARNING))]
        bad = {"badqpos": "bad positions", "badqvel": "bad velocities", "badqacc": "bad accelerations"}
        self._bad = {i: bad[name] for i, name in enumerate(self._names) if name in bad}
        self._before = self._read()

    def divergence(self) -> str | None:
        """What diverged since the start, in words, or None."""
        if self._data is None:
            return None
        for index, words in self._bad.items():
            if int(self._data.warning[index].number) > self._before[index]:
                return words
        return None

    def counts(self) -> dict[str, int]:
        """Warnings since the start by name, those that occurred."""
        if self._data is None:
            return {}
        now = self._read()
        return {
            n: after - before for n, before, after in zip(self._names, self._before, now, strict=True) if after > before
        }

    def _read(self) -> list[int]:
        return [int(warning.number) for warning in self._data.warning]
