"""Long work in pieces: processes, Slurm and Ray, locks, and results that appear whole or not at all."""
