"""Picking and placing: how an object is grasped where it is, carried, and put down where it goes."""
