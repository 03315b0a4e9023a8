"""Registers the env, policy and device types, as LeRobot's discovery expects of the module that it imports."""

import robocasa_lerobot.devices.config_hand
import robocasa_lerobot.devices.config_kitchen
import robocasa_lerobot.devices.config_replay
import robocasa_lerobot.envs.lerobot_plugin  # noqa: F401
from robocasa_lerobot.policies.registry import register_policies

register_policies()
