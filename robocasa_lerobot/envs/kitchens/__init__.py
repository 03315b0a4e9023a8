"""Kitchens in code: layouts, styles, fixtures and appliances."""
