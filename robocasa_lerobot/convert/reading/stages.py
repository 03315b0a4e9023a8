"""Which stage each step of a demonstration belongs to, as this project's recordings say it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.demo import Demo, RejectedEpisodeError

STAGE_DATASET = "stage"  # (T,) index into ep_meta["stages"]


@dataclass(frozen=True)
class StageTrack:
    """Which stage each of T frames belongs to, (T,) int64, and the text of each stage."""

    index: NDArray[np.int64]
    texts: tuple[str, ...]

    def changes(self) -> list[int]:
        """Frames at which a stage begins, the first included."""
        return [0, *(np.flatnonzero(np.diff(self.index)) + 1).tolist()]


def has_stages(demo: Demo) -> bool:
    """Whether a demo has stages, and a text for each; damaged ones have none."""
    try:
        return _texts(demo) is not None
    except RejectedEpisodeError:
        return False


def stages_of(demo: Demo, instruction: str) -> StageTrack:
    """The stages of a demo; one that has none is a single stage that is called as its instruction.

    Raises:
        RejectedEpisodeError: a step belongs to a stage that is not described.
    """
    texts = _texts(demo)
    if texts is None:
        return StageTrack(np.zeros(demo.length, np.int64), (instruction,))
    values = demo.column(STAGE_DATASET)
    assert values is not None
    index = values.reshape(len(values), -1)[:, 0].astype(np.int64)
    wrong = np.flatnonzero((values[:, 0] != index) | (index < 0) | (index >= len(texts)))
    if values.shape[1] != 1 or len(wrong):
        at = int(wrong[0]) if len(wrong) else 0
        raise RejectedEpisodeError(f"step {at} belongs to stage {values[at].tolist()}, and it has {len(texts)} stages.")
    return StageTrack(index, texts)


def _texts(demo: Demo) -> tuple[str, ...] | None:
    """The text of each stage, or None where there are no stages, or not all have one (as in older recordings)."""
    if not demo.has(STAGE_DATASET):
        return None
    rows: Any = demo.ep_meta.get("stages")
    if not isinstance(rows, list) or not rows:
        return None
    texts = [row.get("text") if isinstance(row, dict) else None for row in rows]
    if not all(isinstance(text, str) and text.strip() for text in texts):
        return None
    return tuple(str(text) for text in texts)
