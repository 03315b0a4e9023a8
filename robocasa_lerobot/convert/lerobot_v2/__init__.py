"""LeRobot v2.0 and v2.1 datasets as sources, RoboCasa365's own among them: read, planned, converted, verified."""
