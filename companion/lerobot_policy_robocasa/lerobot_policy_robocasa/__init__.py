"""Imported by LeRobot's discovery of third-party plugins; registers the types of `robocasa_lerobot`."""

import robocasa_lerobot.plugins  # noqa: F401
