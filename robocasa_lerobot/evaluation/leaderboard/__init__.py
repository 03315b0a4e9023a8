"""The public leaderboard: whether a run follows its protocol, and the submission file that it asks for."""
