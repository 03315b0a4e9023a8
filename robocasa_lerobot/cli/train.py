"""`robocasa-lerobot train`, which `train.py` runs too."""

from __future__ import annotations

import argparse
import subprocess
import sys
from typing import TYPE_CHECKING

from robocasa_lerobot.jobs.child_process import environment_of_python
from robocasa_lerobot.jobs.parent import add_end_with_input, end_with_input

if TYPE_CHECKING:
    from robocasa_lerobot.training.config.experiment import ExperimentConfig

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
        help="auto: continue what was begun, if its settings are the same; force: even if they are not",
    )
    parser.add_argument("--stop_after", type=int, metavar="STEPS", help="save and end after so many steps of this run")
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
        "--measure", type=int, default=20, metavar="STEPS", help="steps that --plan times; 0: none (default 20)"
    )
    add_end_with_input(parser)
    parser.epilog = (
        f"{parser.epilog or ''}\n\nAny setting of the experiment can be given as --name=value, such as\n"
        "  --output_dir=outputs/try --phases.pretrain.batch_size=16 --policy.horizon=16 --defaults.learning_rate=1e-4"
    )
    parser.set_defaults(takes_settings=True)


def run(args: argparse.Namespace) -> int:
    """Run the experiment; 0 when finished, 3 when it stopped as asked, 75 when a signal ended it (run it again)."""
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
        print(render_plan(experiment, plans, best_device(experiment.device), evaluations))
        return 0
    print(to_yaml(experiment), flush=True)
    if args.print_config:
        return 0
    from robocasa_lerobot.training.cores import in_processes, launched, processes_for
    from robocasa_lerobot.training.interrupts import REQUEUE, STOPPED

    phases = experiment.phases if args.phase is None else [experiment.phase(args.phase)]
    count = 1
    if experiment.cpu_processes != 1 and not launched() and _on_cpu(experiment.device):
        count = processes_for(experiment.cpu_processes, [p.batch_size // p.gradient_accumulation for p in phases])
    finished, signalled = in_processes(
        count,
        _train,
        experiment=experiment,
        force=args.resume == "force",
        only=args.phase,
        evaluate=args.evaluate,
        stop_after=args.stop_after,
    )
    if finished:
        return 0
    return REQUEUE if signalled else STOPPED


def _train(
    experiment: ExperimentConfig, force: bool, only: str | None, evaluate: bool, stop_after: int | None
) -> tuple[bool, bool]:
    """Run the experiment, in this process or one of several; whether it is finished, and whether a signal came."""
    from robocasa_lerobot.training.interrupts import Interrupts
    from robocasa_lerobot.training.phases import run_experiment

    interrupts = Interrupts(stop_after)
    finished = run_experiment(experiment, force=force, only=only, evaluate=evaluate, interrupts=interrupts)
    return finished, interrupts.signalled


def _on_cpu(device: str | None) -> bool:
    """Whether the experiment trains on a CPU; torch is asked in a process of its own, since it reads its threads once.

    Where a device is named, nobody is asked.
    """
    if device is not None:
        return device == "cpu"
    asked = "from robocasa_lerobot.training.setup.builders import best_device; print(best_device(None))"
    done = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True, env=environment_of_python()
    )
    return done.stdout.split()[-1] == "cpu"
