"""The controllers, compiled: what an action changes once per policy step, and what happens at every physics step.

Everything that runs 25 times in a control step is here, compiled by numba into one machine-code call that also
steps MuJoCo (why: `docs/decisions/0009`). The functions work on views of MuJoCo's arrays and on one flat vector, the
controller's whole memory. They stand in one file because numba's cache on disk follows the changes of a function's
own file only.

Arm: O. Khatib, "A unified approach for motion and force control of robot manipulators" (1987), with position and
orientation decoupled, a null-space posture and gravity compensation. Gains and goal rules are those of robosuite's
composite controller as RoboCasa 1.0.1 configures it for the PandaOmron.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.native import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ARM_KP = 150.0
ARM_KD = 2.0 * np.sqrt(ARM_KP)  # critical damping
NULLSPACE_KP = 10.0
NULLSPACE_KD = 2.0 * np.sqrt(NULLSPACE_KP)
POSITION_SCALE_M = 0.05  # goal displacement at a full command
ROTATION_SCALE_RAD = 0.5
MAX_YAW_RATE = 1.5  # rad/s at a full command; 1 m/s for the two slides
TORSO_KP = 2000.0
TORSO_KD = 2.0 * np.sqrt(TORSO_KP)
TORSO_SCALE_M = 0.05  # goal displacement at a full command
GRIPPER_SPEED = 0.2  # of the command's range -1..1, per policy step: ten steps from open to closed

# The controller's memory, one vector. Poses are in the arm's base frame; matrices in rows.
MEMORY_SIZE = 37
GOAL_POS, GOAL_MAT = slice(0, 3), slice(3, 12)
BASE_POS, BASE_MAT = slice(12, 15), slice(15, 24)  # the arm's base in the world, as of the last physics step
POSTURE = slice(24, 31)  # joint angles that the null space drifts to
BASE_TARGET = slice(31, 34)  # of the slides (m/s) and the hinge (rad/s)
TORSO_GOAL = 34  # metres
GRIPPER = slice(35, 37)  # finger commands, -1..1

ARM_DOFS = 7
_SINGULAR = 1e-14  # relative pivot below which a direction counts as lost (a stretched arm to the last digit)

# MuJoCo's own functions, by their names in its library; `native.load()` makes them known before the first call.
_mj_step1 = types.ExternalFunction("mj_step1", types.void(types.intp, types.intp))
_mj_step2 = types.ExternalFunction("mj_step2", types.void(types.intp, types.intp))


class Views(NamedTuple):
    """Arrays of one `MjData`, which stay where they are for its life."""

    qpos: Array
    qvel: Array
    ctrl: Array
    mass: Array
    bias: Array
    site_xpos: Array
    site_xmat: Array
    xaxis: Array
    xanchor: Array
    cvel: Array
    subtree_com: Array
    tree_asleep: NDArray[np.int32]


class Places(NamedTuple):
    """Where the robot lies in those arrays.

    Attributes:
        sites: grip site and arm base site.
        site_bodies: the bodies that carry them.
        root: body at the root of the robot's tree, whose centre of mass MuJoCo's velocities refer to.
        arm_joints, arm_qpos, arm_qvel: of the seven arm joints; all hinges.
        arm_mass: addresses in the sparse mass matrix of the arm's block (7, 7).
        base_yaw: in qpos.
        torso: in qpos, in qvel, in the mass matrix.
        actuators: 7 of the arm, 3 of the base, 1 of the torso, 2 of the fingers.
        tree_roots: body at the root of each tree; several trees may share one.
        finger_middle, finger_half: centre and half of the fingers' control ranges, metres.
    """

    sites: Indices
    site_bodies: Indices
    root: int
    arm_joints: Indices
    arm_qpos: Indices
    arm_qvel: Indices
    arm_mass: Indices
    base_yaw: int
    torso: Indices
    actuators: Indices
    tree_roots: Indices
    finger_middle: Array
    finger_half: Array


@compiled
def reset(memory: Array, views: Any, places: Any) -> None:
    """Hold the present pose: it becomes the goal, its joint angles the posture; fingers command half open."""
    memory[:] = 0.0
    _remember_base(memory, views, places)
    _take_reached_pose(memory, views, places)
    for i in range(ARM_DOFS):
        memory[24 + i] = views.qpos[places.arm_qpos[i]]
    memory[TORSO_GOAL] = views.qpos[places.torso[0]]


@compiled
def command(memory: Array, views: Any, places: Any, action: Array) -> None:
    """Take the action (12,) of a policy step, HDF5 order, clipped to +-1.

    Control mode > 0 adds an arm command to the previous goal ("desired"), otherwise to the pose that the arm has
    reached ("achieved"), which forgets what was not followed. As in robosuite, the reached pose is taken relative to
    the base of the last physics step, which a moving base or torso has just left: the goal then trails by up to 2 mm.
    """
    a = np.minimum(np.maximum(action, -1.0), 1.0)
    if a[11] <= 0.0:
        _take_reached_pose(memory, views, places)
    for i in range(3):
        memory[i] += POSITION_SCALE_M * a[i]
    _rotate_goal(memory, ROTATION_SCALE_RAD * a[3], ROTATION_SCALE_RAD * a[4], ROTATION_SCALE_RAD * a[5])
    if a[6] > 0.0:  # closing moves the left finger's command down and the right one's up
        memory[35], memory[36] = max(memory[35] - GRIPPER_SPEED, -1.0), min(memory[36] + GRIPPER_SPEED, 1.0)
    elif a[6] < 0.0:
        memory[35], memory[36] = min(memory[35] + GRIPPER_SPEED, 1.0), max(memory[36] - GRIPPER_SPEED, -1.0)
    # The slides lie below the hinge: their axes keep the direction of zero yaw, the command has the present one.
    yaw = views.qpos[places.base_yaw]
    cos, sin = np.cos(yaw), np.sin(yaw)
    memory[31] = cos * a[7] - sin * a[8]
    memory[32] = sin * a[7] + cos * a[8]
    memory[33] = MAX_YAW_RATE * a[9]
    memory[TORSO_GOAL] = views.qpos[places.torso[0]] + TORSO_SCALE_M * a[10]


@compiled
def apply(memory: Array, views: Any, places: Any) -> None:
    """Write all of the robot's controls for the next physics step, for the state that `mj_step1` has evaluated."""
    at, ctrl = places.actuators, views.ctrl
    torques = _arm_torques(memory, views, places)
    for i in range(ARM_DOFS):
        ctrl[at[i]] = torques[i]
    # Friction of 250 N (Nm) in the base joints against servos of 1000 N s/m (1500 Nm s/rad) leaves the base slower
    # than its command by 0.25 m/s (0.167 rad/s), and still below that: the dead zone is part of RoboCasa's data.
    for i in range(3):
        ctrl[at[7 + i]] = memory[31 + i]
    qpos, qvel, mass = places.torso
    wanted = TORSO_KP * (memory[TORSO_GOAL] - views.qpos[qpos]) - TORSO_KD * views.qvel[qvel]
    ctrl[at[10]] = views.mass[mass] * wanted + views.bias[qvel]
    for i in range(2):
        ctrl[at[11 + i]] = places.finger_middle[i] + places.finger_half[i] * memory[35 + i]


@compiled
def run(memory: Array, views: Any, places: Any, watch: Any, model: int, data: int, substeps: int) -> tuple[int, bool]:
    """Advance the simulation by `substeps` physics steps; `model` and `data` are the addresses of their structures.

    Before: `Nearby.leave_out`. It ends early when bodies cannot stay left out; after it MuJoCo looks at all of them.

    Returns how many steps were made, and whether what sleeps is evaluated for another state than the present one:
    MuJoCo leaves it as it was before the step in which it fell asleep, and relative to a centre of mass that moves
    with the awake bodies under the same root (the other door of a cabinet). The latter is looked for after the last
    step alone.
    """
    asleep = views.tree_asleep
    slept = asleep >= 0
    stale = False
    change = made = 0
    while made < substeps and change == 0:
        apply(memory, views, places)
        _mj_step2(model, data)
        _mj_step1(model, data)
        made += 1
        if watch.n_watched[0]:
            change = _change(watch, slept, asleep)
            if change == 2:
                _look_at_all(watch)
                _mj_step1(model, data)
        for tree in range(asleep.size):
            if slept[tree] != (asleep[tree] >= 0):
                slept[tree] = not slept[tree]
                stale = True
    _look_at_all(watch)
    if made == substeps:
        moving = np.zeros(places.tree_roots.max() + 1, dtype=np.bool_)
        for tree in range(asleep.size):
            moving[places.tree_roots[tree]] |= not slept[tree]
        for tree in range(asleep.size):
            stale |= slept[tree] and moving[places.tree_roots[tree]]
    return made, stale


@compiled
def _change(watch: Any, slept: Any, asleep: Any) -> int:
    """Whether bodies can stay left out: 0 yes, 1 not in the next step, 2 they should not have been in this one.

    Something may have woken, or have moved too far; a fast one needs the last quarter of its way for the next step.
    """
    change = 0
    for tree in range(asleep.size):
        if slept[tree] and asleep[tree] < 0:
            change = max(change, 1 if watch.may_move[tree] else 2)
    for i in range(watch.n_watched[0]):
        body = watch.bodies[i]
        shift = turn = 0.0
        for k in range(3):
            shift += (watch.all_xpos[body, k] - watch.xpos[i, k]) ** 2
        for k in range(9):
            turn += (watch.all_xmat[body, k] - watch.xmat[i, k]) ** 2
        # No point of it has moved farther: two rotations differ by sqrt(turn / 2) times a vector's length at most.
        moved = np.sqrt(shift) + watch.radius[i] * np.sqrt(0.5 * turn)
        if not moved <= watch.free[i]:
            return 2
        if moved > 0.75 * watch.free[i]:
            change = max(change, 1)
    return change


@compiled
def _look_at_all(watch: Any) -> None:
    """Give the bodies that were left out their masks back.

    As `Nearby.look_at_all`, but in this file: numba would not notice a change of a function in another one.
    """
    if watch.n_watched[0]:
        watch.contype_now[:] = watch.contype
        watch.conaffinity_now[:] = watch.conaffinity
        watch.n_watched[0] = 0


@compiled
def _remember_base(memory: Array, views: Any, places: Any) -> None:
    base = places.sites[1]
    for i in range(3):
        memory[12 + i] = views.site_xpos[base, i]
    for i in range(9):
        memory[15 + i] = views.site_xmat[base, i]


@compiled
def _take_reached_pose(memory: Array, views: Any, places: Any) -> None:
    grip = places.sites[0]
    for i in range(3):
        memory[i] = 0.0
        for k in range(3):
            memory[i] += memory[15 + 3 * k + i] * (views.site_xpos[grip, k] - memory[12 + k])
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += memory[15 + 3 * k + i] * views.site_xmat[grip, 3 * k + j]
            memory[3 + 3 * i + j] = total


@compiled
def _rotate_goal(memory: Array, x: float, y: float, z: float) -> None:
    """Turn the goal by an axis-angle vector (radians) in the base frame, by Rodrigues' formula."""
    angle = np.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return
    x, y, z = x / angle, y / angle, z / angle
    s, c = np.sin(angle), np.cos(angle)
    d = 1.0 - c
    turn = (
        (c + d * x * x, d * x * y - s * z, d * x * z + s * y),
        (d * x * y + s * z, c + d * y * y, d * y * z - s * x),
        (d * x * z - s * y, d * y * z + s * x, c + d * z * z),
    )
    for j in range(3):
        g0, g1, g2 = memory[3 + j], memory[6 + j], memory[9 + j]
        for i in range(3):
            memory[3 + 3 * i + j] = turn[i][0] * g0 + turn[i][1] * g1 + turn[i][2] * g2


@compiled
def _arm_torques(memory: Array, views: Any, places: Any) -> Array:
    """Joint torques (7,) in Nm towards the goal, which moves with the arm's base."""
    n = ARM_DOFS
    _remember_base(memory, views, places)
    grip = places.sites[0]
    jacobian = _jacobian(views, places)
    wanted = np.empty((6, 2))  # accelerations of the grip site: of the task, and due to the posture

    # The damping acts on the velocity relative to the base site's.
    position_error, rotation_error = _pose_error(memory, views, grip)
    grip_linear, grip_angular = _site_velocity(views, places, 0)
    base_linear, base_angular = _site_velocity(views, places, 1)
    for i in range(3):
        wanted[i, 0] = ARM_KP * position_error[i] + ARM_KD * (base_linear[i] - grip_linear[i])
        wanted[3 + i, 0] = ARM_KP * rotation_error[i] + ARM_KD * (base_angular[i] - grip_angular[i])

    # Posture accelerations a: their torques M a, less the part that would move the grip site, are
    # N^T M a = M a - J^T L J a, where L is the operational-space inertia.
    posture = np.empty(n)
    for i in range(n):
        offset = memory[24 + i] - views.qpos[places.arm_qpos[i]]
        posture[i] = NULLSPACE_KP * offset - NULLSPACE_KD * views.qvel[places.arm_qvel[i]]
    for i in range(6):
        wanted[i, 1] = 0.0
        for j in range(n):
            wanted[i, 1] += jacobian[i, j] * posture[j]

    # L^-1 = J M^-1 J^T; the task's force uses its position and orientation blocks alone (decoupled).
    mass = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            mass[i, j] = views.mass[places.arm_mass[i, j]]
    solved = jacobian.T.copy()
    _solve(mass.copy(), solved)
    inverse = np.empty((6, 6))
    for i in range(6):
        for j in range(6):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * solved[k, j]
            inverse[i, j] = total
    task = wanted[:, :1].copy()
    _solve(inverse[:3, :3].copy(), task[:3])
    _solve(inverse[3:, 3:].copy(), task[3:])
    drift = wanted[:, 1:].copy()
    _solve(inverse, drift)

    torques = np.empty(n)
    for j in range(n):
        total = views.bias[places.arm_qvel[j]]
        for i in range(6):
            total += jacobian[i, j] * (task[i, 0] - drift[i, 0])
        for k in range(n):
            total += mass[j, k] * posture[k]
        torques[j] = total
    return torques


@compiled
def _jacobian(views: Any, places: Any) -> Array:
    """Velocities (6, 7) of the grip site, linear then angular, in the world, per unit speed of each arm hinge."""
    jacobian = np.empty((6, ARM_DOFS))
    point = views.site_xpos[places.sites[0]]
    for j in range(ARM_DOFS):
        joint = places.arm_joints[j]
        axis, anchor = views.xaxis[joint], views.xanchor[joint]
        x, y, z = point[0] - anchor[0], point[1] - anchor[1], point[2] - anchor[2]
        jacobian[0, j] = axis[1] * z - axis[2] * y
        jacobian[1, j] = axis[2] * x - axis[0] * z
        jacobian[2, j] = axis[0] * y - axis[1] * x
        for i in range(3):
            jacobian[3 + i, j] = axis[i]
    return jacobian


@compiled
def _site_velocity(views: Any, places: Any, which: int) -> tuple[Any, Any]:
    """Linear and angular velocity in the world of a site, from its body's velocity at the tree's centre of mass."""
    velocity = views.cvel[places.site_bodies[which]]
    point, center = views.site_xpos[places.sites[which]], views.subtree_com[places.root]
    x, y, z = point[0] - center[0], point[1] - center[1], point[2] - center[2]
    linear = (
        velocity[3] + velocity[1] * z - velocity[2] * y,
        velocity[4] + velocity[2] * x - velocity[0] * z,
        velocity[5] + velocity[0] * y - velocity[1] * x,
    )
    return linear, (velocity[0], velocity[1], velocity[2])


@compiled
def _pose_error(memory: Array, views: Any, grip: int) -> tuple[Any, Any]:
    """Goal less present pose of the grip site, in the world.

    Rotation: half the sum of the cross products of the present axes with the wanted ones (sine of the angle, times
    the axis), which is half the axial vector of G P^T.
    """
    present = views.site_xmat[grip]
    goal = np.empty((3, 3))
    position = np.empty(3)
    for i in range(3):
        total = memory[12 + i] - views.site_xpos[grip, i]
        for k in range(3):
            total += memory[15 + 3 * i + k] * memory[k]
        position[i] = total
        for j in range(3):
            total = 0.0
            for k in range(3):
                total += memory[15 + 3 * i + k] * memory[3 + 3 * k + j]
            goal[i, j] = total
    rotation = np.empty(3)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        total = 0.0
        for k in range(3):
            total += goal[b, k] * present[3 * a + k] - goal[a, k] * present[3 * b + k]
        rotation[i] = 0.5 * total
    return position, rotation


@compiled
def _solve(matrix: Array, right: Array) -> None:
    """Solve `matrix` x = `right` in place for a symmetric positive matrix (n, n), which is overwritten (Cholesky).

    A direction whose pivot vanishes is left out: the answer then solves the system of the others.
    """
    n, columns = right.shape
    scale = 0.0
    for i in range(n):
        scale = max(scale, matrix[i, i])
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= matrix[j, k] * matrix[j, k]
        inverse = 1.0 / np.sqrt(pivot) if pivot > _SINGULAR * scale else 0.0
        matrix[j, j] = inverse
        for i in range(j + 1, n):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total * inverse
    for c in range(columns):
        for i in range(n):
            total = right[i, c]
            for k in range(i):
                total -= matrix[i, k] * right[k, c]
            right[i, c] = total * matrix[i, i]
        for i in range(n - 1, -1, -1):
            total = right[i, c]
            for k in range(i + 1, n):
                total -= matrix[k, i] * right[k, c]
            right[i, c] = total * matrix[i, i]
