"""Appliances made from a record each: 456 models in 12 categories, with doors, knobs, buttons and states that work."""
