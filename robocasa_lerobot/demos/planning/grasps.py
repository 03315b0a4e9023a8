"""Where a parallel gripper that comes from above can hold an object: found from its collision pieces alone.

Lines across the object give the intervals that its pieces fill; an interval narrower than the gripper opens, with room
for the fingers at both of its sides and for the palm above, is a place to close on.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.planning.grasp_kernel import Faces, Hand, candidates, chosen
from robocasa_lerobot.envs.objects.catalogue import Instance, model_of
from robocasa_lerobot.envs.objects.mesh import Array
from robocasa_lerobot.envs.objects.solids import Solid, about, matrix
from robocasa_lerobot.envs.robots.robot import GripperGeometry

_TABLE_GAP = 0.0025  # between finger tips and what the object stands on
_ANGLES = np.pi * np.arange(8) / 8  # of the line that the fingers open along
_FLAT_M = 0.030  # rings and the like that are lower are held across their holes as well
_FINE_M = 0.004  # between the heights that are tried of a hand that leans over a floor, which leaves few of them
_MOST_JUDGED, _MOST_POSES = 1200, 24


@dataclass(frozen=True)
class GraspPose:
    """A grasp of an object: a pose of the hand.

    Attributes:
        position: of the grip site, metres, shape (3,).
        rotation: of the hand, shape (3, 3): z is the approach direction, the fingers open along y.
        width: of the object between the fingers, metres.
        score: higher is better.
    """

    position: Array
    rotation: Array
    width: float
    score: float

    def placed(self, origin: Array, turn: Array) -> GraspPose:
        """The pose in the frame that has the object at `origin`, turned by the rotation matrix `turn`."""
        return GraspPose(origin + turn @ self.position, turn @ self.rotation, self.width, self.score)


def grasp_poses(item: Instance, gripper: GripperGeometry, count: int = 16) -> tuple[GraspPose, ...]:
    """Up to `count` grasps of an instance as it stands, best first, in the frame of its body."""
    return _standing(item, gripper)[:count]


def grasp_poses_as_it_lies(
    item: Instance, turn: Array, gripper: GripperGeometry, count: int = 16
) -> tuple[GraspPose, ...]:
    """The same for an object that was turned by the rotation matrix `turn`, about its origin, in axes of the room."""
    return _plan(pieces(item), turn, gripper)[:count]


def grasp_poses_of(
    solids: list[Solid],
    turn: Array,
    gripper: GripperGeometry,
    count: int = 16,
    *,
    beyond: tuple[Array, float] | None = None,
    floor: tuple[Array, float] | None = None,
) -> tuple[GraspPose, ...]:
    """The same for any body made of convex pieces, in its own frame, that was turned by the rotation matrix `turn`.

    With `beyond` only those grasps that lie farther than so many metres from its origin along a direction in its frame;
    with `floor` only those whose open fingers stay over a floor: its normal in the turned axes, and how far it is
    below the origin, metres.
    """
    return _plan(solids, turn, gripper, None if beyond is None else (turn @ beyond[0], beyond[1]), floor)[:count]


@functools.lru_cache(maxsize=512)
def _standing(item: Instance, gripper: GripperGeometry) -> tuple[GraspPose, ...]:
    return _plan(pieces(item), np.eye(3), gripper)


def pieces(item: Instance) -> list[Solid]:
    """Convex pieces of an instance in the frame of its body, as it is put down."""
    solids = [s.scaled(item.scale) for s in model_of(item).solids]
    axis = item.upright_axis
    if axis is None:
        return solids
    turn = matrix(about(axis, -np.pi / 2))
    return [Solid("hull", (), points=s.cloud() @ turn.T) for s in solids]


def _faces(clouds: list[Array]) -> Faces:
    found = [_faces_of(np.unique(np.round(cloud, 6), axis=0)) for cloud in clouds]
    counts = np.array([len(table) for table in found])
    tables = np.zeros((len(found), counts.max(), 4))
    for table, rows in zip(tables, found, strict=True):
        table[: len(rows)] = rows
    return Faces(tables[..., :3].copy(), tables[..., 3].copy(), counts)


def _faces_of(points: Array) -> Array:
    """Faces (k, 4) of the convex hull of at most a few dozen points: unit normal and offset."""
    center = points.mean(axis=0)
    triples = np.array(list(itertools.combinations(range(len(points)), 3)))
    a, b, c = (points[triples[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    keep = length > 1e-10
    normal, a = normal[keep] / length[keep, None], a[keep]
    offset = np.einsum("ij,ij->i", normal, a)
    flip = np.sign(offset - normal @ center)
    normal, offset = normal * flip[:, None], offset * flip
    outer = (normal @ points.T <= offset[:, None] + 1e-6).all(axis=1) & (flip != 0)
    return np.unique(np.round(np.column_stack([normal[outer], offset[outer]]), 5), axis=0)


def _plan(
    solids: list[Solid],
    turn: Array,
    gripper: GripperGeometry,
    beyond: tuple[Array, float] | None = None,
    floor: tuple[Array, float] | None = None,
) -> tuple[GraspPose, ...]:
    clouds = [s.cloud() @ turn.T for s in solids]
    faces = _faces(clouds)
    cloud = np.concatenate(clouds)
    volumes = np.array([s.volume() for s in solids])
    middles = np.array([(c.min(axis=0) + c.max(axis=0)) / 2 for c in clouds])
    center = volumes @ middles / volumes.sum()
    bottom, top = float(cloud[:, 2].min()), float(cloud[:, 2].max())
    lowest = bottom + gripper.tips_below_grip + _TABLE_GAP
    heights = {lowest, *np.linspace(bottom, top, 7)[1:-1], top - 0.028, top - 0.018, top - 0.010, top - 0.002}
    if floor is not None:
        heights |= set(np.arange(lowest, top, _FINE_M))
    levels = np.array(sorted({round(max(h, lowest), 3) for h in heights} | {round(lowest, 4)}))
    found = candidates(faces, cloud, center, _ANGLES, levels, gripper.opening, top - bottom < _FLAT_M)
    if beyond is not None:
        found = found[_positions(found) @ beyond[0] > beyond[1]]
    if floor is not None:
        found = found[_over_floor(found, gripper, *floor)]
    # Best first, but such that the first ones differ; whether there is room is asked of those that count only. Round
    # objects have equals, whose last bits must not decide.
    found = found[np.argsort(-np.round(found[:, 0], 9), kind="stable")][:_MOST_JUDGED]
    hand = Hand(
        gripper.opening,
        gripper.tips_below_grip,
        gripper.palm_above_grip,
        gripper.finger_inner,
        gripper.finger_outer,
        gripper.finger_half_width,
        *gripper.palm_half,
    )
    kept = found[chosen(faces, found, top, hand, _MOST_POSES)]
    return tuple(map(_pose, kept, _positions(kept)))


def _positions(rows: Array) -> Array:
    """Grip sites (n, 3) of rows of `candidates`."""
    middle, row, angle = (rows[:, 1] + rows[:, 2]) / 2, rows[:, 3], rows[:, 5]
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.column_stack([middle * cosine - row * sine, middle * sine + row * cosine, rows[:, 4]])


def _over_floor(rows: Array, gripper: GripperGeometry, normal: Array, below: float) -> NDArray[np.bool_]:
    """Of which rows of `candidates` the open fingers stay over a floor (n,)."""
    half_width, reach = gripper.pad_corner
    cosine, sine = np.cos(rows[:, 5]), np.sin(rows[:, 5])
    along, across = np.abs(cosine * normal[0] + sine * normal[1]), np.abs(cosine * normal[1] - sine * normal[0])
    lowest = gripper.finger_outer * along + half_width * across + reach * abs(float(normal[2]))
    above: NDArray[np.bool_] = _positions(rows) @ normal + below > lowest
    return above


def _pose(candidate: Array, position: Array) -> GraspPose:
    score, low, high, _, _, angle = candidate.tolist()
    opens = np.array([np.cos(angle), np.sin(angle), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    rotation = np.column_stack([np.cross(opens, down), opens, down])
    return GraspPose(position, rotation, high - low, score)
