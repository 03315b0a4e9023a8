"""Demonstrators that solve tasks through the same 12-D action interface as a policy, and their recorder."""
