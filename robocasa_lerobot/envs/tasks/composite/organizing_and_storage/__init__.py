"""Composite tasks of the family "organizing and storage"."""
