"""Tasks of several stages, by family and activity."""
