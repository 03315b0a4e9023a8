"""The robot's controllers: what turns a 12-D action into actuator commands at every physics step."""
