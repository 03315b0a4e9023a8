"""What is turned before it is held well: across behind a front, or with a handle in the way of the hand."""
