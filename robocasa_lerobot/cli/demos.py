"""`robocasa-lerobot demos`: record demonstrations."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robocasa_lerobot.jobs.workers import cores_here

if TYPE_CHECKING:
    from robocasa_lerobot.demos.recording import RecordingResult, RecordingSettings
    from robocasa_lerobot.jobs.executors import Execution

EXAMPLE = (
    "robocasa-lerobot demos --tasks OpenDrawer --episodes 20 --split target --seed 0 --out demos/\n"
    "  robocasa-lerobot demos --tasks atomic_seen --episodes 50 --split pretrain --keep-failures --out demos/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from robocasa_lerobot.jobs.executors import add_options

    add_kitchen_options(parser)
    parser.add_argument(
        "--plain", action="store_true", help="no variety: speed, paths and choice of grasps as the skills have them"
    )
    parser.add_argument(
        "--disturbances",
        type=int,
        default=0,
        metavar="N",
        help="up to N times in an episode the hand is led astray on its way, and comes from there (default: none)",
    )
    add_options(parser)


def add_kitchen_options(parser: argparse.ArgumentParser) -> None:
    """Add what every recording of attempts asks for: tasks, episodes, kitchens, seeds, noise and pictures."""
    parser.add_argument(
        "--tasks",
        required=True,
        help="names and sets (atomic_seen, ...) separated by commas, `atomic`, `composite` or `all`; see `tasks`",
    )
    parser.add_argument("--episodes", type=int, default=20, help="successful episodes per task (default 20)")
    parser.add_argument(
        "--split",
        default="target",
        help="kitchens: target, pretrain, or of the latter pretrain_train and pretrain_val (default target)",
    )
    for what in ("layouts", "styles"):
        parser.add_argument(
            f"--{what}",
            type=_ids,
            metavar="IDS",
            help=f"{what} by id or group id, separated by commas, instead of the split's own (--{what}=-1,12)",
        )
    parser.add_argument("--seed", type=int, default=0, help="seed of the first attempt (default 0)")
    parser.add_argument("--out", type=Path, required=True, help="folder that gets one <task>.hdf5 per task")
    parser.add_argument("--workers", type=int, help="processes of this machine (default: all cores)")
    parser.add_argument(
        "--action-noise",
        type=float,
        default=0.0,
        help="standard deviation of noise on arm commands, 1 is a full command; 0.05 is a good one (default: none)",
    )
    parser.add_argument(
        "--start-within",
        type=float,
        default=0.0,
        metavar="METRES",
        help="the robot starts anywhere as far from the task's own start, at any heading (default: the task's own)",
    )
    parser.add_argument(
        "--images", action="store_true", help="store camera pictures too (the converter can render them)"
    )
    parser.add_argument("--image-size", type=int, default=256, help="height and width of stored pictures (default 256)")
    parser.add_argument(
        "--keep-failures",
        action="store_true",
        help="write failures/<task>/seed_<n>.mp4 and .json: a film, why, and the terms of the goal that did not hold",
    )


def run(args: argparse.Namespace) -> int:
    """Record every task and print a table; status 1 if one had to be given up."""
    from robocasa_lerobot.corrections.disturbances import with_disturbances
    from robocasa_lerobot.demos.recording import RecordingSettings
    from robocasa_lerobot.jobs.executors import execution_of

    execution = execution_of(args)
    values = {**kitchen_values(args), "varied": not args.plain}
    settings = [RecordingSettings(task=name, **values) for name in demonstrable(args.tasks)]
    return record([with_disturbances(one, args.disturbances) for one in settings], args, execution)[0]


def kitchen_values(args: argparse.Namespace) -> dict[str, Any]:
    """What `add_kitchen_options` asked for, as values of `RecordingSettings`, but for the task."""
    return {
        "episodes": args.episodes,
        "split": args.split,
        "seed": args.seed,
        "action_noise": args.action_noise,
        "start_within_m": args.start_within,
        "images": args.images,
        "image_size": args.image_size,
        "layouts": args.layouts,
        "styles": args.styles,
    }


def demonstrable(tasks: str) -> tuple[str, ...]:
    """The tasks of these names and sets that have a demonstrator; the others of the sets are named on the terminal."""
    from robocasa_lerobot.demos.choose import choose_tasks

    chosen = choose_tasks(tasks)
    if chosen.left_out:
        print(f"left out, for want of a demonstrator: {', '.join(chosen.left_out)}", flush=True)
    return chosen.names


def record(
    settings: Sequence[RecordingSettings], args: argparse.Namespace, execution: Execution
) -> tuple[int, list[RecordingResult]]:
    """Record every task and print a table; the command's status, and the results, none where jobs do it elsewhere."""
    from robocasa_lerobot.demos.distributed import record_distributed
    from robocasa_lerobot.demos.recording import record_tasks
    from robocasa_lerobot.demos.summary import print_summary

    if execution.kind != "local":
        line, status = record_distributed(settings, args.out, execution, keep_failures=args.keep_failures)
        if line:
            print(line)
        return status, []
    workers = args.workers if args.workers is not None else cores_here()
    results = record_tasks(settings, args.out, workers=workers, keep_failures=args.keep_failures)
    return print_summary(results), results


def _ids(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no list of ids such as 1,2,-4") from None
