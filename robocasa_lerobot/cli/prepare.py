"""`robocasa-lerobot prepare`: make demonstrations ready to be sources of generated ones."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

EXAMPLE = "robocasa-lerobot prepare demos/"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files of demonstrations, or folders")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--fresh", action="store_true", help="prepare again what is prepared already")


def run(args: argparse.Namespace) -> int:
    """Prepare the files; status 1 where no demonstration can be a source."""
    from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
    from robocasa_lerobot.demos.replay import demonstrations
    from robocasa_lerobot.progress import Bar

    total = len(demonstrations(args.paths))
    outcomes = list(Bar(prepare_files(args.paths, workers=args.workers, fresh=args.fresh), total=total, unit="demo"))
    for outcome in outcomes:
        if outcome.dropped:
            print(f"{outcome.path}, {outcome.demo}: no source, {outcome.dropped}")
    ready = sum(not outcome.dropped for outcome in outcomes)
    print(f"{ready} of {total} demonstrations are sources now")
    return 0 if ready else 1
