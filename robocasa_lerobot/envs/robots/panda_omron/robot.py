"""The PandaOmron as a value."""

from __future__ import annotations

from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import BASE_YAW_PIVOT
from robocasa_lerobot.envs.robots.panda_omron.cameras import CAMERA_NOISE, CAMERA_SETS
from robocasa_lerobot.envs.robots.panda_omron.control.controller import PandaOmronController
from robocasa_lerobot.envs.robots.panda_omron.model import add_robot
from robocasa_lerobot.envs.robots.panda_omron.proprioception import read_observations, read_state
from robocasa_lerobot.envs.robots.robot import (
    ArmReach,
    GripperGeometry,
    HomePose,
    Robot,
    RobotNames,
    StandingShape,
)

PANDA_OMRON = Robot(
    name="PandaOmron",
    names=RobotNames(
        base=names.ROBOT_BASE,
        mobile_base=names.MOBILE_BASE,
        support=names.SUPPORT,
        hand=names.HAND,
        gripper=names.GRIPPER,
        base_joints=names.BASE_JOINTS,
        torso_joint=names.TORSO_JOINT,
        arm_joints=names.ARM_JOINTS,
        finger_joints=names.FINGER_JOINTS,
        base_center_site=names.BASE_CENTER_SITE,
        arm_center_site=names.ARM_CENTER_SITE,
        grip_site=names.GRIP_SITE,
    ),
    home=HomePose(
        arm=(-0.01612974, -1.03446714, -0.02397936, -2.27550888, 0.03932365, 1.51639493, 0.69615947),
        gripper=(0.020833, -0.020833),
        torso=0.0,
    ),
    shape=StandingShape(
        standoff=0.20,  # docs/robocasa.md, section 6
        base_x=(-0.55, 0.15),
        base_y=(-0.25, 0.25),
        base_top=0.38,
        column_half=0.13,
        column_top=1.0,
        hand_x=(0.0, 0.30),
        hand_half=0.11,
        hand_z=(1.0, 1.6),
        yaw_pivot=BASE_YAW_PIVOT[:2],
    ),
    gripper=GripperGeometry(
        opening=0.076,
        tips_below_grip=0.014,
        pad_corner=(0.0085, 0.0105),
        palm_above_grip=0.029,
        finger_inner=0.0395,
        finger_outer=0.056,
        finger_half_width=0.0105,
        palm_half=(0.10, 0.03),
        closed_half=(0.011, 0.026, 0.011),
    ),
    reach=ArmReach(wrist_behind_grip=0.204, shoulder=0.333, longest=0.81, stretched=-0.467),
    camera_sets=CAMERA_SETS,
    camera_noise=CAMERA_NOISE,
    build=add_robot,
    controller=PandaOmronController,
    read_state=read_state,
    read_observations=read_observations,
)
