"""What a dataset keeps of an episode beside its tables: its scene, packed, and the simulator's states."""

from __future__ import annotations

import gzip
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.convert.reading.hdf5 import RejectedEpisodeError

MAX_MODEL_BYTES = 256 * 2**20  # of a packed scene: more is no scene
# Of files that were cut or changed: zip and zlib have errors of their own.
_DAMAGE = (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error)


def read_scene(file: Path) -> str:
    """The MJCF of a `model.xml.gz`.

    Raises:
        RejectedEpisodeError: it cannot be read, or is no scene.
    """
    try:
        with gzip.open(file) as stream:
            content = stream.read(MAX_MODEL_BYTES + 1)
        if len(content) > MAX_MODEL_BYTES:
            raise ValueError(f"it unpacks to more than {MAX_MODEL_BYTES} bytes")
        return content.decode("utf-8")
    except _DAMAGE as error:
        raise RejectedEpisodeError(f"its extras/{file.name} cannot be used ({error}).") from None


def read_states(file: Path, length: int) -> NDArray[np.float64]:
    """The states of a `states.npz`, shape (length, n).

    Raises:
        RejectedEpisodeError: it cannot be read, or has no such array of finite numbers.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            states = np.asarray(arrays["states"], np.float64)
        if states.ndim != 2 or len(states) != length or not np.isfinite(states).all():
            raise ValueError(f"states are {states.shape}, expected ({length}, n) finite numbers")
        return states
    except (*_DAMAGE, TypeError) as error:
        raise RejectedEpisodeError(f"its extras/{file.name} cannot be used ({error}).") from None
