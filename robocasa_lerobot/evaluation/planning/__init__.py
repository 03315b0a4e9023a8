"""What an evaluation will do, decided before anything runs."""
