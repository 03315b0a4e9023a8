"""MuJoCo beyond its Python package: compiled calls, whole states, and the options of every simulation."""
