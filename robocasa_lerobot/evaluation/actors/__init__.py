"""What gives a trial its actions: checkpoints here or behind a policy server, and reference policies."""
