"""What is kept of an episode: its steps and states, and the files of those that are saved."""
