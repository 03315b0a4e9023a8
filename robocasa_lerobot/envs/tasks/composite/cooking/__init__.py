"""Composite tasks of the family "cooking"."""
