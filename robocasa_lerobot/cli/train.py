"""`robocasa-lerobot train`, which `train.py` runs too."""

from __future__ import annotations

import argparse
import shlex

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.parent import add_end_with_input, end_with_input

EXAMPLE = "robocasa-lerobot train --config_path configs/experiments/demo.yaml"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options; everything else on the command line is a dotted setting of the experiment."""
    parser.add_argument(
        "--config_path",
        required=True,
        metavar="FILE",
        help="the experiment file, or a name in configs/experiments/: small/foundation",
    )
    parser.add_argument(
        "--resume",
        choices=("auto", "force"),
        default="auto",
        help="auto (default): continue what was begun, if its settings are the same; force: even if they are not",
    )
    parser.add_argument(
        "--stop_after", type=_steps, metavar="STEPS", help="save and end after so many steps of this run"
    )
    parser.add_argument("--phase", metavar="NAME", help="run this phase only; what it starts from must be finished")
    parser.add_argument("--evaluate", action="store_true", help="run the phases' evaluations when they are finished")
    parser.add_argument(
        "--scale",
        metavar="FILE",
        help="make everything smaller by a file, or a name in configs/scales/, to try the whole experiment: tiny",
    )
    parser.add_argument("--print_config", action="store_true", help="print the resolved experiment and end")
    parser.add_argument(
        "--plan", action="store_true", help="print steps, samples, missing data, disk and hours of each phase, and end"
    )
    parser.add_argument(
        "--measure", type=_steps, default=20, metavar="STEPS", help="steps that --plan times; 0: none (default 20)"
    )
    add_end_with_input(parser)
    parser.epilog = (
        f"{parser.epilog or ''}\n\nAny setting of the experiment can be given as --name=value, such as\n"
        "  --output_dir=outputs/try --phases.pretrain.batch_size=16 --policy.horizon=16 --defaults.learning_rate=1e-4"
    )
    parser.set_defaults(takes_settings=True)


def _steps(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} is no number of steps: 0 or more")
    return int(text)


def run(args: argparse.Namespace) -> int:
    """Run the experiment; 0 when finished, 3 when it stopped as asked, 75 when a signal ended it (run it again)."""
    from robocasa_lerobot.data.registry.registry import MissingDatasetsError

    try:
        return _run(args)
    except MissingDatasetsError as error:
        raise UserError(_with_file(str(error), args)) from error


def _with_file(text: str, args: argparse.Namespace) -> str:
    """What is said of missing datasets, with the command for the very experiment."""
    from robocasa_lerobot.data.registry.registry import MAKE, make_remedy

    scale = ["--scale", args.scale] if args.scale else []
    return text.replace(MAKE, make_remedy(shlex.join([args.config_path, *scale, *getattr(args, "settings", ())])))


def _run(args: argparse.Namespace) -> int:
    if args.end_with_input:
        end_with_input()
    from robocasa_lerobot.training.cpu_tuning import limit_spinning

    limit_spinning()
    from robocasa_lerobot.config_files import find_config
    from robocasa_lerobot.training.config.experiment import load_experiment, to_yaml

    experiment = load_experiment(
        find_config(args.config_path, "experiments"), getattr(args, "settings", ()), args.scale
    )
    if args.plan:
        from robocasa_lerobot.training.planning.evaluations import plan_evaluations
        from robocasa_lerobot.training.planning.plan import plan_experiment
        from robocasa_lerobot.training.planning.plan_text import render_plan
        from robocasa_lerobot.training.setup.builders import best_device

        plans = plan_experiment(experiment, args.phase, args.measure)
        evaluations = plan_evaluations(experiment, [plan.phase for plan in plans if not plan.left_out])
        print(_with_file(render_plan(experiment, plans, best_device(experiment.device), evaluations), args))
        return 0
    print(to_yaml(experiment), flush=True)
    if args.print_config:
        return 0
    from robocasa_lerobot.training.interrupts import REQUEUE, STOPPED, Interrupts
    from robocasa_lerobot.training.phases import run_experiment

    interrupts = Interrupts(args.stop_after)
    finished = run_experiment(
        experiment, force=args.resume == "force", only=args.phase, evaluate=args.evaluate, interrupts=interrupts
    )
    if finished:
        return 0
    return REQUEUE if interrupts.signalled else STOPPED
