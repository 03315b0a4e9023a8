"""Which bodies may touch something during a control step, so that MuJoCo looks for contacts among these alone.

MuJoCo's search computes the bounds of every shape of every body that can touch anything, at every physics step, also
of what sleeps or stands for good: of 1,300 shapes in a kitchen, where two dozen can meet. A body whose two masks are
zero is left out of it. Masks are those of the model, changed within a control step only.

What is found is the same, bit for bit, because only bodies are left out that nothing can reach: of the pairs that are
looked at, those in contact come out in the same order. Why that holds: `docs/decisions/0031`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled
from robocasa_lerobot.envs.physics.quaternions import matrices

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# How far a point of a moving body may get from where it was while others are left out. What is nearer to it than this
# is looked at: more of it costs time, and so does choosing again. The arm makes up to 5 cm in a control step.
FREE_M = 0.10
# The same for what sleeps within its reach: woken, it is looked at where it lies, and moves in the next step.
FREE_ASLEEP_M = 0.001


class Shapes(NamedTuple):
    """The bodies that can be left out, n of them: all that have shapes that touch, but for the world's own.

    Attributes:
        bodies: their numbers.
        trees: the tree of each, -1 for what stands for good.
        center, half: box around a body's shapes, in its frame, metres (n, 3).
        radius: distance of the farthest corner from the body's origin, metres.
    """

    bodies: Indices
    trees: Indices
    center: Array
    half: Array
    radius: Array


class Watch(NamedTuple):
    """What must hold while bodies are left out; arrays of fixed size, written by `leave_out`.

    Attributes:
        n_watched: how many bodies are watched (1,); 0 while none is left out.
        bodies, radius, free: of each watched one its number, as in `Shapes`, and how far it may move, metres.
        xpos, xmat: its pose when they were left out.
        may_move: whether all around a tree is looked at, (ntree,); that of any other must not wake.
        contype, conaffinity: masks of all bodies as they are in the model (nbody,).
        all_xpos, all_xmat, contype_now, conaffinity_now: views of MuJoCo's arrays.
    """

    n_watched: Indices
    bodies: Indices
    radius: Array
    free: Array
    xpos: Array
    xmat: Array
    may_move: NDArray[np.bool_]
    contype: NDArray[np.int32]
    conaffinity: NDArray[np.int32]
    all_xpos: Array
    all_xmat: Array
    contype_now: NDArray[np.int32]
    conaffinity_now: NDArray[np.int32]


class Nearby:
    """Leaves out of the search for contacts what nothing can reach, for one model and its data.

    `watch` says under which conditions; whoever steps the physics looks after every step whether they hold, and puts
    the masks back (`panda_omron/control/kernel.py`).
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        # Without these, only what is awake moves, and what is asleep wakes by a contact or by the user's hand.
        self._applies = not (
            model.nmocap
            or model.nflex
            or (model.eq_obj2id >= 0).any()
            or model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
        )
        self._asleep = data.tree_asleep
        self._shapes = _shapes(model)
        most = self._shapes.bodies.size
        self.watch: Watch = Watch(
            n_watched=np.zeros(1, dtype=np.int64),
            bodies=np.zeros(most, dtype=np.int64),
            radius=np.zeros(most),
            free=np.zeros(most),
            xpos=np.zeros((most, 3)),
            xmat=np.zeros((most, 9)),
            may_move=np.zeros(model.ntree, dtype=np.bool_),
            contype=np.zeros(model.nbody, dtype=np.int32),
            conaffinity=np.zeros(model.nbody, dtype=np.int32),
            all_xpos=data.xpos,
            all_xmat=data.xmat,
            contype_now=model.body_contype,
            conaffinity_now=model.body_conaffinity,
        )

    def leave_out(self) -> None:
        """Set the masks of what is out of reach to zero, for a model in which that is sound; poses are evaluated."""
        if self._applies:
            leave_out(self._shapes, self.watch, self._asleep)

    def look_at_all(self) -> None:
        """Give the bodies that were left out their masks back."""
        if self.watch.n_watched[0]:
            self.watch.contype_now[:] = self.watch.contype
            self.watch.conaffinity_now[:] = self.watch.conaffinity
            self.watch.n_watched[0] = 0


@compiled
def leave_out(shapes: Any, watch: Any, asleep: NDArray[np.int32]) -> None:
    """Keep what is awake, what is near it, and what is around that if it sleeps and may be woken; leave out the rest.

    `asleep` is MuJoCo's `tree_asleep`: negative if awake, else the next of the trees that sleep and wake together.
    """
    n = shapes.bodies.size
    low, high = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        _bounds(shapes, watch, i, low, high)
    kept = np.zeros(n, dtype=np.bool_)
    watch.may_move[:] = False
    count = 0
    for i in range(n):
        tree = shapes.trees[i]
        if tree >= 0 and asleep[tree] < 0:
            watch.may_move[tree] = True
            count = _keep(shapes, watch, i, FREE_M, count, low, high, kept)
    for i in range(n):
        tree = shapes.trees[i]
        while tree >= 0 and kept[i] and not watch.may_move[tree]:
            watch.may_move[tree] = True
            tree = asleep[tree]
    for i in range(n):
        tree = shapes.trees[i]
        if tree >= 0 and asleep[tree] >= 0 and watch.may_move[tree]:
            count = _keep(shapes, watch, i, FREE_ASLEEP_M, count, low, high, kept)
    if count == 0:  # nothing moves, so nothing is watched
        return
    watch.n_watched[0] = count
    watch.contype[:] = watch.contype_now
    watch.conaffinity[:] = watch.conaffinity_now
    for i in range(n):
        if not kept[i]:
            watch.contype_now[shapes.bodies[i]] = watch.conaffinity_now[shapes.bodies[i]] = 0


@compiled
def _bounds(shapes: Any, watch: Any, i: int, low: Array, high: Array) -> None:
    """The box of a body along the axes of the world."""
    body = shapes.bodies[i]
    for k in range(3):
        middle, half = watch.all_xpos[body, k], 0.0
        for j in range(3):
            middle += watch.all_xmat[body, 3 * k + j] * shapes.center[i, j]
            half += abs(watch.all_xmat[body, 3 * k + j]) * shapes.half[i, j]
        low[i, k], high[i, k] = middle - half, middle + half


@compiled
def _keep(
    shapes: Any, watch: Any, i: int, free: float, count: int, low: Array, high: Array, kept: NDArray[np.bool_]
) -> int:
    """Keep a body and all within `free` metres of it, and watch it; returns how many are watched."""
    body = shapes.bodies[i]
    watch.bodies[count], watch.radius[count], watch.free[count] = body, shapes.radius[i], free
    watch.xpos[count], watch.xmat[count] = watch.all_xpos[body], watch.all_xmat[body]
    kept[i] = True
    for j in range(kept.size):
        if not kept[j]:
            k = 0
            while k < 3 and low[i, k] - free <= high[j, k] and low[j, k] <= high[i, k] + free:
                k += 1
            kept[j] = k == 3
    return count + 1


def _shapes(model: mujoco.MjModel) -> Shapes:
    touches = (model.geom_contype | model.geom_conaffinity) != 0
    endless = model.geom_bodyid[model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE]
    bodies = np.setdiff1d(model.geom_bodyid[touches], np.append(endless, 0))
    geoms = np.flatnonzero(touches & np.isin(model.geom_bodyid, bodies))
    geoms = geoms[np.argsort(model.geom_bodyid[geoms], kind="stable")]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    aabb = model.geom_aabb[geoms]
    corners = aabb[:, None, :3] + signs * aabb[:, None, 3:]
    local = model.geom_pos[geoms, None] + corners @ matrices(model.geom_quat[geoms]).transpose(0, 2, 1)
    # A contact counts from this distance on.
    reach = (model.geom_margin[geoms] + model.geom_gap[geoms])[:, None]
    first = np.searchsorted(model.geom_bodyid[geoms], bodies)
    low = np.minimum.reduceat(local.min(axis=1) - reach, first)
    high = np.maximum.reduceat(local.max(axis=1) + reach, first)
    radius = np.linalg.norm(np.maximum(abs(low), abs(high)), axis=1)
    trees = model.body_treeid[bodies].astype(np.int64)
    return Shapes(bodies.astype(np.int64), trees, (low + high) / 2, (high - low) / 2, radius)
