"""LeRobotDatasets v3.0: tables, videos, statistics."""
