"""Pieces that several policies use: image preparation, vision and text encoders, statistics."""
