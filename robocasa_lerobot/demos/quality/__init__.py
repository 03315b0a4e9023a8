"""What demonstrations are worth: how they move, what they touch, how they differ, which starts they cover."""
