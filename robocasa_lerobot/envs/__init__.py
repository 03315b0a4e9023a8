"""Kitchens, robot, tasks: the MuJoCo side. Knows no torch."""
