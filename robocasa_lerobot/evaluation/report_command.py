"""`robocasa-lerobot report`: write report.html, .md, .tex and two .csv files from the results of evaluations."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

EXAMPLE = "robocasa-lerobot report outputs/demo/evaluation --training outputs/demo --demos demos/OpenDrawer.hdf5"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "results",
        nargs="+",
        type=Path,
        metavar="RUN",
        help="folder with a trials.jsonl, or output of a training with evaluations",
    )
    parser.add_argument(
        "--training",
        nargs="*",
        type=Path,
        default=[],
        metavar="DIR",
        help="output folder of a training, for its loss curves; default: where the evaluated checkpoints lie",
    )
    parser.add_argument(
        "--demos",
        nargs="*",
        type=Path,
        default=[],
        metavar="FILE",
        help="HDF5 files of demonstrations, for the demonstrator's own success rate",
    )
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        default=None,
        metavar="FILE",
        help="HTML file, with .md, .tex and .csv beside it; default: report.html in the first RUN",
    )
    parser.add_argument("--title", default=None, help="heading of the report")
    parser.add_argument("--no-videos", action="store_true", help="film strips only, for a smaller file")


def run(args: argparse.Namespace) -> int:
    """Write the report and print the rates."""
    out = args.out or args.results[0] / "report.html"
    print_rates(args.results)
    write_report(args.results, args.training, args.demos, out, args.title, videos=not args.no_videos)
    return 0


def print_rates(results: Sequence[Path]) -> None:
    """The success rates on the terminal."""
    from robocasa_lerobot.evaluation.report.format import interval, percent
    from robocasa_lerobot.evaluation.report.gather import gather
    from robocasa_lerobot.evaluation.results import UNPERTURBED

    rows = [("policy", "task", "success", "95 % interval", "trials", "errors")]
    for policy in gather(results).single:
        for condition, tasks in policy.conditions.items():
            label = policy.label if condition == UNPERTURBED else f"{policy.label} ({condition})"
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
    from robocasa_lerobot.evaluation.report.build import build
    from robocasa_lerobot.evaluation.report.gather import gather
    from robocasa_lerobot.evaluation.report.render import write_report
    from robocasa_lerobot.evaluation.report.training import find_trainings, read_demonstrator, read_training

    data = gather(results, title)
    trainings = [read_training(folder) for folder in list(training) or find_trainings(data.policies)]
    demonstrators = [result for path in demos for result in read_demonstrator(path)]
    html, *others = write_report(build(data, trainings, demonstrators, videos), data, out)
    print(f"report: {html.resolve()} and {', '.join(path.name for path in others)}")
