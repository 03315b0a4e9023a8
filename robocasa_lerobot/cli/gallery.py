"""`robocasa-lerobot gallery`: pictures of tasks, layouts, styles, appliances and objects."""

from __future__ import annotations

import argparse
from pathlib import Path

EXAMPLE = (
    "robocasa-lerobot gallery --tasks OpenDrawer --seeds 0,1 --preset quality --out gallery/\n"
    "  robocasa-lerobot gallery --show layouts,styles,appliances,objects --split target --out gallery/"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "--show",
        default="tasks",
        help="what, separated by commas: tasks (default), layouts, styles, appliances, objects, or all; everything but "
        "tasks as contact sheets and on one page, gallery.html",
    )
    parser.add_argument("--tasks", help="task names separated by commas (default: all)")
    parser.add_argument("--seeds", default="0", help="seeds separated by commas (default 0)")
    parser.add_argument("--split", help="target or pretrain (default: target for tasks, else both)")
    parser.add_argument("--category", help="plans, fixture types, object categories or groups, separated by commas")
    parser.add_argument("--preset", default="fast", help="render preset of tasks: fast or quality (default fast)")
    parser.add_argument("--image-size", type=int, default=256, help="height and width of camera pictures (default 256)")
    parser.add_argument("--overview-size", default="1280x720", help="size of the view of the whole kitchen")
    parser.add_argument("--format", choices=["png", "jpg"], default="png", help="of the tasks' pictures (default png)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")


def run(args: argparse.Namespace) -> int:
    """Write the pictures of tasks, and contact sheets and a page of everything else that is asked for."""
    from robocasa_lerobot.errors import UnknownNameError
    from robocasa_lerobot.gallery.sections import SECTIONS

    known = ["tasks", *SECTIONS]
    shown = known if args.show == "all" else [name.strip() for name in args.show.split(",")]
    for name in shown:
        if name not in known:
            raise UnknownNameError("part of the gallery", name, [*known, "all"])
    if "tasks" in shown:
        _tasks(args)
    sections = [name for name in shown if name != "tasks"]
    if sections:
        _sections(args, sections)
    return 0


def _tasks(args: argparse.Namespace) -> None:
    """For each task and seed, the three camera pictures side by side and a view of the kitchen."""
    from robocasa_lerobot.envs.tasks.registry import get_task, task_names
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.gallery.scene_pictures import render_task

    names = [n.strip() for n in args.tasks.split(",")] if args.tasks else list(task_names())
    try:
        seeds = [int(s) for s in args.seeds.split(",")]
        width, height = (int(s) for s in args.overview_size.split("x"))
    except ValueError:
        raise UserError(
            f"--seeds {args.seeds!r} must be numbers separated by commas, and --overview-size {args.overview_size!r} "
            "WIDTHxHEIGHT in pixels."
        ) from None
    for name in names:
        get_task(name)
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


def _sections(args: argparse.Namespace, names: list[str]) -> None:
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.gallery.page import write_page
    from robocasa_lerobot.gallery.sections import SPLITS, Tile, tiles_of, write_sheets
    from robocasa_lerobot.progress import Bar

    splits = (args.split,) if args.split else SPLITS
    categories = tuple(c.strip() for c in args.category.split(",")) if args.category else ()
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
