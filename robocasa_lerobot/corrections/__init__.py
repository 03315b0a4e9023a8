"""Demonstrators that correct what a policy does, or something that leads the hand astray: no person is needed."""
