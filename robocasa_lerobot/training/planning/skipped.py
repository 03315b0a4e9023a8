"""What a run could not do, written beside its phases, so that a report repeats what a log said once.

`<output_dir>/skipped.jsonl` has a line for each phase or evaluation that was left out, that failed, or that ran on a
part of its tasks. Every run writes the file anew: phases that are possible now have no line any more.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.files import written_aside
from robocasa_lerobot.jsonl import read_jsonl, write_jsonl

SKIPPED_FILE = "skipped.jsonl"
PHASE, EVALUATION, PARTIAL = "phase", "evaluation", "partial"
KINDS = (PHASE, EVALUATION, PARTIAL)


@dataclass(frozen=True)
class Skipped:
    """Something that was left out, and why.

    Attributes:
        kind: `phase` (not trained), `evaluation` (not run, or failed), `partial` (run on some of its tasks only).
        phase: the phase's name.
        evaluation: the evaluation's name; None for a phase.
        reason: a sentence for people.
    """

    kind: str
    phase: str
    evaluation: str | None
    reason: str

    def __post_init__(self) -> None:
        assert self.kind in KINDS, self.kind

    def __str__(self) -> str:
        what = f"phase {self.phase}" if self.evaluation is None else f"evaluation {self.evaluation} of {self.phase}"
        return f"{what} {'is partial' if self.kind == PARTIAL else 'is left out'}: {self.reason}"


def record(output_dir: Path, skipped: Iterable[Skipped]) -> None:
    """Write the file whole or not at all; with nothing to say it is removed."""
    path = output_dir / SKIPPED_FILE
    lines = [dataclasses.asdict(item) for item in dict.fromkeys(skipped)]
    if not lines:
        path.unlink(missing_ok=True)
        return
    output_dir.mkdir(parents=True, exist_ok=True)
    with written_aside(path) as aside:
        write_jsonl(aside, lines)


def decide(output_dir: Path, skipped: Iterable[Skipped], phases: Collection[str], evaluations: bool) -> None:
    """Write what a command leaves out, and keep what earlier ones said of evaluations that it is not about.

    Args:
        output_dir: the experiment's.
        skipped: phases and evaluations left out.
        phases: names of the phases that the command runs.
        evaluations: whether it runs their evaluations.
    """
    kept = [i for i in read(output_dir) if i.evaluation is not None and not (evaluations and i.phase in phases)]
    record(output_dir, [*kept, *skipped])


def read(output_dir: Path) -> list[Skipped]:
    """The lines of the file, in their order; none where there is no file."""
    path = output_dir / SKIPPED_FILE
    if not path.is_file():
        return []
    return [Skipped(**line) for line in read_jsonl(path)]
