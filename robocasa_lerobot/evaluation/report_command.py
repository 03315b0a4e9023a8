"""`robocasa-lerobot report`: write report.html and report.md from the results of evaluations."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

EXAMPLE = "robocasa-lerobot report outputs/demo/evaluation --training outputs/demo --demos demos/OpenDrawer.hdf5"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("results", nargs="+", type=Path, metavar="RESULTS_DIR", help="folder with a trials.jsonl")
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
        type=Path,
        default=None,
        metavar="FILE",
        help="HTML file; default: report.html in the first RESULTS_DIR",
    )
    parser.add_argument("--title", default=None, help="heading of the report")


def run(args: argparse.Namespace) -> int:
    """Write the report and print the rates."""
    out = args.out or args.results[0] / "report.html"
    print_rates(args.results)
    write_report(args.results, args.training, args.demos, out, args.title)
    return 0


def print_rates(results: Sequence[Path]) -> None:
    """The success rates on the terminal."""
    from robocasa_lerobot.evaluation.report import interval, percent
    from robocasa_lerobot.evaluation.report_data import gather

    rows = [("policy", "task", "success", "95 % interval", "trials", "errors")]
    for policy in gather(results).policies:
        for result in policy.tasks:
            rate = result.rate
            counts = (f"{rate.successes}/{rate.trials}", str(result.errors))
            rows.append((policy.label, result.task, percent(rate.rate), interval(rate), *counts))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())


def write_report(
    results: Sequence[Path],
    training: Sequence[Path] = (),
    demos: Sequence[Path] = (),
    out: Path = Path("report.html"),
    title: str | None = None,
) -> None:
    """Write the report's two files and print where they are."""
    from robocasa_lerobot.evaluation import report
    from robocasa_lerobot.evaluation.report_data import gather

    html, markdown = report.write_report(gather(results, training, demos, title), out)
    print(f"report: {html.resolve()} and {markdown.name}")
