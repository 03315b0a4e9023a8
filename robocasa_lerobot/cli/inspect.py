"""`robocasa-lerobot inspect`: what a demonstration file, a dataset or a registry of datasets holds."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from robocasa_lerobot.convert.inspect import show as files
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.workers import cores_here

EXAMPLE = (
    f"{files.EXAMPLE}\n  robocasa-lerobot inspect configs/experiments/parts/kitchens.yaml --out outputs/data.html\n  "
    "robocasa-lerobot inspect generated/ --worth --beside demos/ --out worth.html"
)
PUBLISHED = "robocasa365"
_REGISTRIES = (".yaml", ".yml")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    files.configure(parser)
    parser.add_argument(
        "--out",
        "-o",
        type=Path,
        metavar="HTML",
        help=f"of a registry (a YAML file, or {PUBLISHED}): also write its table of data and two figures as a page; "
        "of --worth: its tables",
    )
    parser.add_argument(
        "--worth",
        action="store_true",
        help="of demonstrations recorded or generated here: which starts they cover, how they differ, how they move",
    )
    parser.add_argument("--beside", type=Path, metavar="DIR", help="of --worth: others of the same tasks, to compare")
    parser.add_argument("--workers", type=int, default=cores_here(), help="of --worth: processes (default: all cores)")


def run(args: argparse.Namespace) -> int:
    """Print what each file or dataset holds, or what data a registry has."""
    if args.worth:
        return _worth(args)
    if args.beside is not None:
        raise UserError("--beside compares what --worth measures: give both.")
    registries = [path for path in args.paths if _is_registry(path)]
    if not registries:
        if args.out is not None:
            raise UserError("--out writes the page of a registry (name its YAML file, or robocasa365), or of --worth.")
        return files.run(args)
    if len(args.paths) > 1 or args.draft_mapping is not None:
        raise UserError("a registry is inspected by itself: leave the other paths and --draft-mapping out.")
    return _inspect_registry(str(registries[0]), args.report, args.out)


def _worth(args: argparse.Namespace) -> int:
    from robocasa_lerobot.demos.quality.summary import attempts_in, look_at, qualities
    from robocasa_lerobot.evaluation.inventory import worth
    from robocasa_lerobot.evaluation.report.formats.render import check_ending, write_page
    from robocasa_lerobot.progress import Bar

    if args.out is not None:
        check_ending(args.out)  # before the work, not after it
    sets = {" ".join(map(str, args.paths)): args.paths} | ({str(args.beside): [args.beside]} if args.beside else {})
    found = {}
    for name, paths in sets.items():
        jobs = attempts_in(paths)
        found[name] = qualities(Bar(look_at(jobs, args.workers), total=len(jobs), desc=name, unit="attempt"))
    if args.report == "json":
        print(json.dumps({name: [one.as_json() for one in rows] for name, rows in found.items()}, indent=2))
    else:
        print(worth.text(found))
    if args.out is not None:
        write_page(worth.page(found), args.out)
        if args.report == "table":
            print(f"page: {args.out.resolve()}")
    return 0


def _is_registry(path: Path) -> bool:
    return path.suffix in _REGISTRIES or (str(path) == PUBLISHED and not path.exists())


def _inspect_registry(name: str, report: str, out: Path | None) -> int:
    from robocasa_lerobot.data.registry.registry import open_registry
    from robocasa_lerobot.evaluation.inventory import page as inventory_page
    from robocasa_lerobot.evaluation.inventory.inventory import take_inventory
    from robocasa_lerobot.evaluation.report.formats.render import write_page

    holdings = take_inventory(open_registry(name))
    if report == "json":
        print(json.dumps([holding.as_json() for holding in holdings], indent=2))
    else:
        print(inventory_page.text(name, holdings))
    if out is not None:
        write_page(inventory_page.page(name, holdings), out)
        if report == "table":
            print(f"page: {out.resolve()}")
    return 0
