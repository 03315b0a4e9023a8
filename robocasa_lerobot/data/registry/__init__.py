"""Which datasets there are, and where."""
