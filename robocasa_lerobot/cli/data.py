"""`robocasa-lerobot data`: which datasets an experiment needs, which are missing, and making them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.parent import add_end_with_input, end_with_input

if TYPE_CHECKING:
    from robocasa_lerobot.making.needs import Need
    from robocasa_lerobot.making.pieces import Outcome

EXAMPLE = (
    "robocasa-lerobot data configs/experiments/small/foundation.yaml\n"
    "  robocasa-lerobot data configs/experiments/small/foundation.yaml --make --episodes human=2,mg=2,target=2\n"
    "  robocasa-lerobot data configs/experiments/robocasa365/foundation.yaml --convert datasets"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options; everything else on the command line is a dotted setting of the experiment, as in `train`."""
    from robocasa_lerobot.jobs.executors import add_options

    parser.add_argument(
        "experiment", nargs="?", metavar="EXPERIMENT", help="the experiment file, or its name in configs/experiments/"
    )
    does = parser.add_mutually_exclusive_group()
    does.add_argument("--make", action="store_true", help="record and convert what our demonstrators can make")
    does.add_argument(
        "--convert",
        type=Path,
        metavar="DOWNLOADS",
        help="convert the published (v2.1) datasets below a folder: those that the experiment lacks, or all",
    )
    does.add_argument("--check", action="store_true", help="list, and end with status 1 where something is missing")
    parser.add_argument(
        "--episodes",
        metavar="KIND=N,...",
        help="demonstrations of each task by kind of dataset, as in human=20,mg=40 (default: the registry's)",
    )
    parser.add_argument(
        "--replace", action="store_true", help="with --make: make those anew that have fewer demonstrations"
    )
    parser.add_argument(
        "--keep-recordings",
        action="store_true",
        help="with --make: keep the HDF5 files beside the datasets (`export` makes them again)",
    )
    parser.add_argument(
        "--to", type=Path, metavar="DIR", help="with --convert: folder for the results (default: beside each, with _v3)"
    )
    parser.add_argument("--scale", metavar="NAME", help="as in `train`: what the experiment needs at that scale")
    parser.add_argument("--workers", type=int, help="processes of this machine (default: all cores)")
    add_end_with_input(parser)
    add_options(parser)
    parser.set_defaults(takes_settings=True)


def run(args: argparse.Namespace) -> int:
    """List, make or convert; status 1 if `--check` finds something missing or something could not be made."""
    if args.end_with_input:
        end_with_input()
    from robocasa_lerobot.config_files import find_config
    from robocasa_lerobot.jobs.executors import execution_of
    from robocasa_lerobot.jobs.workers import cores_here
    from robocasa_lerobot.making.listing import listing
    from robocasa_lerobot.making.needs import needs_of, parse_episodes
    from robocasa_lerobot.training.config.experiment import load_experiment

    changes = getattr(args, "settings", ())
    if changes and args.experiment is None:
        raise UserError(f"unrecognized arguments: {' '.join(changes)} (settings are an experiment's; none is given).")
    if args.to is not None and args.convert is None:
        raise UserError("--to is for --convert.")
    if (args.replace or args.keep_recordings) and not args.make:
        raise UserError("--replace and --keep-recordings are for --make.")
    execution = execution_of(args)
    cores = args.workers or cores_here()
    needs: list[Need] | None = None
    if args.experiment is not None:
        episodes = parse_episodes(args.episodes) if args.episodes else {}
        experiment = load_experiment(find_config(args.experiment, "experiments"), changes, args.scale)
        needs, said = needs_of(experiment, episodes)
        asked = f" --episodes {args.episodes}" if args.episodes else ""
        same = "".join(f" {word}" for word in ([f"--scale {args.scale}"] if args.scale else []) + list(changes))
        print(listing(experiment.name, args.experiment, needs, said, cores, asked, same), flush=True)
    elif args.convert is None:
        raise UserError(
            "no experiment: `robocasa-lerobot data configs/experiments/small/foundation.yaml` lists its data."
        )
    if args.convert is not None:
        from robocasa_lerobot.making.downloads import convert_downloads, find_downloads

        downloads = find_downloads(args.convert, args.to, needs)
        print(f"{len(downloads)} dataset(s) below {args.convert} to convert", flush=True)
        return _said(convert_downloads(downloads, execution, cores)) if downloads else 0
    if args.make:
        from robocasa_lerobot.making.make import make_datasets, pieces_of

        pieces = pieces_of(needs or [], args.replace, args.keep_recordings)
        for need in [piece.need for piece in pieces if piece.need.waits]:
            print(f"{need.root} comes later: it corrects the policy of {need.policy}, which is not trained yet")
        pieces = [piece for piece in pieces if not piece.need.waits]
        others = [need for need in needs or [] if need.missing and need.made is None]
        status = _said(make_datasets(pieces, execution, cores)) if pieces else 0
        if others:
            print(f"{len(others)} missing dataset(s) are none that can be made here: how to get them is listed above")
        return 1 if others else status
    return int(args.check and any(need.missing for need in needs or []))


def _said(outcome: Outcome) -> int:
    from robocasa_lerobot.making.pieces import outcome_lines

    for line in outcome_lines(outcome):
        print(line)
    if not outcome.submitted and not outcome.failed:
        print("done: all of it is there")
    return int(bool(outcome.failed))
