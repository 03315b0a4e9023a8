"""Settings of an evaluation, and how they are read."""
