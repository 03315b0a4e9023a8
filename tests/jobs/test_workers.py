"""How many processes a piece of work takes."""

from __future__ import annotations

import pytest

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs import workers


@pytest.mark.parametrize(
    ("cores", "cores_each", "pieces", "work", "expected"),
    [(2, 1, 9, 900, 2), (2, 2, 9, 900, 1), (1, 2, 9, 900, 1), (7, 2, 9, 900, 3), (64, 2, 9, 900, 8), (8, 1, 3, 900, 3),
     (8, 1, 9, 250, 2), (8, 1, 9, 50, 1)],
)  # fmt: skip
def test_the_number_follows_cores_pieces_and_work(
    monkeypatch: pytest.MonkeyPatch, cores: int, cores_each: int, pieces: int, work: int, expected: int
) -> None:
    monkeypatch.setattr(workers, "cores_here", lambda: cores)
    assert workers.num_workers(None, pieces, work, 100, cores_each) == expected


def test_what_was_asked_for_counts_up_to_the_pieces() -> None:
    assert workers.num_workers(5, 9, 1, 100, 2) == 5
    assert workers.num_workers(5, 2, 1, 100) == 2
    with pytest.raises(UserError, match="expected at least 1"):
        workers.num_workers(0, 9, 900, 100)
