"""`robocasa-lerobot gallery`: pages and pictures of tasks, layouts, styles, appliances and objects."""

from __future__ import annotations

import argparse
from pathlib import Path

from robocasa_lerobot.contract import LARGEST_IMAGE_SIZE
from robocasa_lerobot.jobs.workers import cores_here

EXAMPLE = (
    "robocasa-lerobot gallery --show tasks --out gallery/ "
    "--rates benchmarks/results/demonstrators.json,benchmarks/results/demonstrators_300.json\n  "
    "robocasa-lerobot gallery --tasks OpenDrawer --seeds 0,1 --preset quality --out gallery/\n"
    "  robocasa-lerobot gallery --show layouts,styles,appliances,objects --split target --out gallery/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "--show",
        default="starts",
        help="what, separated by commas: starts (default: two pictures of each task and seed), tasks (a page to browse "
        "them all, tasks.html), layouts, styles, appliances, objects (contact sheets and a page, gallery.html), or all",
    )
    parser.add_argument("--tasks", help="task names separated by commas (default: all)")
    parser.add_argument(
        "--seeds", default="0", help="seeds separated by commas (default 0); the page of tasks begins with the first"
    )
    parser.add_argument("--split", help="target or pretrain (default: target for tasks, else both)")
    parser.add_argument("--category", help="plans, fixture types, object categories or groups, separated by commas")
    parser.add_argument(
        "--rates",
        help="of the page of tasks: results of benchmarks/demonstrators.py, separated by commas; of a task that is in "
        "several the last one counts",
    )
    parser.add_argument(
        "--workers", type=int, default=cores_here(), help="of the page of tasks: processes (default: all cores)"
    )
    parser.add_argument("--preset", default="fast", help="render preset of starts: fast or quality (default fast)")
    parser.add_argument("--image-size", type=int, default=256, help="height and width of camera pictures (default 256)")
    parser.add_argument(
        "--overview-size", default="1280x720", help="of the view of the whole kitchen (default %(default)s)"
    )
    parser.add_argument(
        "--format", choices=["png", "jpg"], default="png", help="of the pictures of starts (default png)"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")


def run(args: argparse.Namespace) -> int:
    """Write what is asked for: pictures of starts, the page of tasks, contact sheets and a page of everything else."""
    from robocasa_lerobot.errors import UnknownNameError, UserError
    from robocasa_lerobot.gallery.sections import SECTIONS, check_categories

    known = ["starts", "tasks", *SECTIONS]
    shown = known if args.show == "all" else [name.strip() for name in args.show.split(",")]
    for name in shown:
        if name not in known:
            raise UnknownNameError("part of the gallery", name, [*known, "all"])
    sections = [name for name in shown if name in SECTIONS]
    categories = tuple(c.strip() for c in args.category.split(",")) if args.category else ()
    if categories and not sections:
        raise UserError(f"--category is of {', '.join(SECTIONS)}: ask for one of them with --show.")
    if args.tasks and sections == shown:
        raise UserError("--tasks is of starts and tasks: ask for one of them with --show.")
    check_categories(sections, categories)
    if "starts" in shown:
        _starts(args)
    if "tasks" in shown:
        _tasks(args)
    if sections:
        _sections(args, sections, categories)
    return 0


def _tasks(args: argparse.Namespace) -> None:
    """The page of all tasks. What a run that was stopped has made is kept beside it, and taken up."""
    from robocasa_lerobot.envs.tasks.registry import task_names
    from robocasa_lerobot.gallery.tasks.cards import cards, read_rates
    from robocasa_lerobot.gallery.tasks.page import entry, write_page
    from robocasa_lerobot.gallery.tasks.pictures import is_made, make, read
    from robocasa_lerobot.jobs.as_completed import as_they_end
    from robocasa_lerobot.progress import Bar

    rates = {
        name: rate
        for path in (args.rates or "").split(",")
        if path.strip()
        for name, rate in read_rates(Path(path.strip())).items()
    }
    names, (seed, *_), split = _names(args), _seeds(args), args.split or "target"
    folder = args.out / "tasks"
    todo = [(name, split, seed, folder) for name in names if not is_made(name, split, seed, folder)]
    bar = Bar(as_they_end(make, todo, args.workers), total=len(todo), desc="tasks", unit="task")
    for name in bar:
        bar.set_postfix(made=name)
    shown = {name: read(name, split, seed, folder) for name in task_names()}  # of all, also those that were made before
    page = write_page(args.out / "tasks.html", [entry(card, shown.get(card.name), folder) for card in cards(rates)])
    print(f"{page} ({page.stat().st_size / 1e6:.1f} MB)")


def _names(args: argparse.Namespace) -> list[str]:
    from robocasa_lerobot.demos.choose import expand_names
    from robocasa_lerobot.envs.tasks.registry import task_names

    return list(expand_names(args.tasks) if args.tasks else task_names())


def _seeds(args: argparse.Namespace) -> list[int]:
    from robocasa_lerobot.envs.seeds import SEEDS, checked_seed
    from robocasa_lerobot.errors import UserError

    try:
        return [checked_seed(int(s)) for s in args.seeds.split(",")]
    except ValueError:
        raise UserError(f"--seeds {args.seeds!r}: expected {SEEDS}, or several separated by commas.") from None


def _starts(args: argparse.Namespace) -> None:
    """For each task and seed, the three camera pictures side by side and a view of the kitchen."""
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.gallery.scene_pictures import render_task

    names, seeds = _names(args), _seeds(args)
    try:
        width, height = (int(s) for s in args.overview_size.split("x"))
    except ValueError:
        width = height = 0
    if not (1 <= width <= LARGEST_IMAGE_SIZE and 1 <= height <= LARGEST_IMAGE_SIZE):
        raise UserError(
            f"--overview-size {args.overview_size!r}: expected WIDTHxHEIGHT in pixels, {LARGEST_IMAGE_SIZE} at most."
        )
    for name in names:
        for seed in seeds:
            for path in render_task(
                name,
                seed,
                args.out,
                args.split or "target",
                args.preset,
                args.image_size,
                (height, width),
                args.format,
            ):
                print(path)


def _sections(args: argparse.Namespace, names: list[str], categories: tuple[str, ...]) -> None:
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.gallery.page import write_page
    from robocasa_lerobot.gallery.sections import SPLITS, Tile, tiles_of, write_sheets
    from robocasa_lerobot.progress import Bar

    splits = (args.split,) if args.split else SPLITS
    made: dict[str, list[Tile]] = {}
    for name in names:
        made[name] = list(Bar(tiles_of(name, splits, categories), desc=name, unit="picture"))
    if not any(made.values()):
        raise UserError(
            f"nothing in {', '.join(names)} is of category {args.category!r} and split {', '.join(splits)}."
        )
    for name, tiles in made.items():
        for path in write_sheets(name, tiles, args.out):
            print(path)
    print(write_page(args.out / "gallery.html", made))
