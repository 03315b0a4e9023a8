"""`robocasa-lerobot study`: trainings that answer questions, from data to trials, and the page of their results."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = (
    "robocasa-lerobot study --plan\n"
    "  robocasa-lerobot study multitask --seeds 1\n"
    "  robocasa-lerobot study --results docs/results --page docs/results.md"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    from robocasa_lerobot.jobs.parent import add_end_with_input
    from robocasa_lerobot.study.runs import CPU, DEVICES

    parser.add_argument(
        "parts", nargs="*", metavar="PART", help="parts of the study (default: all that are not on request)"
    )
    parser.add_argument("--config_path", type=Path, metavar="FILE", help="study file (default: configs/study.yaml)")
    parser.add_argument(
        "--plan", action="store_true", help="print demonstrations, hours and disk of each part, and end"
    )
    parser.add_argument(
        "--measure", type=int, default=20, metavar="STEPS", help="steps that --plan times; 0: none (default 20)"
    )
    parser.add_argument(
        "--seeds", type=int, metavar="N", help="trainings of each experiment of PARTs (default: their own)"
    )
    parser.add_argument(
        "--device",
        choices=DEVICES,
        default=CPU,
        help="cuda: a larger policy, pictures twice as large each way, eight times the batch, a quarter of the steps "
        "(default %(default)s)",
    )
    parser.add_argument("--workers", type=int, help="processes that make data (default: all cores)")
    parser.add_argument(
        "--at_once",
        type=int,
        metavar="N",
        help="trainings beside each other, each with its share of the cores (default: one for each core, at most 4; "
        "one on a GPU); the same command on further nodes of a cluster takes part as well",
    )
    parser.add_argument("--scale", metavar="NAME", help="as in `train`: try all of it in minutes")
    parser.add_argument(
        "--episodes", metavar="KIND=N,...", help="as in `data`: demonstrations of each task (default: the registry's)"
    )
    parser.add_argument(
        "--root",
        type=Path,
        metavar="DIR",
        help="folder of the trainings (default: the study file's, another one for each --device, --scale, --episodes)",
    )
    parser.add_argument("--results", type=Path, metavar="DIR", help="where ended runs are kept (default: ROOT/results)")
    parser.add_argument("--page", type=Path, metavar="FILE", help="Markdown page (default: RESULTS/results.md)")
    parser.add_argument("--report", action="store_true", help="run nothing: write the page of what has ended")
    add_end_with_input(parser)


def run(args: argparse.Namespace) -> int:
    """Plan, or run what has not ended yet; keep each phase that ends, and write the page anew."""
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.jobs.parent import end_with_input
    from robocasa_lerobot.study.settings import load_study

    if args.end_with_input:
        end_with_input()
    if args.seeds is not None and args.seeds < 1:
        raise UserError(f"--seeds is {args.seeds}, expected at least 1.")
    if args.at_once is not None and args.at_once < 1:
        raise UserError(f"--at_once is {args.at_once}, expected at least 1 training at a time.")
    study = load_study(args.config_path)
    parts = study.chosen(args.parts, args.seeds)

    # After the mistakes: these take seconds.
    from robocasa_lerobot.data.registry.registry import open_registry
    from robocasa_lerobot.jobs.workers import cores_here
    from robocasa_lerobot.making.needs import parse_episodes
    from robocasa_lerobot.study.check import check_study
    from robocasa_lerobot.study.costs import cost_lines, costs
    from robocasa_lerobot.study.page import write_page
    from robocasa_lerobot.study.runs import CUDA, Run, configs_for, root_for, runs_of
    from robocasa_lerobot.study.sharing import alone, helped_by, shared_runs, threads_of_each, trainings_at_once
    from robocasa_lerobot.study.stored import check_results, is_stored, phases_left, read_stored, stands_for, store

    numbers = parse_episodes(args.episodes) if args.episodes else {}
    episodes = ",".join(f"{kind}={number}" for kind, number in sorted(numbers.items())) or None
    root = args.root or root_for(study, args.device, args.scale, episodes)
    results = args.results or root / "results"
    asked = (args.scale, episodes)
    configs = configs_for(args.device, study, root)
    sets = open_registry(str(configs / study.registry)).task_sets
    check_study(study, configs, sets)

    def at_once(runs: int) -> int:
        return trainings_at_once(args.at_once, runs, cores_here(), args.device == CUDA)

    if args.plan:
        runs, planned = {}, set[str]()
        for name, part in parts.items():
            own = [run for run in runs_of([part], root, configs, *asked) if run.name not in planned]
            planned |= {run.name for run in own}
            runs[name] = [run for run in own if not is_stored(run, results)]
        cores = args.workers or cores_here()
        beside = at_once(sum(map(len, runs.values())))
        left = {run: phases_left(run, results) for own in runs.values() for run in own}
        found = costs(study, runs, configs, cores, args.measure, beside, left)
        print("\n".join(cost_lines(parts, found, cores, args.device, beside)))
        return 0
    shown = study.shown_with(parts)
    whole = runs_of(list(shown.parts.values()), root, configs, *asked)

    def report() -> None:
        there = [(run, read_stored(results, run.experiment, run.seed)) for run in whole]
        stored = {(run.experiment, run.seed): one for run, one in there if one and stands_for(one.about, run)}
        write_page(shown, stored, sets, results, args.page or results / "results.md")

    if args.report and not results.is_dir():
        raise UserError(f"--report makes a page of what is in --results, and {results} is no folder.")
    wanted = [] if args.report else runs_of(list(parts.values()), root, configs, *asked)
    if wanted:
        check_results(whole, results)

    def ended(run: Run) -> bool:
        return is_stored(run, results)

    beside = at_once(sum(not ended(run) for run in wanted))
    threads = threads_of_each(beside, cores_here())
    with helped_by(beside - 1, [*_words(args), "--at_once=1"], root, threads):
        for run in shared_runs(wanted, ended, root):
            print(f"== {wanted.index(run) + 1} of {len(wanted)}: {run.name}", flush=True)
            phases = phases_left(run, results)
            for _ in run.carry_out(args.workers, threads, lambda: alone(root, "data"), phases):
                with alone(root, "page"):
                    print(f"kept: {store(run, results)}", flush=True)
                    report()
    with alone(root, "page"):  # the processes of a study end at about the same time
        report()
    print(f"written: {args.page or results / 'results.md'}")
    return 0


def _words(args: argparse.Namespace) -> list[str]:
    """The arguments of a process that takes part."""
    given = ("config_path", "seeds", "device", "workers", "scale", "episodes", "root", "results", "page")
    return [*args.parts, *(f"--{name}={value}" for name in given if (value := getattr(args, name)) is not None)]
