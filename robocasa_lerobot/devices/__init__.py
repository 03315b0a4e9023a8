"""The kitchen as a LeRobot robot, and teleoperators for it: `lerobot-record --robot.type=robocasa_kitchen`.

LeRobot finds the class of a device beside its configuration: `config_kitchen.py` and `kitchen.py`, and so on.
"""
