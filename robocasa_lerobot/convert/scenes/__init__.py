"""Scenes of demonstrations compiled, here or in another process while the demonstration before is drawn."""
