"""Pieces of work on this machine or a cluster."""
