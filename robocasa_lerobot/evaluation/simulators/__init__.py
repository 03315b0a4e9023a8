"""Other simulators behind the evaluation: their envs run in their own interpreters and are asked over pipes."""
