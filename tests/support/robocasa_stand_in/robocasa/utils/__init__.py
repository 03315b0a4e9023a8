"""A stand-in for the package of this name, for tests of LeRobot's env of it."""
