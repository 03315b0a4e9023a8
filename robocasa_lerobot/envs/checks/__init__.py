"""What kitchens and tasks must pass."""
