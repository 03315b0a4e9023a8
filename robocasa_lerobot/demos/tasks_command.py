"""`robocasa-lerobot tasks`: list the tasks, what they need and who can demonstrate them; check that they are sound."""

from __future__ import annotations

import argparse
import json

EXAMPLE = "robocasa-lerobot tasks --set atomic_seen"


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument("names", nargs="*", help="tasks to list (default: all)")
    parser.add_argument("--set", dest="task_set", help="only the tasks of a set, e.g. atomic_seen")
    parser.add_argument("--check", action="store_true", help="reset and step each on 10 seeds and report what is wrong")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Print a table of tasks, or of what the checker found; status 1 if a check failed."""
    from robocasa_lerobot.demos.demonstrator import can_demonstrate
    from robocasa_lerobot.envs.registry import get_task, task_names, task_set

    names = args.names or (task_set(args.task_set) if args.task_set else task_names())
    tasks = [get_task(name) for name in names]
    if args.check:
        from robocasa_lerobot.envs.check import check_task

        failures = 0
        for task in tasks:
            faults = check_task(task.name)
            failures += bool(faults)
            print(f"{task.name}: {'; '.join(faults) if faults else 'ok'}")
        return 1 if failures else 0
    if args.json:
        print(
            json.dumps(
                [
                    {
                        "name": t.name,
                        "kind": t.kind,
                        "horizon": t.horizon,
                        "demonstrator": can_demonstrate(t),
                        "sets": t.sets,
                        "instruction": t.instruction,
                    }
                    for t in tasks
                ],
                indent=1,
            )
        )
        return 0
    width = max(len(t.name) for t in tasks)
    print(f"{'task':<{width}}  {'kind':<9}  horizon  demonstrator  instruction")
    for task in tasks:
        able = "yes" if can_demonstrate(task) else "-"
        print(f"{task.name:<{width}}  {task.kind:<9}  {task.horizon:>7}  {able:<12}  {task.instruction}")
        print(f"{'':<{width}}  {'':<9}  {'':>7}  {'':<12}  sets: {', '.join(task.sets)}")
    return 0
