"""Tasks of one skill each."""
