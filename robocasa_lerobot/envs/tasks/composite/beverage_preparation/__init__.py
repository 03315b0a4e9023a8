"""Composite tasks of the family "beverage preparation"."""
