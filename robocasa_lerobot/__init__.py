"""RoboCasa365-compatible kitchens, demonstrations, datasets, policies and evaluation for LeRobot."""

__version__ = "0.1.0"
