"""`robocasa-lerobot report`: write report.html, .md, .tex and two .csv files from the results of evaluations."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = (
    "robocasa-lerobot report outputs/demo/evaluation --training outputs/demo --demos outputs/demo/demos/OpenDrawer.hdf5"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "results",
        nargs="+",
        type=Path,
        metavar="RUN",
        help="folder with a trials.jsonl, such a file, or output of a training with evaluations",
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
        help="HTML file, with .md, .tex and .csv beside it; default: report.html in the first RUN, or beside that file",
    )
    parser.add_argument("--title", default=None, help="heading of the report")
    parser.add_argument("--no-videos", action="store_true", help="film strips only, for a smaller file")


def run(args: argparse.Namespace) -> int:
    """Write the report and print the rates."""
    from robocasa_lerobot.evaluation.records.results import TRIALS_FILE
    from robocasa_lerobot.evaluation.report.formats.render import check_ending
    from robocasa_lerobot.evaluation.report.output import print_rates, write_report

    results = [path.parent if path.name == TRIALS_FILE and path.is_file() else path for path in args.results]
    # Films and report lie beside a file.
    out = args.out or (results[0].parent if results[0].is_file() else results[0]) / "report.html"
    check_ending(out)
    print_rates(results)
    write_report(results, args.training, args.demos, out, args.title, videos=not args.no_videos)
    return 0
