"""One dataset on disk: its numbers and its pictures."""
