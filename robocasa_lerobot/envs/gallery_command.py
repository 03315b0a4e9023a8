"""`robocasa-lerobot gallery`: render kitchens and tasks to pictures."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = "robocasa-lerobot gallery --tasks OpenDrawer --seeds 0,1 --preset quality --out gallery/"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--tasks", help="task names separated by commas (default: all)")
    parser.add_argument("--seeds", default="0", help="seeds separated by commas (default 0)")
    parser.add_argument("--split", default="target", help="kitchens: target or pretrain (default target)")
    parser.add_argument("--preset", default="fast", help="render preset: fast or quality (default fast)")
    parser.add_argument("--image-size", type=int, default=256, help="height and width of camera pictures (default 256)")
    parser.add_argument("--overview-size", default="1280x720", help="size of the view of the whole kitchen")
    parser.add_argument("--format", choices=["png", "jpg"], default="png", help="of the pictures (default png)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")


def run(args: argparse.Namespace) -> int:
    """Write, for each task and seed, the three camera pictures side by side and a view of the kitchen."""
    from robocasa_lerobot.envs.gallery import render_task
    from robocasa_lerobot.envs.registry import get_task, task_names
    from robocasa_lerobot.errors import UserError

    names = [n.strip() for n in args.tasks.split(",")] if args.tasks else list(task_names())
    try:
        seeds = [int(s) for s in args.seeds.split(",")]
        width, height = (int(s) for s in args.overview_size.split("x"))
    except ValueError:
        raise UserError(
            f"--seeds {args.seeds!r} must be numbers separated by commas, and --overview-size {args.overview_size!r} "
            "WIDTHxHEIGHT in pixels."
        ) from None
    for name in names:
        get_task(name)
    for name in names:
        for seed in seeds:
            for path in render_task(
                name, seed, args.out, args.split, args.preset, args.image_size, (height, width), args.format
            ):
                print(path)
    return 0
