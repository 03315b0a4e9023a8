"""Where a parallel gripper that comes from above can hold an object: found from its collision pieces alone.

Lines across the object give the intervals that its pieces fill; an interval narrower than the gripper opens, with room
for the fingers at both of its sides and for the palm above, is a place to close on.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.envs.objects.catalogue import Instance, model_of
from robocasa_lerobot.envs.objects.mesh import Array
from robocasa_lerobot.envs.objects.solids import Solid, about, matrix
from robocasa_lerobot.envs.robots.robot import GripperGeometry

_TABLE_GAP = 0.0025  # between finger tips and what the object stands on
_ANGLES = 8
_LINE_STEP = 0.01
_FLAT_M = 0.030  # rings and the like that are lower are held across their holes as well
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
) -> tuple[GraspPose, ...]:
    """The same for any body made of convex pieces, in its own frame, that was turned by the rotation matrix `turn`.

    With `beyond` only those grasps that lie farther than so many metres from its origin along a direction in its frame.
    """
    return _plan(solids, turn, gripper, None if beyond is None else (turn @ beyond[0], beyond[1]))[:count]


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


@dataclass(frozen=True)
class _Faces:
    """Faces of several convex pieces, padded to the same number: inside where normals . x <= offsets."""

    normals: Array  # (pieces, faces, 3)
    offsets: Array  # (pieces, faces)

    def fill(self, starts: Array, direction: Array) -> Array:
        """The parts (lines, pieces, 2) of lines start + t * direction inside each piece; (inf, -inf) where none is."""
        rate = self.normals @ direction
        room = self.offsets - np.einsum("pfk,nk->npf", self.normals, starts)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = room / rate
        low = np.where(rate < -1e-9, t, -np.inf).max(axis=2)
        high = np.where(rate > 1e-9, t, np.inf).min(axis=2)
        missed = (low >= high) | ((np.abs(rate) <= 1e-9) & (room < 0)).any(axis=2)
        return np.where(missed[..., None], [np.inf, -np.inf], np.stack([low, high], axis=-1))


def _faces(clouds: list[Array]) -> _Faces:
    found = [_faces_of(np.unique(np.round(cloud, 6), axis=0)) for cloud in clouds]
    most = max(len(table) for table in found)
    # A face is repeated to fill up: it changes nothing.
    tables = np.stack([np.concatenate([t, np.repeat(t[:1], most - len(t), axis=0)]) for t in found])
    return _Faces(tables[..., :3], tables[..., 3])


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


@dataclass(frozen=True)
class _Candidate:
    score: float
    low: float
    high: float
    row: float
    z: float
    u: Array  # unit vector that the fingers open along
    w: Array  # unit vector along their width

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2

    @property
    def position(self) -> Array:
        return np.asarray(self.middle * self.u + self.row * self.w + np.array([0.0, 0.0, self.z]))


def _plan(
    solids: list[Solid], turn: Array, gripper: GripperGeometry, beyond: tuple[Array, float] | None = None
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
    levels = sorted({round(max(h, lowest), 3) for h in heights} | {round(lowest, 4)})
    found: list[_Candidate] = []
    for k in range(_ANGLES):
        angle = np.pi * k / _ANGLES
        u, w = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        found += _across(faces, cloud, center, u, w, levels, gripper.opening, span=top - bottom < _FLAT_M)
    if beyond is not None:
        found = [candidate for candidate in found if candidate.position @ beyond[0] > beyond[1]]
    found.sort(key=lambda candidate: -candidate.score)
    # Best first, but such that the first ones differ; whether there is room is asked of those that count only.
    chosen: list[_Candidate] = []
    for candidate in found[:_MOST_JUDGED]:
        alike = any(
            np.linalg.norm(candidate.position - other.position) < 0.012 and abs(float(candidate.u @ other.u)) > 0.95
            for other in chosen
        )
        if not alike and _has_room(faces, candidate, top, gripper):
            chosen.append(candidate)
            if len(chosen) == _MOST_POSES:
                break
    return tuple(_pose(candidate) for candidate in chosen)


def _pose(candidate: _Candidate) -> GraspPose:
    down = np.array([0.0, 0.0, -1.0])
    rotation = np.column_stack([np.cross(candidate.u, down), candidate.u, down])
    return GraspPose(candidate.position, rotation, candidate.high - candidate.low, candidate.score)


def _across(
    faces: _Faces, cloud: Array, center: Array, u: Array, w: Array, levels: list[float], opening: float, span: bool
) -> list[_Candidate]:
    """Candidates that open along u, the fingers' width along w; with `span` those across holes, too."""
    reach = cloud @ w
    middle = float(center @ w)
    steps = int(np.ceil((reach.max() - reach.min()) / _LINE_STEP / 2))
    rows = middle + np.arange(-steps, steps + 1) * _LINE_STEP
    rows = rows[(rows > reach.min() + 0.002) & (rows < reach.max() - 0.002)]
    if not len(rows):
        rows = np.array([middle])
    # The pads press from 12 mm below the grip site to 9 mm above; three rows and three heights stand for their faces.
    side, rise = np.array([-0.006, 0.0, 0.006]), np.array([-0.010, -0.002, 0.006])
    spots = [
        (rows[:, None, None, None] + side[:, None, None]) * w + (z + rise[None, :, None]) * np.array([0, 0, 1.0])
        for z in levels
    ]
    parts = faces.fill(np.concatenate(spots).reshape(-1, 3), u).reshape(len(levels), len(rows), 9, -1, 2)
    out = []
    for level, z in enumerate(levels):
        for index, row in enumerate(rows):
            lines = parts[level, index]
            # A surface lower than the pads' middle is held by their lower ends.
            for low, high in _intervals(lines[4], span) or _intervals(lines[3], span):
                if not 0.002 < high - low < opening:
                    continue
                ends = []
                for line in lines:
                    touched = line[(line[:, 0] < high + 0.004) & (line[:, 1] > low - 0.004)]
                    if len(touched):
                        ends.append((touched[:, 0].min(), touched[:, 1].max()))
                score = _score(np.array(ends), low, high, float(row), z, u, w, center)
                out.append(_Candidate(score, low, high, float(row), z, u, w))
    return out


def _score(ends: Array, low: float, high: float, row: float, z: float, u: Array, w: Array, center: Array) -> float:
    """Higher for large and flat faces, near the centre of mass, with room between the fingers."""
    support = len(ends) / 9
    slope = float(ends.std(axis=0).mean()) / 0.004 if len(ends) > 1 else 1.0
    position = (low + high) / 2 * u + row * w
    lever = float(np.linalg.norm((position - center)[:2])) / 0.05
    above = abs(z - float(center[2])) / 0.06
    tight = max(high - low - 0.066, 0.0) / 0.01
    return 2.0 * support - 0.8 * slope - lever - 0.15 * above - 0.7 * tight


def _intervals(parts: Array, span: bool) -> list[tuple[float, float]]:
    """What pads can close on along a line: what is filled without a gap, and, with `span`, all of it."""
    found = _merged(parts)
    return [*found, (found[0][0], found[-1][1])] if span and len(found) > 1 else found


def _merged(parts: Array) -> list[tuple[float, float]]:
    """The union of intervals (n, 2) as disjoint ones; gaps below 2 mm are closed."""
    filled = parts[np.isfinite(parts[:, 0])]
    out: list[tuple[float, float]] = []
    for low, high in filled[np.argsort(filled[:, 0])].tolist():
        if out and low <= out[-1][1] + 0.002:
            out[-1] = (out[-1][0], max(out[-1][1], high))
        else:
            out.append((low, high))
    return out


def _has_room(faces: _Faces, candidate: _Candidate, top: float, gripper: GripperGeometry) -> bool:
    """Whether the open fingers and the palm meet nothing."""
    row, z, u, w = candidate.row, candidate.z, candidate.u, candidate.w
    up = np.array([0.0, 0.0, 1.0])
    # The fingers, from their tips to the palm, and nothing beside the object to be held.
    side = np.array([-gripper.finger_half_width, 0.0, gripper.finger_half_width])
    rise = np.array([-gripper.tips_below_grip + 0.001, 0.0, 0.02])
    starts = ((row + side)[:, None, None] * w + (z + rise)[None, :, None] * up).reshape(-1, 3)
    lines = faces.fill(starts, u) - candidate.middle
    inner, outer = gripper.finger_inner, gripper.finger_outer
    near = (lines[..., 1] > -outer) & (lines[..., 0] < outer)
    if (near & ((lines[..., 0] < -inner) | (lines[..., 1] > inner))).any():
        return False
    # The palm: nothing crosses lines along it, from its height up to the top.
    along, across = gripper.palm_half
    beside = np.array([-across, -across / 2, 0.0, across / 2, across])
    heights = np.arange(z + gripper.palm_above_grip, top, 0.012)
    if not len(heights):
        return True
    starts = ((row + beside)[:, None, None] * w + heights[None, :, None] * up).reshape(-1, 3)
    lines = faces.fill(starts, u) - candidate.middle
    return not ((lines[..., 1] > -along) & (lines[..., 0] < along)).any()
