"""`robocasa-lerobot export`: a LeRobotDataset v3.0 back to HDF5."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = "robocasa-lerobot export data/demos --out demos.hdf5"

_COMPRESSIONS = ("gzip", "lzf", "none")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("dataset", type=Path, metavar="DIR", help="folder of a LeRobotDataset v3.0")
    parser.add_argument("--out", required=True, type=Path, metavar="FILE", help="HDF5 file; must not exist yet")
    pictures = parser.add_mutually_exclusive_group()
    pictures.add_argument("--no-images", action="store_true", help="leave the pictures out")
    pictures.add_argument(
        "--cameras",
        type=lambda text: tuple(name.strip() for name in text.split(",") if name.strip()),
        metavar="A,B,C",
        help="cameras to take (default: all)",
    )
    parser.add_argument("--task", metavar="NAME", help="only its episodes, of a dataset of several tasks")
    parser.add_argument(
        "--compression", choices=_COMPRESSIONS, default="gzip", help="of all arrays (default: %(default)s)"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a file at --out")


def run(args: argparse.Namespace) -> int:
    """Export, and list the written and the missing data."""
    from robocasa_lerobot.convert.export import ExportSettings, export

    settings = ExportSettings(args.cameras, not args.no_images, args.task, args.compression)
    result = export(args.dataset, args.out, settings, args.overwrite)
    print(f"{result.path}: {result.num_episodes} episodes, {result.num_frames} frames")
    for note in result.notes:
        print(f"note: {note}")
    return 0
