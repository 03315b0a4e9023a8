"""Draws a look-alike without OpenGL, on a CPU: which triangle is seen in each pixel, then its colour."""
