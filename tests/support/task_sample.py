"""What draws the tasks and the costly tests of a run of the fast tests: light, since every run of pytest reads it."""

import hashlib
from collections.abc import Sequence

SAMPLE_VARIABLE = "ROBOCASA_LEROBOT_TASK_SAMPLE"  # set by conftest: the commit, or what --task-sample says
TURNS = 3  # costly tests run once in so many


def number_of(sample: str) -> int:
    """A large number that follows from a sample's text."""
    return int(hashlib.sha256(sample.encode()).hexdigest(), 16)


def whose_turn[Test](tests: Sequence[Test], sample: str) -> list[Test]:
    """Every third of the tests; from which one on follows from the sample, so that in time all of them are run."""
    return list(tests[number_of(sample) % TURNS :: TURNS])
