"""Names of the PandaOmron's joints, actuators, sites and bodies: RoboCasa's, so that its recorded files fit ours."""

from __future__ import annotations

ROBOT_BASE = "robot0_base"
MOBILE_BASE = "mobilebase0_base"
SUPPORT = "mobilebase0_support"  # top of the column: carries the arm and the scene cameras, moves with the torso
HAND = "robot0_right_hand"
GRIPPER = "gripper0_right_right_gripper"

BASE_JOINTS = ("mobilebase0_joint_mobile_forward", "mobilebase0_joint_mobile_side", "mobilebase0_joint_mobile_yaw")
TORSO_JOINT = "mobilebase0_joint_torso_height"
ARM_JOINTS = tuple(f"robot0_joint{i}" for i in range(1, 8))
FINGER_JOINTS = ("gripper0_right_finger_joint1", "gripper0_right_finger_joint2")

BASE_ACTUATORS = (
    "mobilebase0_actuator_mobile_forward",
    "mobilebase0_actuator_mobile_side",
    "mobilebase0_actuator_mobile_yaw",
)
TORSO_ACTUATOR = "mobilebase0_actuator_torso_height"
ARM_ACTUATORS = tuple(f"robot0_torq_j{i}" for i in range(1, 8))
FINGER_ACTUATORS = ("gripper0_right_gripper_finger_joint1", "gripper0_right_gripper_finger_joint2")

BASE_CENTER_SITE = "mobilebase0_center"  # the base pose of observations
ARM_CENTER_SITE = "robot0_right_center"  # the frame that arm commands are given in
GRIP_SITE = "gripper0_right_grip_site"  # between the finger tips: the end effector's position

FINGER_PAD_GEOMS = ("gripper0_right_finger1_pad_collision", "gripper0_right_finger2_pad_collision")
