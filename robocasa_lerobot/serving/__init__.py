"""Policies of ours in anybody's evaluation, and our kitchens as a benchmark of another harness."""
