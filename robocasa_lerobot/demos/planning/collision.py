"""What the robot touches at configurations, many at once: the one collision test that all planners share.

Shapes whose boxes overlap are given to MuJoCo's own distance function, pair by pair: the robot's, and what it holds,
against the kitchen's. Nothing is simulated and the env's state is not touched.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array, base_pose, grip_position, hand_rotation, rotation_about
from robocasa_lerobot.demos.planning import kernel
from robocasa_lerobot.demos.planning.kinematics import Arm
from robocasa_lerobot.envs.scene.bodies import is_loose, subtree
from robocasa_lerobot.envs.scene.scene import Scene

MOST_TOUCHED = 3  # bodies that are told apart
MOST_LEANT_ON = 8
LEAN_M = 0.01  # that the arm may go further into what it leans on, as it leaves
FLOOR = "floor"
_NO_POSITIONS, _NO_ROTATIONS = np.zeros((1, 0, 3)), np.zeros((1, 0, 3, 3))

# By the state that is asked about, not by its model: what is kept refers to the model, which it would keep alive.
_scratch: WeakKeyDictionary[mujoco.MjData, mujoco.MjData] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Held:
    """A body in the gripper: it goes where the hand goes.

    Attributes:
        name: of the body.
        position: of its origin from the grip site, in the hand's axes, metres.
        rotation: in the hand's axes.
        contents: what lies in it, and goes along.
    """

    name: str
    position: Array
    rotation: Array
    contents: tuple[Held, ...] = ()

    @classmethod
    def now(cls, data: mujoco.MjData, name: str, contents: Sequence[str] = ()) -> Held:
        """As it lies in the hand at present, with the bodies that lie in it."""
        hand, body = hand_rotation(data), data.body(name)
        position, rotation = hand.T @ (body.xpos - grip_position(data)), hand.T @ body.xmat.reshape(3, 3)
        return cls(name, position, rotation, tuple(cls.now(data, other) for other in contents))

    @property
    def names(self) -> tuple[str, ...]:
        """Of all bodies that go along."""
        return (self.name, *(other.name for other in self.contents))


def is_full(held: Held | None) -> bool:
    """Whether the object in the gripper is a vessel with others in it."""
    return held is not None and bool(held.contents)


@dataclass(frozen=True)
class Touched:
    """What N configurations touch.

    Attributes:
        counts: (N,) bodies, `most` of them at most.
        bodies: (N, most) their numbers; what lies behind the count means nothing.
    """

    counts: NDArray[np.int64]
    bodies: NDArray[np.int64]

    def all(self) -> frozenset[int]:
        """Every body that is touched in any of them."""
        mask = np.arange(self.bodies.shape[1]) < self.counts[:, None]
        return frozenset(int(body) for body in self.bodies[mask])


class MovingPart:
    """The geoms of a body and of what hangs on it, in the positions that a joint takes them through.

    Args:
        model: of the kitchen.
        data: a state with positions evaluated.
        joint: name of a hinge or slide.
        values: (S,) of the joint, in its own unit and sign.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, joint: str, values: Array) -> None:
        hinge = model.joint(joint)
        self.body = int(model.jnt_bodyid[hinge.id])
        inside = subtree(model, model.body(self.body).name)
        self.inside = inside
        self.shapes = _shapes(model, data, inside)
        anchor, axis = data.xanchor[hinge.id], data.xaxis[hinge.id]
        present = float(data.qpos[hinge.qposadr[0]])
        slides = model.jnt_type[hinge.id] == mujoco.mjtJoint.mjJNT_SLIDE
        positions, rotations = [], []
        for value in values:
            turn = np.eye(3) if slides else rotation_about(axis, float(value) - present)
            move = axis * (float(value) - present) if slides else np.zeros(3)
            positions.append((self.shapes.positions - anchor) @ turn.T + anchor + move)
            rotations.append(turn @ self.shapes.rotations)
        count = len(self.shapes.geoms)
        self.positions = np.array(positions).reshape(len(values), count, 3)
        self.rotations = np.array(rotations).reshape(len(values), count, 3, 3)


class CollisionChecker:
    """Tells what the robot, and what it holds, would touch.

    Args:
        scene: of the kitchen.
        data: its state, with positions evaluated; it is read now, and stays as it is.
        allowed: bodies that may be touched.
    """

    def __init__(self, scene: Scene, data: mujoco.MjData, *, allowed: Iterable[int] = ()) -> None:
        model, names = scene.model, scene.robot.names
        self._model, self.arm = model, Arm(model, data, scene.robot)
        self._data = _scratch_data(model, data)
        self._robot = scene.subtree(names.mobile_base)
        self._hand = scene.subtree(names.hand)
        self._all = _shapes(model, data, np.ones(model.nbody, dtype=np.bool_))
        kernel.boxes(self._all)
        self._none = _take(self._all, np.zeros(len(self._all.geoms), dtype=np.bool_))
        frame = data.site(names.arm_center_site)
        self._links = _LinkPoses(frame, self.arm, data)
        base, yaw = base_pose(data)
        self._arm_from_base = _turn(-yaw) @ (frame.xpos - base)
        self._height = float(frame.xpos[2])
        self._yaw_offset = float(np.arctan2(frame.xmat[3], frame.xmat[0])) - yaw
        self._grip_from_last = (self.arm.chain.grip, self.arm.chain.hand)
        self._pardons = np.zeros(model.nbody, dtype=np.int64)
        floor = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, FLOOR)
        if floor >= 0:
            self._pardons[floor] = 3  # wheels stand on it, the hand may not
        self._pardons[list(allowed)] = 1
        self._leans = np.zeros(model.ngeom)
        self._movers: dict[tuple[int, tuple[int, ...] | None], kernel.Shapes] = {}
        self._robots: dict[tuple[int, ...] | None, kernel.Shapes] = {}
        self._keep: list[Held | None] = []
        self._stills: dict[tuple[tuple[str, ...], int], kernel.Shapes] = {}
        self._frames: dict[bytes, Array] = {}
        self._carried: dict[str, kernel.Shapes] = {}
        self._loaded: dict[tuple[tuple[str, ...], tuple[int, ...] | None], kernel.Shapes] = {}
        self.present_base = np.array([base[0], base[1], yaw])
        self.present_joints: Array = np.array(data.qpos[self.arm.addresses])

    def allow(self, bodies: Iterable[int]) -> None:
        """Let more bodies be touched."""
        self._pardons[list(bodies)] = 1

    def allow_present(self) -> None:
        """Let be touched what the robot leans on already: that is no reason not to go.

        What the base touches (an open drawer before it) may be touched anywhere, and so may loose objects. Of other
        things only the geoms that the arm touches, and hardly deeper than now: a fridge with its shelves is one body.
        """
        here, joints, model, shapes = self.present_base, self.present_joints, self._model, self._all
        every = self.touched(here, joints, most=MOST_LEANT_ON).all()
        base = self.touched(here, joints, most=MOST_LEANT_ON, links=(0,)).all() if every else every
        anywhere = {body for body in every if body in base or is_loose(model, body)}
        self.allow(anywhere)
        mine = self._robot[shapes.bodies]
        for other in np.flatnonzero(np.isin(shapes.bodies, list(every - anywhere))):
            near = mine & ((shapes.low <= shapes.high[other]) & (shapes.high >= shapes.low[other])).all(axis=1)
            geom = int(shapes.geoms[other])
            apart = [
                mujoco.mj_geomDistance(model, self._data, g, geom, 1e-3, None) for g in shapes.geoms[near].tolist()
            ]
            if min(apart, default=0.0) < 0.0:
                self._leans[geom] = LEAN_M - min(apart)

    def allow_hand(self, body: int) -> None:
        """Let the hand alone touch a body, at configurations with `hand_may`."""
        self._pardons[body] = 2

    def arm_frames(self, bases: Array) -> Array:
        """Origins and headings (N, 4) of the arm's frame with the base centre at (N, 3): x, y in metres, radians."""
        bases = np.asarray(bases, dtype=np.float64).reshape(-1, 3)
        cos, sin = np.cos(bases[:, 2]), np.sin(bases[:, 2])
        x, y, _ = self._arm_from_base
        frames = np.empty((len(bases), 4))
        frames[:, 0] = bases[:, 0] + cos * x - sin * y
        frames[:, 1] = bases[:, 1] + sin * x + cos * y
        frames[:, 2] = self._height
        frames[:, 3] = bases[:, 2] + self._yaw_offset
        return frames

    def _frames_at(self, bases: Array) -> Array:
        """The same, kept for single places: many configurations are asked about at each, in many calls."""
        bases = np.asarray(bases, dtype=np.float64)
        if bases.size != 3:
            return self.arm_frames(bases)
        key = bases.tobytes()
        if key not in self._frames:
            self._frames[key] = self.arm_frames(bases)
        return self._frames[key]

    def touched(
        self,
        bases: Array,
        joints: Array,
        *,
        held: Held | None = None,
        part: MovingPart | None = None,
        states: NDArray[np.int64] | None = None,
        hand_may: NDArray[np.bool_] | None = None,
        raised_m: float = 0.0,
        margin_m: float = 0.0,
        most: int = MOST_TOUCHED,
        links: tuple[int, ...] | None = None,
        until_one: bool = False,
    ) -> Touched:
        """The bodies that are touched at N configurations.

        Args:
            bases: (N, 3) or (3,) of the base centre: x, y in metres, heading in radians.
            joints: (N, 7) or (7,) radians.
            held: the object in the gripper; nothing else of that name is there then.
            part: that moves.
            states: (N,) numbers of its positions.
            hand_may: (N,) whether the hand may touch what it alone may touch.
            raised_m: that the robot stands higher than it does.
            margin_m: distance below which two shapes touch.
            most: bodies of each configuration after which no more are looked for.
            links: of the robot that are looked at (0 for the base, 1 to 7); None takes all.
            until_one: whether configurations after the first that touches something are left out, as if free.
        """
        joints, frames = np.asarray(joints, dtype=np.float64).reshape(-1, 7), self._frames_at(bases)
        count = max(len(joints), len(frames))
        joints = joints.repeat(count, axis=0) if len(joints) < count else np.ascontiguousarray(joints)
        frames = frames.repeat(count, axis=0) if len(frames) < count else frames
        if raised_m:
            frames = frames + np.array([0.0, 0.0, raised_m, 0.0])
        bodies, counts = np.zeros((count, most), dtype=np.int64), np.zeros(count, dtype=np.int64)
        still = self._still(held, part)
        moves = part.shapes if part is not None else self._none
        kernel.touched(
            self._model._address,
            self._data._address,
            self._data.geom_xpos,
            self._data.geom_xmat,
            self.arm.chain,
            self._moving(held, links),
            still,
            moves,
            part.positions if part is not None else _NO_POSITIONS,
            part.rotations if part is not None else _NO_ROTATIONS,
            self._pardons,
            self._leans,
            frames,
            joints,
            np.zeros(count, dtype=np.int64) if states is None else np.asarray(states, dtype=np.int64),
            np.zeros(count, dtype=np.bool_) if hand_may is None else np.asarray(hand_may, dtype=np.bool_),
            margin_m,
            until_one,
            bodies,
            counts,
        )
        return Touched(counts, bodies)

    def free(
        self, bases: Array, joints: Array, *, held: Held | None = None, margin_m: float = 0.0
    ) -> NDArray[np.bool_]:
        """Whether nothing is touched at N configurations, (N,)."""
        return self.touched(bases, joints, held=held, margin_m=margin_m, most=1).counts == 0

    def _moving(self, held: Held | None, links: tuple[int, ...] | None) -> kernel.Shapes:
        key = (id(held), links)
        if key not in self._movers:
            robot = self._robots.get(links)
            if robot is None:
                robot = self._robots[links] = self._robot_shapes(links)
            self._movers[key] = robot if held is None else self._with_held(robot, held, links)
            self._keep.append(held)  # so that its number stays its own
        return self._movers[key]

    def _with_held(self, robot: kernel.Shapes, held: Held, links: tuple[int, ...] | None) -> kernel.Shapes:
        """The robot's shapes and those of what it holds; where the latter lie in the hand is all that differs often."""
        carried = [self._held_shapes(body) for body in (held, *held.contents)]
        key = (held.names, links)
        if key not in self._loaded:
            self._loaded[key] = functools.reduce(_joined, carried, robot)
        return self._loaded[key]._replace(
            positions=np.concatenate([robot.positions, *(shapes.positions for shapes in carried)]),
            rotations=np.concatenate([robot.rotations, *(shapes.rotations for shapes in carried)]),
        )

    def _robot_shapes(self, links: tuple[int, ...] | None) -> kernel.Shapes:
        shapes = _take(self._all, self._robot[self._all.bodies])
        number = np.array([self._links.link_of(self._model, int(body)) for body in shapes.bodies])
        shapes = shapes._replace(links=number, is_hand=self._hand[shapes.bodies])
        shapes = _take(shapes, np.ones(len(number), dtype=np.bool_) if links is None else np.isin(number, links))
        turn = self._links.rotations[shapes.links]
        offset = shapes.positions - self._links.positions[shapes.links]
        local = np.einsum("nji,nj->ni", turn, offset)
        return shapes._replace(
            positions=local, rotations=np.ascontiguousarray(turn.transpose(0, 2, 1) @ shapes.rotations)
        )

    def _held_shapes(self, held: Held) -> kernel.Shapes:
        if held.name not in self._carried:
            inside = subtree(self._model, held.name)
            shapes = _take(self._all, inside[self._all.bodies])
            self._carried[held.name] = shapes._replace(
                links=np.full(len(shapes.geoms), kernel.ARM_DOFS, dtype=np.int64),
                is_hand=np.ones(len(shapes.geoms), dtype=np.bool_),
            )
        shapes = self._carried[held.name]
        origin, turn = self._links.bodies[self._model.body(held.name).id]
        grip, hand = self._grip_from_last
        position = grip + hand @ held.position
        rotation = hand @ held.rotation @ turn.T
        return shapes._replace(
            positions=(shapes.positions - origin) @ rotation.T + position,
            rotations=np.ascontiguousarray(rotation @ shapes.rotations),
        )

    def _still(self, held: Held | None, part: MovingPart | None) -> kernel.Shapes:
        key = (held.names if held is not None else (), part.body if part is not None else -1)
        if key not in self._stills:
            out = self._robot.copy()
            if held is not None:
                out |= subtree(self._model, *held.names)
            if part is not None:
                out |= part.inside
            self._stills[key] = _take(self._all, ~out[self._all.bodies])
        return self._stills[key]


class _LinkPoses:
    """Where the base and the seven links are, and every body."""

    def __init__(self, frame: Any, arm: Arm, data: mujoco.MjData) -> None:
        self.positions = np.vstack([frame.xpos[None], data.xpos[arm.bodies]])
        self.rotations = np.concatenate([frame.xmat.reshape(1, 3, 3), data.xmat[arm.bodies].reshape(-1, 3, 3)])
        self._numbers = {body: number + 1 for number, body in enumerate(arm.bodies)}
        positions, rotations = data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy()
        self.bodies = list(zip(positions, rotations, strict=True))

    def link_of(self, model: mujoco.MjModel, body: int) -> int:
        """The link that a body goes with, 0 for the base."""
        while body and body not in self._numbers:
            body = int(model.body_parentid[body])
        return self._numbers.get(body, 0)


def _scratch_data(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """Memory for MuJoCo's distance function; one for each state's memory, since making it costs more than a plan."""
    if data not in _scratch:
        _scratch[data] = mujoco.MjData(model)
    return _scratch[data]


def _shapes(model: mujoco.MjModel, data: mujoco.MjData, bodies: NDArray[np.bool_]) -> kernel.Shapes:
    """The solid geoms of some bodies as they are in the world; planes, which have no box, are left out."""
    solid = (model.geom_contype > 0) | (model.geom_conaffinity > 0)
    solid &= model.geom_type != mujoco.mjtGeom.mjGEOM_PLANE
    geoms = np.flatnonzero(solid & bodies[model.geom_bodyid])
    return kernel.Shapes(
        geoms=geoms.astype(np.int64),
        bodies=model.geom_bodyid[geoms].astype(np.int64),
        links=np.zeros(len(geoms), dtype=np.int64),
        is_hand=np.zeros(len(geoms), dtype=np.bool_),
        positions=data.geom_xpos[geoms],
        rotations=data.geom_xmat[geoms].reshape(-1, 3, 3),
        middles=np.ascontiguousarray(model.geom_aabb[geoms, :3]),
        halves=np.ascontiguousarray(model.geom_aabb[geoms, 3:]),
        low=np.zeros((len(geoms), 3)),
        high=np.zeros((len(geoms), 3)),
        contype=model.geom_contype[geoms].astype(np.int64),
        conaffinity=model.geom_conaffinity[geoms].astype(np.int64),
    )


def _take(shapes: kernel.Shapes, chosen: NDArray[np.bool_]) -> kernel.Shapes:
    taken: list[Any] = [np.ascontiguousarray(values[chosen]) for values in shapes]
    return kernel.Shapes(*taken)


def _joined(one: kernel.Shapes, other: kernel.Shapes) -> kernel.Shapes:
    joined: list[Any] = [np.concatenate(pair) for pair in zip(one, other, strict=True)]
    return kernel.Shapes(*joined)


def _turn(yaw: float) -> Array:
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
