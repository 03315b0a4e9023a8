"""Registers the env and policy types by importing the modules whose decorators do so."""

import robocasa_lerobot.envs.lerobot_plugin
import robocasa_lerobot.policies.diffusion_transformer.configuration_diffusion_transformer

# LeRobot does not import a policy's processor module before it reads a saved pipeline that names its steps.
import robocasa_lerobot.policies.diffusion_transformer.processor_diffusion_transformer  # noqa: F401
