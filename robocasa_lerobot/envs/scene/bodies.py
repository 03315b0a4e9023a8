"""Which bodies of a model belong together, which are loose, and which that sleep may touch each other."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled

Array = NDArray[np.float64]
Numbers = NDArray[np.int32]
Flags = NDArray[np.bool_]


def subtree(model: mujoco.MjModel, *roots: str) -> NDArray[np.bool_]:
    """For each body whether it is one of the named ones or hangs on one, (nbody,)."""
    inside = np.zeros(model.nbody, dtype=np.bool_)
    for name in roots:
        root = model.body(name).id
        # Bodies are numbered depth first: the first later one whose parent lies before the root is outside.
        outside = np.flatnonzero(model.body_parentid[root + 1 :] < root)
        inside[root : root + 1 + int(outside[0]) if len(outside) else model.nbody] = True
    return inside


def is_loose(model: mujoco.MjModel, body: int) -> bool:
    """Whether a body, with what it hangs on, goes where it is pushed."""
    joint = int(model.body_jntadr[model.body_rootid[body]])
    return joint >= 0 and bool(model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE)


@compiled
def near_pairs(
    first: Flags,
    second: Flags,
    asleep: Flags,
    trees: Numbers,
    bodies: Numbers,
    contype: Numbers,
    conaffinity: Numbers,
    radii: Array,
    positions: Array,
    margin: float,
) -> NDArray[np.int64]:
    """Pairs (n, 2) of a geom of each set, both of bodies that stand still, whose bounding spheres come near each other.

    Goals ask it at every control step.

    Args:
        first: for each body whether it is of the one set, (nbody,).
        second: for each body whether it is of the other set.
        asleep: for each tree whether it sleeps, (ntree + 1,); the last is that of what is static.
        trees: of each body its tree, -1 for what is static.
        bodies: of each geom its body, (ngeom,).
        contype: of each geom, as in the model.
        conaffinity: the same.
        radii: of the geoms' bounding spheres, metres; 0 for planes, which have none.
        positions: of the geoms, (ngeom, 3), metres.
        margin: that counts as near, metres.
    """
    ours, theirs = np.empty(len(bodies), dtype=np.int64), np.empty(len(bodies), dtype=np.int64)
    many = others = 0
    for geom in range(len(bodies)):
        body = bodies[geom]
        if not (first[body] or second[body]) or not (contype[geom] | conaffinity[geom]) or not asleep[trees[body]]:
            continue
        if first[body]:
            ours[many] = geom
            many += 1
        if second[body]:
            theirs[others] = geom
            others += 1
    found = np.empty((many * others, 2), dtype=np.int64)
    count = 0
    for i in range(many):
        for j in range(others):
            geom, other = ours[i], theirs[j]
            if not ((contype[geom] & conaffinity[other]) | (contype[other] & conaffinity[geom])):
                continue
            reach = radii[geom] + radii[other] + margin if radii[geom] != 0.0 and radii[other] != 0.0 else np.inf
            away = 0.0
            for k in range(3):
                away += (positions[other, k] - positions[geom, k]) ** 2
            if np.sqrt(away) <= reach:
                found[count, 0], found[count, 1] = geom, other
                count += 1
    return found[:count].copy()
