"""Paths of the hand that push on a part's face, or hold a point of it and lead it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robocasa_lerobot.demos.motion import Array, HandTarget
from robocasa_lerobot.demos.planning.articulated import ContactPath, Waypoint
from robocasa_lerobot.envs.robots.robot import GripperGeometry

STANDOFF_M = 0.09  # of the hand before it grasps


class TurningPart(Protocol):
    """A part whose points are known at any angle, in the fixture's axes from the hinge as they lie when it is shut."""

    @property
    def angle(self) -> float:
        """Angle from shut, radians."""

    def turned(self, angle: float) -> Array:
        """World rotation (3, 3) of what lies in the fixture's axes when shut, at an angle."""

    def point(self, local: Array, angle: float) -> Array:
        """World position (3,) of a point at an angle, metres."""


def arc_waypoints(
    start: float, end: float, target_at: Callable[[float], HandTarget], shares: tuple[float, ...]
) -> list[Waypoint]:
    """Poses at some shares of the turn from one angle to another, radians."""
    angles = [start + (end - start) * share for share in shares]
    return [Waypoint(angle, target_at(angle), share) for angle, share in zip(angles, shares, strict=True)]


def push_path(
    gripper: GripperGeometry,
    part: TurningPart,
    local: Array,
    normal: Array,
    rotation_at: Callable[[float], Array],
    end: float,
    *,
    off_m: float = 0.06,
    back_m: float = 0.10,
    bias: float = 0.0,
) -> ContactPath:
    """A path that pushes on a face with the closed finger tips.

    Args:
        gripper: that pushes.
        part: the one to push, from where it stands now.
        local: the point of the face, in the fixture's axes from the hinge as it lies when shut, metres, (3,).
        normal: of the face towards the hand, same axes, (3,).
        rotation_at: hand rotation (3, 3) wanted at an angle.
        end: angle at which it ends, radians.
        off_m: how far off the face the hand comes, before it touches it.
        back_m: how far back from there along its fingers it comes from.
        bias: of the path.
    """

    def target_at(angle: float) -> HandTarget:
        rotation, out = rotation_at(angle), part.turned(angle) @ normal
        reach = gripper.closed_reach(rotation, out)
        return HandTarget(part.point(local, angle) + out * reach, rotation)

    start = part.angle
    at = target_at(start)
    off = HandTarget(at.position + part.turned(start) @ normal * off_m, at.rotation)
    back = HandTarget(off.position - at.rotation[:, 2] * back_m, at.rotation)
    arc = arc_waypoints(start, end, target_at, (0.0, 0.5, 1.0))
    return ContactPath((Waypoint(start, back), Waypoint(start, off), *arc), 2, target_at, bias)


def grip_path(
    part: TurningPart, local: Array, rotation_at: Callable[[float], Array], end: float, *, bias: float = 0.0
) -> ContactPath:
    """A path that holds a point of a part between the finger tips and leads it; arguments as for `push_path`."""

    def target_at(angle: float) -> HandTarget:
        return HandTarget(part.point(local, angle), rotation_at(angle))

    start = part.angle
    at = target_at(start)
    before = HandTarget(at.position - at.rotation[:, 2] * STANDOFF_M, at.rotation)
    arc = arc_waypoints(start, end, target_at, (0.5, 1.0))
    return ContactPath((Waypoint(start, before), Waypoint(start, at), *arc), 1, target_at, bias)
