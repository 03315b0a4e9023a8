"""Demonstration files in, LeRobotDataset v3.0 out, and the check that compares the two."""
