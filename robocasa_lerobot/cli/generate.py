"""`robocasa-lerobot generate`: demonstrations in new scenes out of prepared ones."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from robocasa_lerobot.cli.demos import add_kitchen_options, kitchen_values, record

EXAMPLE = (
    "robocasa-lerobot generate --source demos/ --tasks OpenDrawer --episodes 100 --split pretrain --seed 100000 "
    "--out generated/"
)

_OF_CONTACTS = ("base", "bridge", "select", "spread", "cap")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    from robocasa_lerobot.data.registry.recipes import METHODS
    from robocasa_lerobot.jobs.executors import add_options

    parser.add_argument(
        "--source", type=Path, required=True, help="prepared demonstrations (see `prepare`): a folder, or one file"
    )
    add_kitchen_options(parser)
    parser.add_argument(
        "--method",
        choices=METHODS,
        default=METHODS[0],
        help="contacts: they are carried over, and the rest is planned (default); mimicgen: whole subtasks, joined by "
        "lines, with a base at rest, as published; replay: the sources' own actions in their own scenes, with noise",
    )
    parser.add_argument(
        "--template", type=Path, metavar="JSON", help="of --method mimicgen: one of its templates (default: derived)"
    )
    contacts = parser.add_argument_group("of --method contacts")
    contacts.add_argument(
        "--base", choices=("replan", "copy", "fixed"), help="where the robot stands (default: replan)"
    )
    contacts.add_argument("--bridge", choices=("plan", "line"), help="how segments are joined (default: plan)")
    contacts.add_argument(
        "--select",
        choices=("feasible", "random", "nearest_object", "nearest_robot"),
        help="which source a segment is taken from (default: feasible)",
    )
    contacts.add_argument(
        "--spread",
        type=float,
        help="how evenly sources are used: cost that each has at random in an attempt (default: 0.3)",
    )
    contacts.add_argument(
        "--cap",
        type=float,
        metavar="SHARE",
        help="of the segments that one source should have at most; 1 takes whichever fits best (default: 0.2)",
    )
    parser.add_argument(
        "--first-sources",
        type=int,
        default=0,
        metavar="N",
        help="of each task take only the first N sources (default: all)",
    )
    parser.add_argument(
        "--rules", type=Path, metavar="YAML", help="how verbs are cut into segments, where that is not to be derived"
    )
    add_options(parser)


def run(args: argparse.Namespace) -> int:
    """Generate for every task and print a table; status 1 if one had to be given up."""
    from robocasa_lerobot.demos.choose import expand_names
    from robocasa_lerobot.demos.generate.mimicgen.template import read_json_template
    from robocasa_lerobot.demos.generate.settings import GenerationSettings
    from robocasa_lerobot.demos.generate.sources.rules import read_rules
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.jobs.executors import execution_of

    execution = execution_of(args)
    rules = json.dumps({verb: asdict(rule) for verb, rule in read_rules(args.rules).items()} if args.rules else {})
    if args.template and args.method != "mimicgen":
        raise UserError("--template says what MimicGen's subtasks are: give --method mimicgen too.")
    of_contacts = {name: value for name in _OF_CONTACTS if (value := getattr(args, name)) is not None}
    if of_contacts and args.method != "contacts":
        raise UserError(f"--{next(iter(of_contacts))} is of --method contacts; {args.method} has none to choose.")
    if args.rules and (args.template or args.method == "replay"):
        other = "--template says where subtasks end" if args.template else "--method replay cuts nothing"
        raise UserError(f"--rules are for what is cut into segments: {other}.")
    if args.out.resolve() == args.source.resolve():
        raise UserError(f"--out is the folder of the sources: {args.out}. Choose another one.")
    template = json.dumps(read_json_template(args.template)) if args.template else ""
    settings = [
        GenerationSettings.of(
            args.source,
            task=name,
            varied=False,
            method=args.method,
            template=template,
            first_sources=args.first_sources,
            rules=rules,
            **kitchen_values(args),
            **of_contacts,
        )
        for name in expand_names(args.tasks)
    ]
    return record(settings, args, execution)[0]
