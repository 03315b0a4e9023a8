"""Demonstrators that correct a policy: DAgger without a person."""
