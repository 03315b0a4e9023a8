"""Who drives the robot, and how what is held becomes an action."""
