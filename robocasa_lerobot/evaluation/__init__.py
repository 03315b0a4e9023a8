"""Seeded trials, their records, and the report."""
