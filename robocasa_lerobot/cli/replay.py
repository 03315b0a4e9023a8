"""`robocasa-lerobot replay`: check that recorded demonstrations can be replayed."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from robocasa_lerobot.jobs.workers import cores_here

if TYPE_CHECKING:
    from robocasa_lerobot.demos.replay import Replayed

EXAMPLE = "robocasa-lerobot replay demos/"

# What recordings are expected to reach; the published demonstrations replay at about 86 %.
AIM_ACTIONS, AIM_STATES = 0.95, 1.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files of demonstrations, or folders")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take every n-th demonstration (default 1)")
    parser.add_argument("--workers", type=int, default=cores_here(), help="processes (default: all cores)")
    parser.add_argument(
        "--strips",
        type=Path,
        metavar="FOLDER",
        help="also draw a film strip (PNG) of each that fits its kitchen; where two files have one name, the number of "
        "the file comes before it",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print how many replay from their actions and from their states; status 1 where it is fewer than expected."""
    from robocasa_lerobot.demos.film_strip import film_strip
    from robocasa_lerobot.demos.replay import demonstrations, replay_all
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.progress import Bar

    if args.every < 1:
        raise UserError(f"--every {args.every}: expected 1 (all) or more.")
    chosen = demonstrations(args.paths)[:: args.every]
    results = sorted(
        Bar(replay_all(chosen, args.workers), total=len(chosen), unit="demo", disable=args.json),
        key=lambda result: chosen.index((result.path, result.demo)),
    )
    by_actions, by_states = sum(r.actions for r in results), sum(r.states for r in results)
    rates = by_actions / len(results), by_states / len(results)
    if args.json:
        rows = [_row(result) for result in results]
        content = {"actions": rates[0], "states": rates[1], "demonstrations": rows}
        print(json.dumps(content, indent=1, allow_nan=False))
    else:
        for result in results:
            if not (result.actions and result.states):
                failed = " and ".join(w for w, ok in (("actions", result.actions), ("states", result.states)) if not ok)
                why = result.note or f"joints deviate by up to {result.deviation:.3g}"
                print(f"{result.path}, {result.demo}: its {failed} do not reach the goal ({why})")
        exact = sum(result.same_start and result.deviation == 0 for result in results)
        print(
            f"{len(results)} demonstrations, {exact} of them pass through the recorded states bit for bit\n"
            f"actions, open loop from the first state: {by_actions} of {len(results)} ({rates[0]:.1%}, "
            f"aim {AIM_ACTIONS:.0%})\n"
            f"states: {by_states} of {len(results)} ({rates[1]:.1%}, aim {AIM_STATES:.0%})"
        )
    if args.strips:  # last: what was found out is printed, whatever becomes of them
        names = _strip_names([result.path for result in results])
        drawn = [result for result in results if math.isfinite(result.deviation)]
        for result in Bar(drawn, unit="strip", disable=args.json):
            film_strip(result.path, result.demo, args.strips / f"{names[result.path]}_{result.demo}.png")
    return 0 if rates[0] >= AIM_ACTIONS and rates[1] >= AIM_STATES else 1


def _row(result: Replayed) -> dict[str, object]:
    """Plain values; JSON has no infinity."""
    deviation = result.deviation if math.isfinite(result.deviation) else None
    return {**asdict(result), "path": str(result.path), "deviation": deviation}


def _strip_names(paths: Sequence[Path]) -> dict[Path, str]:
    """What the strips of each file are called: as the file, unless two files have one name."""
    files = list(dict.fromkeys(paths))
    if len({file.stem for file in files}) == len(files):
        return {file: file.stem for file in files}
    return {file: f"{number}_{file.stem}" for number, file in enumerate(files, 1)}
