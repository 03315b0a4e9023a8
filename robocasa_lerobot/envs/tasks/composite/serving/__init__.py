"""Composite tasks of the family "serving"."""
