"""LeRobot policies. Know no MuJoCo."""
