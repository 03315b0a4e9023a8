"""Prepared demonstrations as sources: what preparing notes, how they are cut into segments, which fit a stage."""
