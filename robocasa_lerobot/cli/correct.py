"""`robocasa-lerobot correct`: a policy drives, a demonstrator takes over where it has not solved the task."""

from __future__ import annotations

import argparse

from robocasa_lerobot.cli.demos import add_kitchen_options, demonstrable, kitchen_values, record

EXAMPLE = (
    "robocasa-lerobot correct --policy outputs/demo/pretrain --tasks OpenDrawer --episodes 100 --seed 200000 "
    "--out corrections/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from robocasa_lerobot.jobs.executors import add_options

    parser.add_argument("--policy", required=True, help="its checkpoint's folder, as of `eval --policy.path`")
    add_kitchen_options(parser)
    parser.add_argument(
        "--after",
        type=_after,
        metavar="STEPS",
        help="when the demonstrator takes over: a number of control steps drawn between two (default 100,250)",
    )
    parser.add_argument("--device", default="cpu", help="that the policy computes on: cpu, cuda or mps (default cpu)")
    parser.add_argument("--plain", action="store_true", help="no variety in the corrections, as of `demos --plain`")
    add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Record every task and print a table; status 1 if one had to be given up."""
    from robocasa_lerobot.corrections.settings import CorrectionSettings
    from robocasa_lerobot.corrections.summary import correction_line
    from robocasa_lerobot.jobs.executors import execution_of

    execution = execution_of(args)
    values = {**kitchen_values(args), "varied": not args.plain, "device": args.device}
    if args.after is not None:
        values["after_steps"] = args.after
    settings = [CorrectionSettings.of(args.policy, task=name, **values) for name in demonstrable(args.tasks)]
    status, results = record(settings, args, execution)
    for result in results:
        if not result.gave_up:
            print(correction_line(result.path))
    return status


def _after(text: str) -> tuple[int, int]:
    from robocasa_lerobot.corrections.settings import parse_after

    try:
        return parse_after(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number of steps nor two, as in 100,250") from None
