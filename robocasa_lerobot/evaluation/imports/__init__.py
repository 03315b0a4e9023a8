"""What the processes of an evaluation import before their work."""
