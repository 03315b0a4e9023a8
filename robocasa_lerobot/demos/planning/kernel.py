"""The planner's inner loops, compiled: the arm's kinematics, forward and inverse, and what a configuration touches.

They stand in one file because numba's cache on disk follows the changes of a function's own file only (why compiled:
`docs/decisions/0009` and `0027`). Distances of two shapes are MuJoCo's own, called by name from its library;
`native.load()` makes them known before the first call.

Frames: the arm's frame is the site that arm commands are given in; link 0 is the mobile base, which is rigid with that
frame, links 1 to 7 are the arm's, and the hand with its fingers goes with link 7.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

ARM_DOFS = 7
ITERATIONS, DAMPING = 40, 0.05
HOPELESS_AFTER, HOPELESS_M = 10, 0.06  # a pose as far as this after so many iterations is given up
STEP_M, STEP_RAD, TOWARDS_HOME = 0.12, 0.5, 0.15
SOLVED_M, SOLVED_RAD = 0.002, 0.02

_geom_distance = types.ExternalFunction(
    "mj_geomDistance",
    types.float64(types.intp, types.intp, types.int32, types.int32, types.float64, types.intp),
)


class Chain(NamedTuple):
    """Seven hinges about their links' z axes.

    Attributes:
        first_position, first_rotation: (3,), (3, 3) of the first hinge's parent in the arm's frame.
        positions, rotations: (7, 3), (7, 3, 3) of each link in its parent, at zero angle.
        grip: (3,) of the grip site in the last link.
        hand: (3, 3) of the hand in the last link.
        low, high, home: (7,) radians.
    """

    first_position: Array
    first_rotation: Array
    positions: Array
    rotations: Array
    grip: Array
    hand: Array
    low: Array
    high: Array
    home: Array


class Shapes(NamedTuple):
    """Geoms, with their boxes.

    Attributes:
        geoms: (n,) numbers in the model.
        bodies: (n,) numbers of their bodies.
        links: (n,) that they go with, for geoms that move; zeros for others.
        is_hand: (n,) whether they belong to the hand.
        positions, rotations: (n, 3), (n, 3, 3) in the link's frame, or the world.
        middles, halves: (n, 3) of their boxes in the geom's frame.
        low, high: (n, 3) corners of what stands still, in the world; zeros for others.
        contype, conaffinity: (n,) as of the model.
    """

    geoms: Indices
    bodies: Indices
    links: Indices
    is_hand: Flags
    positions: Array
    rotations: Array
    middles: Array
    halves: Array
    low: Array
    high: Array
    contype: Indices
    conaffinity: Indices


@compiled
def link_frames(chain: Any, joints: Array, position: Array, rotation: Array) -> None:
    """Write the links' positions (8, 3) and rotations (8, 3, 3) in the arm's frame; link 0 is that frame itself."""
    for i in range(3):
        position[0, i] = 0.0
        for j in range(3):
            rotation[0, i, j] = 1.0 if i == j else 0.0
    for link in range(ARM_DOFS):
        c, s = np.cos(joints[link]), np.sin(joints[link])
        for i in range(3):
            if link == 0:
                p = chain.first_position[i]
                b0, b1, b2 = chain.first_rotation[i, 0], chain.first_rotation[i, 1], chain.first_rotation[i, 2]
            else:
                p = position[link, i]
                b0, b1, b2 = rotation[link, i, 0], rotation[link, i, 1], rotation[link, i, 2]
            offset, turn = chain.positions, chain.rotations
            m0 = b0 * turn[link, 0, 0] + b1 * turn[link, 1, 0] + b2 * turn[link, 2, 0]
            m1 = b0 * turn[link, 0, 1] + b1 * turn[link, 1, 1] + b2 * turn[link, 2, 1]
            m2 = b0 * turn[link, 0, 2] + b1 * turn[link, 1, 2] + b2 * turn[link, 2, 2]
            position[link + 1, i] = p + b0 * offset[link, 0] + b1 * offset[link, 1] + b2 * offset[link, 2]
            rotation[link + 1, i, 0], rotation[link + 1, i, 1] = c * m0 + s * m1, c * m1 - s * m0
            rotation[link + 1, i, 2] = m2


@compiled
def _grip(chain: Any, position: Array, rotation: Array, grip: Array, hand: Array) -> None:
    for i in range(3):
        l0, l1, l2 = rotation[ARM_DOFS, i, 0], rotation[ARM_DOFS, i, 1], rotation[ARM_DOFS, i, 2]
        grip[i] = position[ARM_DOFS, i] + l0 * chain.grip[0] + l1 * chain.grip[1] + l2 * chain.grip[2]
        for j in range(3):
            hand[i, j] = l0 * chain.hand[0, j] + l1 * chain.hand[1, j] + l2 * chain.hand[2, j]


@compiled
def forward(chain: Any, joints: Array, grips: Array, hands: Array) -> None:
    """Write grip positions (N, 3) and hand rotations (N, 3, 3) at joint angles (N, 7), in the arm's frame."""
    position, rotation = np.empty((8, 3)), np.empty((8, 3, 3))
    for n in range(len(joints)):
        link_frames(chain, joints[n], position, rotation)
        _grip(chain, position, rotation, grips[n], hands[n])


@compiled
def _axis_angle(wanted: Array, present: Array, out: Array) -> None:
    """Write the turn (3,) from a present rotation to a wanted one; near half a turn the axis is approximate."""
    m = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            m[i, j] = wanted[i, 0] * present[j, 0] + wanted[i, 1] * present[j, 1] + wanted[i, 2] * present[j, 2]
    out[0], out[1], out[2] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]) / 2.0
    angle = np.arctan2(sine, (m[0, 0] + m[1, 1] + m[2, 2] - 1.0) / 2.0)
    scale = angle / max(2.0 * sine, 1e-6)
    for i in range(3):
        out[i] *= scale


@compiled
def _step(
    chain: Any, joints: Array, position: Array, rotation: Array, grip: Array, error: Array, jacobian: Array, a: Array
) -> None:
    """Turn the joints (7,) by one damped least-squares step along an error (6,), its null space towards home.

    The Jacobian (6, 7) and a matrix (6, 6) are memory to work in.
    """
    for k in range(ARM_DOFS):
        a0, a1, a2 = rotation[k + 1, 0, 2], rotation[k + 1, 1, 2], rotation[k + 1, 2, 2]
        r0, r1, r2 = grip[0] - position[k + 1, 0], grip[1] - position[k + 1, 1], grip[2] - position[k + 1, 2]
        jacobian[0, k], jacobian[1, k], jacobian[2, k] = a1 * r2 - a2 * r1, a2 * r0 - a0 * r2, a0 * r1 - a1 * r0
        jacobian[3, k], jacobian[4, k], jacobian[5, k] = a0, a1, a2
    rest = np.empty(ARM_DOFS)
    for k in range(ARM_DOFS):
        rest[k] = TOWARDS_HOME * (chain.home[k] - joints[k])
    # With A = J J' + damping: step = J' A^-1 (error - J rest) + rest, by a Cholesky factorization of A.
    b = np.empty(6)
    for i in range(6):
        b[i] = error[i]
        for k in range(ARM_DOFS):
            b[i] -= jacobian[i, k] * rest[k]
        for j in range(i + 1):
            total = DAMPING * DAMPING if i == j else 0.0
            for k in range(ARM_DOFS):
                total += jacobian[i, k] * jacobian[j, k]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = np.sqrt(total) if i == j else total / a[j, j]
    for i in range(6):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for back in range(6):
        i = 5 - back
        for k in range(i + 1, 6):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]
    for k in range(ARM_DOFS):
        total = joints[k] + rest[k]
        for i in range(6):
            total += jacobian[i, k] * b[i]
        joints[k] = min(max(total, chain.low[k]), chain.high[k])


@compiled
def solve(
    chain: Any, positions: Array, rotations: Array, hopeful: Flags, joints: Array, errors: Array, chained: bool
) -> None:
    """Turn joint angles (N, 7) towards grip positions (N, 3) and hand rotations (N, 3, 3); write the errors (N, 2).

    Rows that are not `hopeful` stay as they are; where `chained`, each begins as the one before it ended. Errors are
    metres and radians.
    """
    position, rotation = np.empty((8, 3)), np.empty((8, 3, 3))
    grip, hand, turn, error = np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(6)
    jacobian, a = np.empty((6, ARM_DOFS)), np.empty((6, 6))
    for n in range(len(joints)):
        if chained and n > 0:
            joints[n] = joints[n - 1]
        for iteration in range(ITERATIONS + 1):
            link_frames(chain, joints[n], position, rotation)
            _grip(chain, position, rotation, grip, hand)
            _axis_angle(rotations[n], hand, turn)
            far = 0.0
            for i in range(3):
                error[i] = positions[n, i] - grip[i]
                far += error[i] * error[i]
            far = np.sqrt(far)
            turned = np.sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
            errors[n, 0], errors[n, 1] = far, turned
            if not hopeful[n] or iteration == ITERATIONS or (far <= SOLVED_M and turned <= SOLVED_RAD):
                break
            if iteration == HOPELESS_AFTER and far >= HOPELESS_M:
                break
            shorter = min(1.0, STEP_M / max(far, 1e-9))
            smaller = min(1.0, STEP_RAD / max(turned, 1e-9))
            for i in range(3):
                error[i] *= shorter
                error[3 + i] = turn[i] * smaller
            _step(chain, joints[n], position, rotation, grip, error, jacobian, a)


@compiled
def _box(positions: Array, rotations: Array, middles: Array, halves: Array, low: Array, high: Array) -> None:
    """Write the corners (n, 3), (n, 3) of geoms' boxes along the axes.

    Loops stand inside of functions, here and below: to call a function with arrays takes longer than the arithmetic.
    """
    for g in range(len(positions)):
        for i in range(3):
            centre, reach = positions[g, i], 0.0
            for j in range(3):
                centre += rotations[g, i, j] * middles[g, j]
                reach += abs(rotations[g, i, j]) * halves[g, j]
            low[g, i], high[g, i] = centre - reach, centre + reach


@compiled
def boxes(shapes: Any) -> None:
    """Write the corners of the boxes of geoms that stand still."""
    _box(shapes.positions, shapes.rotations, shapes.middles, shapes.halves, shapes.low, shapes.high)


@compiled
def _near(low: Array, high: Array, other_low: Array, other_high: Array, margin: float, near: Indices) -> int:
    """Write the numbers of the boxes that overlap the box of all boxes (n, 3), and return how many they are."""
    l0, l1, l2 = low[:, 0].min() - margin, low[:, 1].min() - margin, low[:, 2].min() - margin
    h0, h1, h2 = high[:, 0].max() + margin, high[:, 1].max() + margin, high[:, 2].max() + margin
    count = 0
    for e in range(len(other_low)):
        if (
            other_low[e, 0] <= h0
            and other_high[e, 0] >= l0
            and other_low[e, 1] <= h1
            and other_high[e, 1] >= l1
            and other_low[e, 2] <= h2
            and other_high[e, 2] >= l2
        ):
            near[count] = e
            count += 1
    return count


@compiled
def _place(
    geoms: Indices, many: Indices, count: int, positions: Array, rotations: Array, xpos: Array, xmat: Array
) -> None:
    """Write the world poses of the first `count` of `many` geoms into MuJoCo's arrays."""
    for k in range(count):
        g = many[k]
        for i in range(3):
            xpos[geoms[g], i] = positions[g, i]
            for j in range(3):
                xmat[geoms[g], 3 * i + j] = rotations[g, i, j]


@compiled
def _place_once(
    geoms: Indices,
    many: Indices,
    count: int,
    placed: Flags,
    positions: Array,
    rotations: Array,
    xpos: Array,
    xmat: Array,
) -> None:
    """The same for those that are not `placed` yet: of what stands still in a kitchen little is ever near."""
    for k in range(count):
        g = many[k]
        if placed[g]:
            continue
        placed[g] = True
        for i in range(3):
            xpos[geoms[g], i] = positions[g, i]
            for j in range(3):
                xmat[geoms[g], 3 * i + j] = rotations[g, i, j]


@compiled
def _move(
    moving: Any, bases: Array, n: int, position: Array, rotation: Array, positions: Array, rotations: Array
) -> None:
    """Write where the geoms that move are: bases (N, 4) are the arm frame's x, y, z and heading."""
    c, s = np.cos(bases[n, 3]), np.sin(bases[n, 3])
    links, offsets, turns = moving.links, moving.positions, moving.rotations
    for g in range(len(links)):
        link = links[g]
        p0, p1, p2 = position[link, 0], position[link, 1], position[link, 2]
        for j in range(3):
            offset = offsets[g, j]
            p0 += rotation[link, 0, j] * offset
            p1 += rotation[link, 1, j] * offset
            p2 += rotation[link, 2, j] * offset
            m0 = m1 = m2 = 0.0
            for k in range(3):
                local = turns[g, k, j]
                m0 += rotation[link, 0, k] * local
                m1 += rotation[link, 1, k] * local
                m2 += rotation[link, 2, k] * local
            rotations[g, 0, j], rotations[g, 1, j], rotations[g, 2, j] = c * m0 - s * m1, s * m0 + c * m1, m2
        positions[g, 0], positions[g, 1] = bases[n, 0] + c * p0 - s * p1, bases[n, 1] + s * p0 + c * p1
        positions[g, 2] = bases[n, 2] + p2


@compiled
def _meet(
    model: int,
    data: int,
    moving: Any,
    low: Array,
    high: Array,
    others: Any,
    other_low: Array,
    other_high: Array,
    near: Indices,
    count: int,
    pardons: Indices,
    leans: Array,
    hand_may: bool,
    on_own_base: bool,
    margin: float,
    n: int,
    bodies: Indices,
    counts: Indices,
) -> None:
    """Note the bodies of the first `count` geoms of `near` that geoms which move touch, by MuJoCo's own distance."""
    most, within = bodies.shape[1], max(margin, 1e-3)
    mine, its, owners, links = moving.geoms, others.geoms, others.bodies, others.links
    is_hand, own_links, contype, conaffinity = moving.is_hand, moving.links, moving.contype, moving.conaffinity
    other_contype, other_conaffinity = others.contype, others.conaffinity
    for k in range(count):
        e = near[k]
        pardon = pardons[owners[e]]
        known = pardon == 1 or (on_own_base and links[e] != 0)
        for i in range(counts[n]):
            known |= bodies[n, i] == owners[e]
        if known:
            continue
        if counts[n] == most:
            return
        for g in range(len(mine)):
            if (is_hand[g] and pardon == 2 and hand_may) or (on_own_base and not is_hand[g]):
                continue
            if pardon == 3 and own_links[g] == 0:
                continue
            if (
                low[g, 0] > other_high[e, 0] + margin
                or other_low[e, 0] > high[g, 0] + margin
                or low[g, 1] > other_high[e, 1] + margin
                or other_low[e, 1] > high[g, 1] + margin
                or low[g, 2] > other_high[e, 2] + margin
                or other_low[e, 2] > high[g, 2] + margin
                or not ((contype[g] & other_conaffinity[e]) | (other_contype[e] & conaffinity[g]))
            ):
                continue
            least = -leans[its[e]] if leans[its[e]] > 0.0 else margin
            if _geom_distance(model, data, mine[g], its[e], within, 0) < least:
                bodies[n, counts[n]] = owners[e]
                counts[n] += 1
                break


@compiled
def touched(
    model: int,
    data: int,
    xpos: Array,
    xmat: Array,
    chain: Any,
    moving: Any,
    still: Any,
    part: Any,
    part_positions: Array,
    part_rotations: Array,
    pardons: Indices,
    leans: Array,
    bases: Array,
    joints: Array,
    states: Indices,
    hand_may: Flags,
    margin: float,
    until_one: bool,
    bodies: Indices,
    counts: Indices,
) -> None:
    """Write which bodies the moving geoms touch at N configurations, up to as many as `bodies` (N, most) has room for.

    Args:
        model: address of MuJoCo's structure.
        data: the same; it is scratch.
        xpos: its geoms' positions.
        xmat: their rotations.
        chain: of the arm.
        moving: geoms of the robot and what it holds.
        still: geoms of what stands still.
        part: geoms of a part that moves.
        part_positions: (S, p, 3) of the part's geoms in each of its states.
        part_rotations: (S, p, 3, 3) of them.
        pardons: (nbody,) 1 for bodies that may be touched, 2 for those that the hand alone, 3 that the base alone may.
        leans: (ngeom,) metres that shapes may go into geoms which are leant on already, whatever the margin; else 0.
        bases: (N, 4) x, y, z in metres and heading in radians of the arm's frame.
        joints: (N, 7) radians.
        states: (N,) of the part.
        hand_may: (N,) whether the hand may touch what it alone may touch.
        margin: distance in metres below which two geoms touch.
        until_one: whether configurations after the first that touches something are left out.
        bodies: (N, most) written.
        counts: (N,) written.
    """
    many, parts = len(moving.geoms), len(part.geoms)
    position, rotation = np.empty((8, 3)), np.empty((8, 3, 3))
    positions, rotations = np.empty((many, 3)), np.empty((many, 3, 3))
    low, high = np.empty((many, 3)), np.empty((many, 3))
    part_low, part_high = np.empty((parts, 3)), np.empty((parts, 3))
    near, every = np.empty(len(still.geoms), dtype=np.int64), np.arange(max(many, parts))
    placed = np.zeros(len(still.geoms), dtype=np.bool_)
    state = -1
    for n in range(len(joints)):
        counts[n] = 0
        if parts and states[n] != state:
            state = states[n]
            _box(part_positions[state], part_rotations[state], part.middles, part.halves, part_low, part_high)
            _place(part.geoms, every, parts, part_positions[state], part_rotations[state], xpos, xmat)
        link_frames(chain, joints[n], position, rotation)
        _move(moving, bases, n, position, rotation, positions, rotations)
        _box(positions, rotations, moving.middles, moving.halves, low, high)
        _place(moving.geoms, every, many, positions, rotations, xpos, xmat)
        _meet(
            model, data, moving, low, high, part, part_low, part_high, every, parts,
            pardons, leans, hand_may[n], False, margin, n, bodies, counts,
        )  # fmt: skip
        count = _near(low, high, still.low, still.high, margin, near)
        _place_once(still.geoms, near, count, placed, still.positions, still.rotations, xpos, xmat)
        _meet(
            model, data, moving, low, high, still, still.low, still.high, near, count,
            pardons, leans, hand_may[n], False, margin, n, bodies, counts,
        )  # fmt: skip
        _meet(  # the hand, or what it holds, on the robot's own base
            model, data, moving, low, high, moving, low, high, every, many,
            pardons, leans, hand_may[n], True, margin, n, bodies, counts,
        )  # fmt: skip
        if until_one and counts[n]:
            return
