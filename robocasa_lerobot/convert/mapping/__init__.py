"""What the columns of a dataset are made of."""
