"""What is held on its way: the arm folded with it, the base's drive, and vessels that stay upright."""
