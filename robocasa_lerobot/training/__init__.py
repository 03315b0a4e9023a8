"""Training phases on one Accelerate loop."""
