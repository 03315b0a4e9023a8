"""The bar of `robocasa-lerobot data --make`: what it counts, and that it does not ask all of hundreds of pieces."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.making.pieces import PiecesDone


@dataclass
class Files:
    """A piece that is done as far as it has files."""

    name: str
    work: Path
    size: int = 4
    asked: int = 0

    def done(self) -> float:
        self.asked += 1
        return len(list(self.work.parent.glob(f"{self.name}.*")))

    def make(self, workers: int) -> str:
        raise AssertionError("counting makes nothing")


def test_only_pieces_at_work_are_asked_and_what_they_did_last_counts(tmp_path: Path) -> None:
    pieces = [Files(name, tmp_path / name) for name in "abc"]
    (tmp_path / "c.1").touch()  # of a run before
    done = PiecesDone(pieces)
    assert done.now() == 1
    (tmp_path / "a").mkdir()
    (tmp_path / "a.1").touch()
    assert done.now() == 2
    (tmp_path / "a.2").touch()
    (tmp_path / "a").rmdir()  # it has ended
    assert done.now() == 3
    assert done.now() == 3
    assert [piece.asked for piece in pieces] == [3, 1, 1]
