"""Composite tasks of the family "food preparation"."""
