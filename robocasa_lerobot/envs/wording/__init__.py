"""What the robot is told in each task, and in other words: kept apart from what the tasks are."""
