"""What touches what: MuJoCo's contacts, and distances where both sides sleep and contacts are not listed."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

# Two sleeping bodies count as touching when their collision geoms are this near, metres; MuJoCo lists no contact
# between them, and contacts at rest penetrate by a little.
ASLEEP_TOUCH_M = 0.001


def touching(model: mujoco.MjModel, data: mujoco.MjData, first: NDArray[np.bool_], second: NDArray[np.bool_]) -> bool:
    """Whether a body of one set touches a body of the other; the sets as of `bodies.subtree`.

    Before: contacts are evaluated.
    """
    if data.ncon:
        bodies = model.geom_bodyid[data.contact.geom[: data.ncon]]
        met = data.contact.dist[: data.ncon] <= 0.0
        crossed = (first[bodies[:, 0]] & second[bodies[:, 1]]) | (first[bodies[:, 1]] & second[bodies[:, 0]])
        if bool((crossed & met).any()):
            return True
    return _touching_asleep(model, data, first, second)


def pushes(
    model: mujoco.MjModel, data: mujoco.MjData, first: NDArray[np.bool_], second: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Directions in which bodies of one set push bodies of the other, unit vectors (n, 3), one for each contact.

    Before: contacts are evaluated. Where both sides sleep none are listed.
    """
    bodies = model.geom_bodyid[data.contact.geom[: data.ncon]].reshape(-1, 2)
    met = data.contact.dist[: data.ncon] <= 0.0
    normals = data.contact.frame[: data.ncon, :3]  # from the first geom to the second
    along, against = first[bodies] & met[:, None], second[bodies]
    pushing: NDArray[np.float64] = np.concatenate(
        [normals[along[:, 0] & against[:, 1]], -normals[along[:, 1] & against[:, 0]]]
    )
    return pushing


def _touching_asleep(
    model: mujoco.MjModel, data: mujoco.MjData, first: NDArray[np.bool_], second: NDArray[np.bool_]
) -> bool:
    still = _still(model, data)
    ours = np.flatnonzero((first & still)[model.geom_bodyid] & (model.geom_contype | model.geom_conaffinity > 0))
    theirs = np.flatnonzero((second & still)[model.geom_bodyid] & (model.geom_contype | model.geom_conaffinity > 0))
    sizes = model.geom_rbound
    # A plane has no bounding sphere.
    reach = np.where(sizes == 0, np.inf, sizes)
    apart = np.linalg.norm(data.geom_xpos[theirs][None] - data.geom_xpos[ours][:, None], axis=2)
    near = apart <= reach[theirs] + reach[ours][:, None] + ASLEEP_TOUCH_M
    for geom, others in zip(ours, near, strict=True):
        for other in theirs[others]:
            if not _may_collide(model, int(geom), int(other)):
                continue
            if mujoco.mj_geomDistance(model, data, int(geom), int(other), 2 * ASLEEP_TOUCH_M, None) <= ASLEEP_TOUCH_M:
                return True
    return False


def _still(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.bool_]:
    """For each body whether it is static or asleep, (nbody,)."""
    tree = model.body_treeid
    asleep = np.append(data.tree_asleep >= 0, True)  # -1 is the world's, which is static
    still: NDArray[np.bool_] = asleep[tree]
    return still


def _may_collide(model: mujoco.MjModel, first: int, second: int) -> bool:
    a, b = model.geom_contype, model.geom_conaffinity
    return bool((a[first] & b[second]) or (a[second] & b[first]))
