"""`robocasa-lerobot prepare`: make demonstrations ready to be sources of generated ones."""

from __future__ import annotations

import argparse
from pathlib import Path

from robocasa_lerobot.jobs.workers import cores_here

EXAMPLE = (
    "robocasa-lerobot prepare demos/\n  robocasa-lerobot prepare lift.hdf5 --bodies cube_main --asset-root assets/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files of demonstrations, or folders")
    parser.add_argument("--workers", type=int, default=cores_here(), help="processes (default: all cores)")
    parser.add_argument(
        "--bodies",
        metavar="NAMES",
        help="of robosuite's or robomimic's files with a Panda on a stand: bodies that subtasks are relative to, "
        "separated by commas; the signal `grasp` is about the first",
    )
    parser.add_argument(
        "--asset-root",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="where their meshes lie",
    )
    parser.add_argument(
        "--fresh", action="store_true", help="prepare again what is prepared already (with --bodies always)"
    )


def run(args: argparse.Namespace) -> int:
    """Prepare the files; status 1 where no demonstration can be a source."""
    from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
    from robocasa_lerobot.demos.replay import demonstrations
    from robocasa_lerobot.progress import Bar

    total = len(demonstrations(args.paths))
    if args.bodies:
        return _prepare_foreign(args, total)
    outcomes = list(Bar(prepare_files(args.paths, workers=args.workers, fresh=args.fresh), total=total, unit="demo"))
    for outcome in outcomes:
        if outcome.dropped:
            print(f"{outcome.path}, {outcome.demo}: no source, {outcome.dropped}")
    ready = sum(not outcome.dropped for outcome in outcomes)
    print(f"{ready} of {total} demonstrations are sources now")
    return 0 if ready else 1


def _prepare_foreign(args: argparse.Namespace, total: int) -> int:
    from robocasa_lerobot.hdf5_files import hdf5_files_of
    from robocasa_lerobot.making.foreign_sources import prepare_foreign
    from robocasa_lerobot.progress import Bar

    bodies = [name.strip() for name in args.bodies.split(",")]
    files = sorted({file for path in args.paths for file in hdf5_files_of(path)})
    infos = (info for file in files for info in prepare_foreign(file, bodies, args.asset_root))
    ready = sum(1 for _ in Bar(infos, total=total, unit="demo"))
    print(
        f"{ready} of {total} demonstrations are sources now, for their own scene: "
        "robocasa_lerobot.demos.generate.fixed_arm carries them over there; kitchens have none of their bodies."
    )
    return 0
