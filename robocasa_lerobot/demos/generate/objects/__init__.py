"""Segments about objects: taken hold of, used, and put down as in a source."""
