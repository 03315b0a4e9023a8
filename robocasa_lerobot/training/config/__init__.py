"""Experiments as typed configuration, from their files."""
