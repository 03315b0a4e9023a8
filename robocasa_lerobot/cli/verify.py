"""`robocasa-lerobot verify`: is a converted dataset what its source files hold?"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocasa_lerobot.cli.options import import_lerobot_leanly

if TYPE_CHECKING:
    from robocasa_lerobot.convert.verify import Report

EXAMPLE = "robocasa-lerobot verify data/demos"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("dataset", type=Path, metavar="DIR", help="folder of a dataset that `convert` wrote")
    parser.add_argument("--source", nargs="+", type=Path, default=[], metavar="FILE", help="the source files, if moved")
    parser.add_argument(
        "--asset-root",
        action="append",
        default=[],
        metavar="DIR",
        help="where meshes and textures are, if moved",
    )
    parser.add_argument(
        "--pictures-per-episode",
        type=_count,
        default=8,
        metavar="N",
        help="steps of each episode whose pictures are compared, or `all` (default: %(default)s)",
    )
    parser.add_argument(
        "--min-psnr",
        type=float,
        default=25.0,
        metavar="DB",
        help="how alike pictures must be (default: %(default)s dB)",
    )
    parser.add_argument("--workers", type=int, help="processes (default: by the number of episodes and cores)")
    parser.add_argument("--report", choices=("table", "json"), default="table", help="default: %(default)s")


def run(args: argparse.Namespace) -> int:
    """Verify; exit status 1 where anything differs."""
    from robocasa_lerobot.convert.reading.inputs import check_converted

    check_converted(args.dataset)
    import_lerobot_leanly(args)
    from robocasa_lerobot.convert.verify import verify

    pictures, least_db = args.pictures_per_episode, args.min_psnr
    report = verify(args.dataset, args.source, args.asset_root, pictures, least_db, args.workers)
    print(json.dumps(_finite(report.as_json()), indent=2) if args.report == "json" else _table(report))
    return 0 if report.passed else 1


def _finite(value: Any) -> Any:
    """The same with null for what JSON has no number for: equal pictures are infinitely many dB alike."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _count(text: str) -> int | None:
    if text == "all":
        return None
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a positive number nor `all`")
    return count


def _table(report: Report) -> str:
    lines = [f"{report.root}: {report.num_episodes} episodes, {report.num_frames} frames", ""]
    lines.append(f"{'check':<16}{'compared':>12}{'different':>12}")
    lines += [f"{c.name:<16}{c.compared:>12,}{c.num_differences:>12,}" for c in report.checks]
    lines += ["", f"{'camera':<26}{'pictures':>9}{'PSNR min':>12}{'PSNR mean':>12}"]
    lines += [f"{c.camera:<26}{len(c.psnr_db):>9,}{c.minimum:>9.1f} dB{c.mean:>9.1f} dB" for c in report.cameras]
    for check in report.checks:
        lines += [f"\n{check.name}:"] if check.differences else []
        lines += [f"  {difference}" for difference in check.differences]
        hidden = check.num_differences - len(check.differences)
        lines += [f"  ... and {hidden} more"] if hidden else []
    return "\n".join([*lines, "", "PASSED" if report.passed else "FAILED"])
