"""What an experiment would do, and what it leaves out and why."""
