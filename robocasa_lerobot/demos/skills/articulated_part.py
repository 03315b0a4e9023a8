"""What turns on a hinge, seen as a skill needs it: where its points are at any angle, and how to push it round."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from robocasa_lerobot.demos.motion import (
    CLOSED,
    Array,
    HandTarget,
    arm_action,
    rotation_about,
)
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture

LEAD_M = 0.07  # of the commanded point before the one that is pushed: with the servo's lag, the force of the push
STALL_STEPS, STALL_RAD = 25, 0.004


class ArticulatedPart:
    """A door, head or lid of a fixture.

    Points are given in the fixture's axes (x to the right, y inwards, z up) from the hinge, as they lie when it is
    shut.

    Args:
        data: state that is looked at.
        fixture: it belongs to.
        joint: name of its hinge.

    Attributes:
        low, high: opposite corners of its panel, without handles, metres, each (3,).
    """

    def __init__(self, data: mujoco.MjData, fixture: Fixture, joint: str) -> None:
        model = data.model
        self._data, self.name = data, joint
        hinge = model.joint(joint)
        self._address, self._body = int(hinge.qposadr[0]), int(model.jnt_bodyid[hinge.id])
        low, high = (float(v) for v in hinge.range)
        self.opening, self.full = (-1.0, -low) if low < 0 else (1.0, high)
        self._axis = hinge.axis.copy()
        cos, sin = np.cos(fixture.yaw), np.sin(fixture.yaw)
        self._turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        self.inwards, self.rightwards = self._turn[:, 1], self._turn[:, 0]
        self.low, self.high = self._bounds()

    @property
    def upright(self) -> bool:
        """Whether the hinge is vertical."""
        return abs(self._axis[2]) > 0.5

    @property
    def side(self) -> float:
        """1 if it reaches from its hinge to the right, else -1."""
        return 1.0 if abs(self.high[0]) > abs(self.low[0]) else -1.0

    @property
    def width(self) -> float:
        """How far it reaches from a vertical hinge, metres."""
        return float(max(abs(self.high[0]), abs(self.low[0])))

    @property
    def angle(self) -> float:
        """Angle from shut, radians; positive is open."""
        return self.opening * float(self._data.qpos[self._address])

    @property
    def share(self) -> float:
        """Angle as a share of the range."""
        return self.angle / self.full

    @property
    def body(self) -> int:
        """Number of its body."""
        return self._body

    def joint_value(self, angle: float) -> float:
        """The position of its hinge at an angle from shut, radians."""
        return self.opening * angle

    def handle(self) -> tuple[Array, Array]:
        """Opposite corners of the bar of its handle, (3,) each."""
        boxes = [self._box(geom) for geom in self.geoms(handle=True)]
        return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)

    @property
    def inside(self) -> float:
        """How far shelves and bins stand out of its inner face, metres."""
        return float(max(self._box(geom)[1][1] for geom in self.geoms(handle=False)))

    @property
    def outside(self) -> float:
        """How far it stands out on its outer side, without handles, metres; negative."""
        return float(min(self._box(geom)[0][1] for geom in self.geoms(handle=False)))

    def turned(self, angle: float) -> Array:
        """World rotation (3, 3) of what lies in the fixture's axes when shut, at an angle."""
        return self._turn @ rotation_about(self._axis, self.opening * angle)

    def point(self, local: Array, angle: float) -> Array:
        """World position (3,) of a point at an angle, metres."""
        return self._data.xpos[self._body] + self.turned(angle) @ local

    def radius(self, local: Array) -> float:
        """Distance of a point from the hinge's axis, metres."""
        return float(np.linalg.norm(np.cross(self._axis, local)))

    def geoms(self, *, handle: bool) -> list[int]:
        """Solid geoms of its handle, or the others."""
        model = self._data.model
        return [
            geom
            for geom in range(model.body_geomadr[self._body], model.body_geomadr[self._body] + self._count())
            if (model.geom_contype[geom] or model.geom_conaffinity[geom])
            and ("handle" in model.geom(geom).name) == handle
        ]

    def _count(self) -> int:
        return int(self._data.model.body_geomnum[self._body])

    def _box(self, geom: int) -> tuple[Array, Array]:
        model = self._data.model
        rotation, out = np.empty(9), model.geom_aabb[geom]
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        turn = rotation.reshape(3, 3)
        middle, half = model.geom_pos[geom] + turn @ out[:3], np.abs(turn) @ out[3:]
        return middle - half, middle + half

    def _bounds(self) -> tuple[Array, Array]:
        boxes = [self._box(geom) for geom in self.geoms(handle=False)]
        # The panel is what covers the most of the front; posts of handles stand out before it.
        front = [(b[1] - b[0])[0] * (b[1] - b[0])[2] for b in boxes]
        panel = boxes[int(np.argmax(front))]
        low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
        low[1], high[1] = panel[0][1], max(panel[1][1], 0.0)
        return low, high


class StallDetector:
    """Tells when a part that is led in one direction turns no more.

    Args:
        part: what turns.
        sign: 1 if its angle is to grow, -1 if it is to shrink.
        least_rad: what it must turn by, or it turns no more.

    Attributes:
        since: control steps without movement.
    """

    def __init__(self, part: ArticulatedPart, sign: float, least_rad: float = STALL_RAD) -> None:
        self._part, self._sign, self._least, self._last, self.since = part, sign, least_rad, part.angle, 0

    def ends(self) -> bool:
        """Whether it has stalled; asked once at every control step."""
        if self._sign * (self._part.angle - self._last) > self._least:
            self._last, self.since = self._part.angle, 0
        else:
            self.since += 1
        return self.since >= STALL_STEPS


def push_around(
    part: ArticulatedPart,
    data: mujoco.MjData,
    local: Array,
    goal: float,
    rotation: Callable[[float], Array],
    *,
    gripper: float = CLOSED,
    speed: float = 0.8,
    lead_m: float = LEAD_M,
    max_steps: int = 200,
) -> Iterator[Array]:
    """Push a part round its hinge at a point until its share reaches `goal`; ends too when it stalls.

    Args:
        part: what turns.
        data: present state.
        local: where the grip site pushes, in the fixture's axes when shut.
        goal: share of the range.
        rotation: hand rotation wanted at an angle.
        gripper: OPEN or CLOSED.
        speed: bound of each command component, in (0, 1].
        lead_m: how far before the pushed point the commanded one is, metres.
        max_steps: control steps at most.
    """
    sign = 1.0 if goal > part.share else -1.0
    lead = lead_m / part.radius(local)
    headway = StallDetector(part, sign)
    for _ in range(max_steps):
        if sign * (part.share - goal) >= 0.0:
            return
        if headway.ends():
            return
        angle = part.angle + sign * lead
        target = HandTarget(part.point(local, angle), rotation(angle))
        yield arm_action(data, target, gripper, speed=speed)
