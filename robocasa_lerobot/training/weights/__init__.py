"""Weights beside those that the optimiser sees, and checkpoints."""
