"""`robocasa-lerobot tasks`: list the tasks, describe and draw them, and check that they are sound."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from robocasa_lerobot.jobs.workers import cores_here

if TYPE_CHECKING:
    from robocasa_lerobot.envs.tasks.task import Task

EXAMPLE = (
    "robocasa-lerobot tasks --set atomic_seen --skill doors\n  robocasa-lerobot tasks OpenDrawer --pictures drawer.png"
)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("names", nargs="*", help="tasks or sets (default: all); a single task is described")
    group = parser.add_argument_group("filters")
    group.add_argument("--set", dest="task_set", help="only the tasks of a set, e.g. atomic_seen")
    group.add_argument("--skill", help="only tasks with a stage of a skill, e.g. doors")
    group.add_argument("--fixture", help="only tasks with a kind of fixture, e.g. drawer_top, or part of its name")
    shown = group.add_mutually_exclusive_group()
    shown.add_argument("--demonstrated", action="store_true", help="only tasks that a demonstrator can solve")
    shown.add_argument("--not-demonstrated", action="store_true", help="only tasks that none can solve")
    parser.add_argument("--describe", action="store_true", help="everything about each, as in docs/tasks.md")
    parser.add_argument("--pictures", type=Path, metavar="FILE", help="of one task: render its first and last state")
    parser.add_argument("--split", default="target", help="kitchens of --pictures (default target)")
    parser.add_argument("--seed", type=int, default=0, help="seed of --pictures (default 0)")
    parser.add_argument("--markdown", type=Path, metavar="FILE", help="write the page docs/tasks.md")
    parser.add_argument("--deviations", type=Path, metavar="FILE", help="write the page docs/deviations.md")
    parser.add_argument(
        "--check",
        action="store_true",
        help="in both splits, try each task and its demonstrator on several seeds",
    )
    parser.add_argument("--seeds", type=int, default=10, metavar="N", help="of --check, from 0 on (default 10)")
    parser.add_argument("--log", type=Path, metavar="FILE", help="of --check: keep what was found, and go on from it")
    parser.add_argument(
        "--workers", type=int, default=cores_here(), help="of --check and --deviations (default: all cores)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print a table or pages of tasks, or what the checker found; status 1 if a check failed."""
    from robocasa_lerobot.errors import UserError
    from robocasa_lerobot.files import write_text
    from robocasa_lerobot.gallery.task_pages import page, pages

    tasks = _chosen(args)
    if args.check:
        if args.seeds < 1:
            raise UserError(f"--seeds {args.seeds}: --check needs at least one seed.")
        return _check(tasks, range(args.seeds), args.workers, args.log)
    asked = [name for name in ("markdown", "deviations", "pictures") if getattr(args, name)]
    if len(asked) > 1:
        raise UserError(f"{' and '.join(f'--{name}' for name in asked)}: give one of them at a time.")
    if page_file := args.markdown or args.deviations:
        page_file.parent.mkdir(parents=True, exist_ok=True)  # before the work, not after it
    if args.markdown:
        write_text(args.markdown, pages(tasks))
        print(f"{args.markdown}: {len(tasks)} tasks")
        return 0
    if args.deviations:
        from robocasa_lerobot.gallery.deviations import deviations

        write_text(args.deviations, deviations(tasks, args.workers))
        print(f"{args.deviations}: {len(tasks)} tasks")
        return 0
    if args.pictures:
        from robocasa_lerobot.gallery.task_pictures import render_states

        if len(tasks) != 1:
            raise UserError(f"--pictures is of one task; {len(tasks)} were asked for: name one.")
        said = render_states(tasks[0].name, args.pictures, split=args.split, seed=args.seed)
        print(f"{args.pictures}: {tasks[0].name}, {said}")
        return 0
    if args.json:
        print(json.dumps([_facts(task) for task in tasks], indent=1))
    elif args.describe or (len(tasks) == 1 and args.names):
        for task in tasks:
            print("\n".join([f"{task.name}", "", *page(task), ""]))
    else:
        _table(tasks)
    return 0


def _chosen(args: argparse.Namespace) -> list[Task]:
    """The tasks that names and filters leave.

    Raises:
        UnknownNameError: no such task, set, skill or fixture.
        UserError: nothing is left.
    """
    from robocasa_lerobot.demos.choose import expand_names
    from robocasa_lerobot.demos.demonstrator import can_demonstrate
    from robocasa_lerobot.envs.tasks.registry import get_task, task_names, task_set
    from robocasa_lerobot.envs.tasks.typical import stages_of
    from robocasa_lerobot.errors import UnknownNameError, UserError

    tasks = [get_task(name) for name in (expand_names(",".join(args.names)) if args.names else task_names())]
    if args.task_set:
        members = task_set(args.task_set)
        tasks = [task for task in tasks if task.name in members]
    if args.skill:
        known = {stage.skill for name in task_names() for stage in stages_of(get_task(name))}
        if args.skill not in known:
            raise UnknownNameError("skill", args.skill, known)
        tasks = [task for task in tasks if args.skill in {stage.skill for stage in stages_of(task)}]
    if args.fixture:
        kinds = {fixture.kind for name in task_names() for fixture in get_task(name).fixtures}
        if not any(args.fixture in kind for kind in kinds):
            raise UnknownNameError("kind of fixture", args.fixture, kinds)
        tasks = [task for task in tasks if any(args.fixture in fixture.kind for fixture in task.fixtures)]
    if args.demonstrated or args.not_demonstrated:
        tasks = [task for task in tasks if can_demonstrate(task) == args.demonstrated]
    if not tasks:
        raise UserError("no task is left by these filters: leave one out.")
    return tasks


def _check(tasks: list[Task], seeds: range, workers: int, log: Path | None) -> int:
    from robocasa_lerobot.demos.task_check import check_all
    from robocasa_lerobot.envs.kitchens.splits import SPLITS
    from robocasa_lerobot.progress import Bar

    found = check_all([task.name for task in tasks], SPLITS, seeds, workers=workers, log=log)
    failures = 0
    with Bar(found, total=len(tasks) * len(SPLITS), unit="task", disable=None) as bar:
        for one in bar:
            failures += bool(one.faults)
            demonstrator = "no demonstrator" if one.solved is None else f"solved on seed {one.solved}"
            bar.write(f"{one.task}, {one.split}: {'; '.join(one.faults) if one.faults else f'ok, {demonstrator}'}")
    return 1 if failures else 0


def _facts(task: Task) -> dict[str, object]:
    from robocasa_lerobot.demos.demonstrator import can_demonstrate
    from robocasa_lerobot.envs.tasks.typical import stages_of

    return {
        "name": task.name,
        "kind": task.facts.kind,
        "horizon": task.horizon,
        "human_seconds": task.facts.human_seconds,
        "demonstrator": can_demonstrate(task),
        "skills": sorted({stage.skill for stage in stages_of(task)}),
        "fixtures": {fixture.role: fixture.kind for fixture in task.fixtures},
        "sets": sorted(task.facts.sets),
        "instruction": task.instruction,
        "paraphrases": task.paraphrases,
    }


def _table(tasks: list[Task]) -> None:
    from robocasa_lerobot.demos.demonstrator import can_demonstrate
    from robocasa_lerobot.envs.tasks.typical import stages_of

    width = max(len(task.name) for task in tasks)
    skills = {task.name: ", ".join(sorted({stage.skill for stage in stages_of(task)})) for task in tasks}
    wide = max(len("skill"), *map(len, skills.values()))
    print(f"{'task':<{width}}  {'kind':<9}  {'skill':<{wide}}  horizon  demonstrator  instruction")
    for task in tasks:
        able = "yes" if can_demonstrate(task) else "-"
        print(
            f"{task.name:<{width}}  {task.facts.kind:<9}  {skills[task.name]:<{wide}}  {task.horizon:>7}  {able:<12}  "
            f"{task.instruction}"
        )
        print(f"{'':<{width}}  {'':<9}  {'':<{wide}}  {'':>7}  {'':<12}  sets: {', '.join(sorted(task.facts.sets))}")
    able_count = sum(can_demonstrate(task) for task in tasks)
    print(f"{len(tasks)} tasks, {able_count} with a demonstrator")
