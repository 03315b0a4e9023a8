"""`robocasa-lerobot inspect`: what a demonstration file or a dataset holds, and a draft mapping for unknown layouts."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.files import write_text

EXAMPLE = "robocasa-lerobot inspect demos.hdf5 --draft-mapping mapping.yaml"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument("paths", nargs="+", type=Path, metavar="FILE", help="HDF5 files, folders of them, or datasets")
    parser.add_argument(
        "--draft-mapping",
        type=Path,
        metavar="YAML",
        help="write a draft of a mapping file for the (one) HDF5 file; must not exist yet",
    )
    parser.add_argument("--report", choices=("table", "json"), default="table", help="default: %(default)s")


def run(args: argparse.Namespace) -> int:
    """Print what each file or dataset holds; write the draft where asked."""
    from robocasa_lerobot.convert.inspect.dataset import describe_dataset, inspect_dataset
    from robocasa_lerobot.convert.inspect.draft import draft_mapping
    from robocasa_lerobot.convert.inspect.hdf5 import describe, inspect_hdf5
    from robocasa_lerobot.convert.reading.inputs import demo_files, is_dataset

    args.paths = demo_files(args.paths)
    if args.draft_mapping is not None:
        if len(args.paths) > 1 or is_dataset(args.paths[0]):
            raise UserError("--draft-mapping takes one HDF5 file; datasets need no mapping.")
        if args.draft_mapping.exists():
            raise UserError(f"{args.draft_mapping} exists already: choose another name for the draft.")
        args.draft_mapping.parent.mkdir(parents=True, exist_ok=True)
    found = []
    for path in args.paths:
        if is_dataset(path):
            dataset = inspect_dataset(path)
            found.append(dataset)
            text = describe_dataset(dataset)
        else:
            report = inspect_hdf5(path)
            found.append(report.as_json())
            text = describe(report)
            if args.draft_mapping is not None:
                write_text(args.draft_mapping, draft_mapping(report))
        if args.report == "table":
            print(text, end="\n\n" if path != args.paths[-1] else "\n")
    if args.report == "json":
        print(json.dumps(found, indent=2, ensure_ascii=False, default=str))
    elif args.draft_mapping is not None:
        file = shlex.quote(str(args.paths[0]))
        print(f"draft: {args.draft_mapping}; check it, then: robocasa-lerobot convert {file} --mapping ...")
    return 0
