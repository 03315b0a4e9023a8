"""`robocasa-lerobot convert`: demonstration files in, a LeRobotDataset v3.0 out."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from robocasa_lerobot.cli.options import add_source_options, import_lerobot_leanly, source_settings
from robocasa_lerobot.jobs.executors import add_options, execution_of
from robocasa_lerobot.jobs.importing import start_importing
from robocasa_lerobot.jobs.workers import cores_here

EXAMPLE = "robocasa-lerobot convert demos/*.hdf5 --out data/demos"

_CODECS = ("h264", "hevc", "av1")
_SHOWN_REJECTIONS = 5


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="HDF5 files of RoboCasa, robosuite or this project, folders of them, or LeRobot v2.0 or v2.1 datasets",
    )
    parser.add_argument("--out", required=True, type=Path, help="folder of the dataset; must not exist yet")
    parser.add_argument(
        "--asset-root",
        action="append",
        default=[],
        metavar="DIR",
        help="where to look for meshes and textures that the scenes name (repeatable); matched by the end of the path",
    )
    add_source_options(parser)
    parser.add_argument("--workers", type=int, help="processes (default: by the amount of work and cores)")
    parser.add_argument("--video-codec", choices=_CODECS, default="h264", help="default: %(default)s")
    parser.add_argument(
        "--render-preset",
        choices=("fast", "quality"),
        default="fast",
        help="how states are rendered: fast has no shadows, reflections or multisampling (default: %(default)s)",
    )
    parser.add_argument(
        "--reencode", action="store_true", help="encode videos of LeRobot v2 again even where they could be copied"
    )
    parser.add_argument(
        "--max-gop",
        type=int,
        default=10,
        metavar="FRAMES",
        help="videos of LeRobot v2 with more frames between key frames are encoded again (default: %(default)s)",
    )
    add_options(parser)
    parser.add_argument(
        "--merge", action="store_true", help="join the complete pieces of a conversion that was submitted to Slurm"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace a dataset at --out")


def run(args: argparse.Namespace) -> int:
    """Convert, and say what was written, rejected and assumed."""
    execution = execution_of(args)
    from robocasa_lerobot.convert.reading.inputs import demo_files
    from robocasa_lerobot.convert.settings import CORES_PER_WORKER, ConversionSettings
    from robocasa_lerobot.convert.worker_imports import worker_imports

    args.files = demo_files(args.files)
    if execution.kind == "local" and not args.merge and (args.workers or cores_here() // CORES_PER_WORKER) > 1:
        start_importing(worker_imports("robocasa_lerobot.convert.shard", lean=args.own_process))
    settings = ConversionSettings(
        asset_roots=tuple(args.asset_root),
        **source_settings(args),
        video_codec=args.video_codec,
        render_preset=args.render_preset,
        reencode=args.reencode,
        max_gop=args.max_gop,
    )
    import_lerobot_leanly(args)
    from robocasa_lerobot.convert.pipeline import convert, merge, submit

    if args.merge:
        result = merge(args.files, args.out, settings, args.overwrite)
    elif execution.kind == "slurm":
        print(submit(args.files, args.out, settings, execution, args.overwrite))
        return 0
    else:
        result = convert(args.files, args.out, settings, args.workers, args.overwrite, execution)
    cameras = ", ".join(result.cameras)
    print(f"{result.root}: {result.num_episodes} episodes, {result.num_frames} frames, cameras {cameras}")
    for note in result.notes:
        print(f"note: {note}")
    for warning in result.warnings:
        print(f"warning: {warning}")
    for source, count in result.instruction_sources.items():
        if args.replace_instruction:
            print(f"{count} episodes have the instruction that was given, whatever they record")
        elif source != "ep_meta.lang" and not source.startswith("tasks.jsonl"):
            print(f"{count} episodes record no instruction; theirs is taken from: {source}")
    if result.rejected:
        print(f"{len(result.rejected)} episodes rejected (all in meta/robocasa/rejected.jsonl):")
        for line in result.rejected[:_SHOWN_REJECTIONS]:
            print(f"  {line['source_file']} {line['source_demo']}: {line['reason']}")
    print(f"check it: robocasa-lerobot verify {shlex.quote(str(args.out))}")
    return 0
