"""What touches what: MuJoCo's contacts, and distances where both sides sleep and contacts are not listed."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.scene.bodies import near_pairs

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
    asleep = np.append(data.tree_asleep >= 0, True)  # the last is the world's tree, -1, which is static
    pairs = near_pairs(
        first,
        second,
        asleep,
        model.body_treeid,
        model.geom_bodyid,
        model.geom_contype,
        model.geom_conaffinity,
        model.geom_rbound,
        data.geom_xpos,
        ASLEEP_TOUCH_M,
    )
    return any(
        mujoco.mj_geomDistance(model, data, geom, other, 2 * ASLEEP_TOUCH_M, None) <= ASLEEP_TOUCH_M
        for geom, other in pairs.tolist()
    )
