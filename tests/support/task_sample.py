"""What draws the tasks of a run of the fast tests: light, since every run of pytest reads it."""

SAMPLE_VARIABLE = "ROBOCASA_LEROBOT_TASK_SAMPLE"  # set by conftest: the commit, or what --task-sample says
