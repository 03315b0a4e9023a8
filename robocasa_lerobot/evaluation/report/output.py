"""What the results of evaluations come to: rates on the terminal, and the report's files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report.build import build
from robocasa_lerobot.evaluation.report.formats.render import write_report as render
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.numbers import interval, percent
from robocasa_lerobot.evaluation.report.training import find_trainings, read_demonstrator, read_training


def print_rates(results: Sequence[Path]) -> None:
    """The success rates on the terminal."""
    rows = [("policy", "task", "success", "95 % interval", "trials", "errors")]
    for policy in gather(results).single:
        for condition, tasks in policy.conditions.items():
            # The label of a policy without unperturbed trials names the perturbation itself.
            plain = condition in (UNPERTURBED, policy.condition)
            label = policy.label if plain else f"{policy.label} ({condition})"
            for result in tasks:
                rate = result.rate
                counts = (f"{rate.successes}/{rate.trials}", str(result.errors))
                rows.append((label, result.task, percent(rate.rate), interval(rate), *counts))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())


def write_report(
    results: Sequence[Path],
    training: Sequence[Path] = (),
    demos: Sequence[Path] = (),
    out: Path = Path("report.html"),
    title: str | None = None,
    videos: bool = True,
) -> None:
    """Write the report's files and print where they are."""
    data = gather(results, title)
    trainings = [read_training(folder) for folder in list(training) or find_trainings(data.single)]
    demonstrators = [result for path in demos for result in read_demonstrator(path)]
    html, *others = render(build(data, trainings, demonstrators, videos), data, out)
    print(f"report: {html.resolve()} and {', '.join(path.name for path in others)}")
