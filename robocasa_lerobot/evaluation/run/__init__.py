"""The trials of an evaluation: engine, worker processes, one rollout."""
