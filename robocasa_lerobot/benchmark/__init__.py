"""What RoboCasa365 publishes, as data: its tasks, and its results."""
