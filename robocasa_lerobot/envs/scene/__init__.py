"""Scenes in code: layouts, styles, fixtures, objects and the robot, assembled with `mujoco.MjSpec`."""
