"""Composite tasks of the family "cleaning and sanitizing"."""
