"""Grasps know the gripper as it is: how low its pads reach when the hand is tipped, and what they can close across."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from robocasa_lerobot.demos.motion import grip_position, hand_rotation, rotation_about
from robocasa_lerobot.demos.planning.grasps import GraspPose, grasp_poses, grasp_poses_of, pieces
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.objects.catalogue import CATEGORIES, INSTANCES_PER_CATEGORY, Instance, instance
from robocasa_lerobot.envs.objects.solids import Solid
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON

FINGERS = ("leftfinger", "rightfinger", "finger_joint1_tip", "finger_joint2_tip")


def finger_points(env: KitchenEnv) -> np.ndarray:
    """Corners of what collides of both fingers, from the grip site, in the hand's axes, metres."""
    model, data = env.model, env.data
    found = []
    for geom in range(model.ngeom):
        if not model.body(model.geom_bodyid[geom]).name.endswith(FINGERS) or not model.geom_contype[geom]:
            continue
        mesh = model.geom_dataid[geom]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            first = model.mesh_vertadr[mesh]
            corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]]
        else:
            corners = np.stack(np.meshgrid(*[[-1, 1]] * 3), axis=-1).reshape(-1, 3) * model.geom_size[geom]
        found.append(corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return (np.concatenate(found) - grip_position(data)) @ hand_rotation(data)


def test_the_pads_corner_is_what_is_lowest_of_a_tipped_hand() -> None:
    env = KitchenEnv("OpenDrawer", cameras=())
    env.reset(seed=1)
    points = finger_points(env)
    half_width, reach = PANDA_OMRON.gripper.pad_corner
    for tilt in np.deg2rad([0.0, 35.0, 48.0, 60.0, 72.0, 86.0]):
        for side in (-1.0, 1.0):
            lowest = float((points @ [side * np.sin(tilt), 0.0, np.cos(tilt)]).max())
            assert lowest == pytest.approx(reach * np.cos(tilt) + half_width * np.sin(tilt), abs=5e-4)
    assert len(points) > 16
    env.close()


def test_a_hand_that_leans_over_what_lies_across_keeps_its_open_fingers_over_the_floor() -> None:
    loaf = Solid("box", (0.15, 0.03, 0.025))
    tilt = np.deg2rad(40.0)
    approach_to_down = np.array(
        [[1.0, 0.0, 0.0], [0.0, np.cos(tilt), np.sin(tilt)], [0.0, -np.sin(tilt), np.cos(tilt)]]
    )
    up = approach_to_down @ [0.0, 0.0, 1.0]
    gripper = PANDA_OMRON.gripper
    free = grasp_poses_of([loaf], approach_to_down, gripper)
    over = grasp_poses_of([loaf], approach_to_down, gripper, floor=(up, 0.025))

    def lowest(pose: GraspPose) -> float:
        fingers = [pose.position + side * gripper.finger_outer * pose.rotation[:, 1] for side in (-1.0, 1.0)]
        tips = [finger + gripper.pad_corner[1] * pose.rotation[:, 2] for finger in fingers]
        return min(float(up @ tip) for tip in tips) + 0.025

    assert over
    assert min(map(lowest, free)) < -0.005
    assert min(map(lowest, over)) > 0.0


def spans_a_hole(item: Instance, pose: GraspPose) -> bool:
    """Whether an object has a gap between the places that the pads close on; the lower rows of a pad may be those."""
    for below in (0.002, 0.010):
        line = (
            pose.position - [0.0, 0.0, below] + np.linspace(-0.5, 0.5, 200)[:, None] * pose.width * pose.rotation[:, 1]
        )
        filled = np.zeros(len(line), dtype=bool)
        for solid in pieces(item):
            faces = ConvexHull(solid.cloud()).equations
            filled |= (line @ faces[:, :3].T + faces[:, 3] < 1e-4).all(axis=1)
        if filled[3] and filled[-4] and not filled.all():
            return True
    return False


@pytest.mark.parametrize("name", ["pretzel", "donut"])
def test_flat_rings_are_held_across_their_holes(name: str) -> None:
    items = [instance(CATEGORIES[name], index) for index in range(INSTANCES_PER_CATEGORY)]
    across = [any(spans_a_hole(item, pose) for pose in grasp_poses(item, PANDA_OMRON.gripper)) for item in items]
    assert sum(across) >= 0.8 * len(items)


def test_what_only_the_tips_touch_askew_counts_for_less_than_what_is_flat() -> None:
    """A tub's wall: the fingers may lean as much as walls of bowls do, and not by half a right angle."""
    wall = [Solid("box", (0.10, 0.004, 0.035))]

    def best(lean: float) -> float:
        turn = rotation_about(np.array([1.0, 0.0, 0.0]), np.deg2rad(lean))
        return max(pose.score for pose in grasp_poses_of(wall, turn, PANDA_OMRON.gripper))

    flat, bowl, slant = best(0.0), best(15.0), best(46.0)
    assert flat - 0.7 < bowl < flat
    assert slant < flat - 1.8


def test_what_is_held_is_filled_and_the_open_hand_meets_nothing() -> None:
    """Every pose of several objects, against Qhull's hulls: filled inside the pads, empty where the fingers come."""
    gripper = PANDA_OMRON.gripper
    rng = np.random.default_rng(5)
    poses = 0
    for name in sorted(CATEGORIES)[::12]:
        item = instance(CATEGORIES[name], int(rng.integers(INSTANCES_PER_CATEGORY)))
        hulls = [ConvexHull(solid.cloud()).equations for solid in pieces(item)]

        def filled(points: np.ndarray, slack: float, hulls: list[np.ndarray] = hulls) -> np.ndarray:
            return np.any([(points @ f[:, :3].T + f[:, 3] < slack).all(axis=1) for f in hulls], axis=0)

        for pose in grasp_poses(item, gripper):
            poses += 1
            along, across, up = pose.rotation[:, 1], pose.rotation[:, 0], np.array([0.0, 0.0, 1.0])
            beside = np.linspace(gripper.finger_inner + 1e-4, gripper.finger_outer - 1e-4, 60)
            t = np.concatenate([-beside, beside])
            for side in (-gripper.finger_half_width, 0.0, gripper.finger_half_width):
                for rise in (0.001 - gripper.tips_below_grip, 0.0, 0.02):
                    line = pose.position + side * across + rise * up + t[:, None] * along
                    assert not filled(line, -1e-5).any(), (name, pose)
            ends = pose.position + np.array([[-1.0], [1.0]]) * (pose.width / 2 - 1e-3) * along
            assert any(filled(ends - below * up, 1e-4).all() for below in (0.002, 0.010)), (name, pose)
    assert poses > 100
