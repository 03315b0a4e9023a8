"""Conditions on the robot: what the gripper holds and touches, how far it is, and where the base stands."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robocasa_lerobot.envs.predicates.contacts import pushes, touching
from robocasa_lerobot.envs.predicates.logic import Term, plain

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

GRIPPER_FAR_M, BUTTON_FAR_M = 0.25, 0.15
OPPOSITE_COSINE = -0.2  # of the angle between two fingers' pushes: wedges, as of cheese, are held askew
# Of the base from the pose in front of a fixture (docs/robocasa.md, section 8).
NEAR_M, NEAR_COSINE = 1.1, 0.5  # of an object from the base's centre, and of the base's heading towards it
STANDS_WITHIN_M, STANDS_COSINE = 0.20, 0.98


@dataclass(frozen=True)
class GripperFar(Term):
    """The grip site is farther than a distance (metres) from an object's origin."""

    object: str
    distance: float = GRIPPER_FAR_M

    @property
    def name(self) -> str:
        """E.g. `gripper_far_from_obj`."""
        return f"gripper_far_from_{plain(self.object)}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the distance with the threshold."""
        grip = data.site(scene.robot.names.grip_site).xpos
        return float(np.linalg.norm(grip - data.body(scene.fill(self.object)).xpos)) > self.distance


@dataclass(frozen=True)
class GripperFarFromPart(Term):
    """The grip site is farther than a distance (metres) from a part of a fixture."""

    fixture: str
    part: str
    distance: float = BUTTON_FAR_M

    @property
    def name(self) -> str:
        """E.g. `gripper_far_from_start_button`."""
        return f"gripper_far_from_{self.part}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the distance with the threshold."""
        body = data.body(f"{scene.fixture(self.fixture).name}_{self.part}")
        return float(np.linalg.norm(data.site(scene.robot.names.grip_site).xpos - body.xipos)) > self.distance


@dataclass(frozen=True)
class GripperTouches(Term):
    """The gripper touches an object."""

    object: str

    @property
    def name(self) -> str:
        """E.g. `gripper_touches_obj`."""
        return f"gripper_touches_{plain(self.object)}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look at the contacts."""
        gripper = scene.subtree(scene.robot.names.gripper)
        return touching(scene.model, data, gripper, scene.subtree(scene.fill(self.object)))


@dataclass(frozen=True)
class Grasped(Term):
    """The gripper holds an object between its fingers: two of them push it against each other.

    RoboCasa asks for any contact, with fingers that are not wide open (docs/robocasa.md, section 8): a fist that pushes
    passes then, and an object 7 cm wide does not.
    """

    object: str

    @property
    def name(self) -> str:
        """E.g. `obj_grasped`."""
        return f"{plain(self.object)}_grasped"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look for opposite pushes."""
        held = scene.subtree(scene.fill(self.object))
        each = [pushes(scene.model, data, finger, held) for finger in scene.fingers()]
        return any(bool((a @ b.T < OPPOSITE_COSINE).any()) for a, b in combinations(each, 2))


@dataclass(frozen=True)
class StandsBefore(Term):
    """The base stands in front of a fixture as if an episode started there: within 0.20 m, turned to it.

    Attributes:
        fixture: its role.
        free: whether the nearest place where a robot can stand counts instead, where it cannot stand there.
    """

    fixture: str
    free: bool = False

    @property
    def name(self) -> str:
        """E.g. `stands_before_target`."""
        return f"stands_before_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare place and heading with the standing pose."""
        goal = scene.place_before(self.fixture) if self.free else scene.standing_pose(self.fixture)
        site = data.site(scene.robot.names.base_center_site)
        apart = float(np.hypot(site.xpos[0] - goal.x, site.xpos[1] - goal.y))
        rotation = site.xmat.reshape(3, 3)
        heading = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        return apart <= STANDS_WITHIN_M and float(np.cos(heading - goal.yaw)) >= STANDS_COSINE


@dataclass(frozen=True)
class StandsNear(Term):
    """An object is before the base, so that the arm reaches it after a small drive at most."""

    object: str

    @property
    def name(self) -> str:
        """E.g. `stands_near_bowl`."""
        return f"stands_near_{plain(self.object)}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare where it is in the base's frame with the bounds."""
        site = data.site(scene.robot.names.base_center_site)
        ahead, left, _ = site.xmat.reshape(3, 3).T @ (data.body(scene.fill(self.object)).xpos - site.xpos)
        far = float(np.hypot(ahead, left))
        return far < NEAR_M and bool(ahead > NEAR_COSINE * far)
