"""`robocasa-lerobot train`, which `train.py` runs too."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = "robocasa-lerobot train --config_path configs/experiments/demo.yaml"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options; everything else on the command line is a dotted setting of the experiment."""
    parser.add_argument("--config_path", type=Path, required=True, metavar="FILE", help="the experiment file")
    parser.add_argument(
        "--resume",
        choices=("auto", "force"),
        default="auto",
        help="auto: continue what was begun, if its settings are the same; force: even if they are not",
    )
    parser.add_argument("--stop_after", type=int, metavar="STEPS", help="save and end after so many steps of this run")
    parser.add_argument("--print_config", action="store_true", help="print the resolved experiment and end")
    parser.epilog = (
        f"{parser.epilog or ''}\n\nAny setting of the experiment can be given as --name=value, such as\n"
        "  --output_dir=outputs/try --phases.pretrain.batch_size=16 --policy.horizon=16 --defaults.learning_rate=1e-4"
    )
    parser.set_defaults(takes_settings=True)


def run(args: argparse.Namespace) -> int:
    """Run the experiment; 0 when finished, 3 when it was asked to stop before."""
    from robocasa_lerobot.training.config import load_experiment, to_yaml

    experiment = load_experiment(args.config_path, getattr(args, "settings", ()))
    print(to_yaml(experiment), flush=True)
    if args.print_config:
        return 0
    from robocasa_lerobot.training.phases import run_experiment

    finished = run_experiment(experiment, stop_after=args.stop_after, force=args.resume == "force")
    return 0 if finished else 3
