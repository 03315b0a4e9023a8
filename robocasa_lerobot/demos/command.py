"""`robocasa-lerobot demos`: record demonstrations."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

EXAMPLE = "robocasa-lerobot demos --tasks OpenDrawer --episodes 20 --split target --seed 0 --out demos/"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("--tasks", required=True, help="task names separated by commas")
    parser.add_argument("--episodes", type=int, default=20, help="successful episodes per task (default 20)")
    parser.add_argument("--split", default="target", help="kitchens: target or pretrain (default target)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first attempt (default 0)")
    parser.add_argument("--out", type=Path, required=True, help="folder that gets one <task>.hdf5 per task")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument(
        "--action-noise",
        type=float,
        default=0.05,
        help="standard deviation of the noise on arm commands, 1 is a full command (default 0.05)",
    )
    parser.add_argument(
        "--images", action="store_true", help="store camera pictures too (the converter can render them)"
    )
    parser.add_argument("--image-size", type=int, default=256, help="height and width of stored pictures (default 256)")


def run(args: argparse.Namespace) -> int:
    """Record every task; prints episodes, steps and the failure rate of each."""
    from robocasa_lerobot.demos.demonstrator import check_demonstrable
    from robocasa_lerobot.demos.record import RecordingSettings, record_task

    names = [name.strip() for name in args.tasks.split(",") if name.strip()]
    check_demonstrable(names)
    for name in names:
        settings = RecordingSettings(
            task=name,
            episodes=args.episodes,
            split=args.split,
            seed=args.seed,
            action_noise=args.action_noise,
            images=args.images,
            image_size=args.image_size,
        )
        result = record_task(settings, args.out, workers=args.workers)
        rate = 1 - len(result.failures) / result.tried
        print(
            f"{name}: {result.episodes} episodes, {result.steps} steps -> {result.path}; "
            f"{result.tried - len(result.failures)} of {result.tried} attempts succeeded ({rate:.0%})"
        )
        for failure in result.failures:
            print(f"  seed {failure.seed}: {failure.reason}")
    return 0
