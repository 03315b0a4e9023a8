"""Which bodies of a model belong together."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def subtree(model: mujoco.MjModel, *roots: str) -> NDArray[np.bool_]:
    """For each body whether it is one of the named ones or hangs on one, (nbody,)."""
    inside = np.zeros(model.nbody, dtype=np.bool_)
    for name in roots:
        root = model.body(name).id
        # Bodies are numbered depth first: the first later one whose parent lies before the root is outside.
        outside = np.flatnonzero(model.body_parentid[root + 1 :] < root)
        inside[root : root + 1 + int(outside[0]) if len(outside) else model.nbody] = True
    return inside
