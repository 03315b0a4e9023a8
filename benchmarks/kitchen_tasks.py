"""Every kitchen with composite tasks: five drawn by seed in each of the 2,510, and every task in at least 25.

A task that cannot be arranged in a kitchen is noted, and the next that was drawn takes its place. Drawn are those that
few kitchens suit as often as the others. An arrangement is sound when no object falls while its first state settles,
nothing moves by more than 1 cm in the second after that, nothing reaches more than 6 mm into anything else, and the
robot touches nothing.

    python benchmarks/kitchen_tasks.py --workers 2

The sweep goes on where it was stopped; `--fresh` begins again, `--every 50 --out FILE` takes a sample.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import common
import numpy as np
from kitchens import unrest

from robocasa_lerobot.envs.kitchens.materials import split_of
from robocasa_lerobot.envs.kitchens.splits import scene_ids, without
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.placement.overlaps import robot_touches, sunk_in
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_whole_lines
from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "kitchen_tasks.json"
PARTS = common.REPOSITORY / "outputs" / "kitchen_tasks.jsonl"
IN_EACH, LEAST, MOST_TRIED = 5, 25, 15  # tasks in a kitchen, kitchens of a task, tasks tried in a kitchen
SEED = 20_260  # of what is drawn
FAULTS = ("error", "fell", "moved", "sunk", "blocked")
Pair = tuple[int, int]
Row = dict[str, Any]


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--every", type=int, default=1, help="take every n-th kitchen of the pretraining split")
    parser.add_argument("--fresh", action="store_true", help="forget what an earlier sweep has found")
    parser.add_argument("--parts", type=Path, default=PARTS, help="file of what has been looked at")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    options = parser.parse_args(arguments)
    common.keep_samples_apart(parser, options.every, options.out, OUTPUT)
    return options


def composites() -> list[str]:
    """Names of the composite tasks."""
    return [name for name in task_names() if get_task(name).facts.kind == "composite"]


def suited(pairs: Sequence[Pair], names: Sequence[str]) -> dict[Pair, list[str]]:
    """Of each kitchen, the tasks whose needs it meets."""
    found: dict[Pair, list[str]] = {pair: [] for pair in pairs}
    for name in names:
        task = get_task(name)
        with contextlib.suppress(UserError):
            for pair in without(list(pairs), task.needs, task.exclude_styles):
                found[pair].append(name)
    return found


def orders(tasks_of: dict[Pair, list[str]]) -> dict[Pair, list[str]]:
    """Of each kitchen, the tasks to be tried, in order: those that few kitchens suit come as often as the others."""
    common_ness = Counter(name for names in tasks_of.values() for name in names)
    found = {}
    for pair, names in tasks_of.items():
        rng = np.random.default_rng((SEED, *pair))
        waits = rng.exponential(size=len(names)) * np.array([common_ness[name] for name in names])
        found[pair] = [names[index] for index in np.argsort(waits)[:MOST_TRIED]]
    return found


def arrange(pair: Pair, name: str) -> Row:
    """One task in one kitchen: refused, or what is wrong with it."""
    split, seed = split_of(pair[0]), 100 * pair[0] + pair[1]
    row: Row = {"layout": pair[0], "style": pair[1], "split": split, "task": name}
    try:
        scene = build_scene(get_task(name), split, seed, kitchens=[pair])
    except UserError as error:  # an episode would take another kitchen
        return row | {"refused": str(error)}
    except Exception as error:
        return row | {"error": f"{type(error).__name__}: {error}"}
    data, _ = scene.initial_data(np.random.default_rng(seed))
    row["sunk"] = [[one, other, round(depth, 4)] for one, other, depth in sunk_in(scene.model, data)]
    row["blocked"] = robot_touches(scene, data)
    return row | unrest(scene, seed)


def fill(job: tuple[Pair, Sequence[str], int]) -> list[Row]:
    """Tasks in a kitchen, one after the other, until so many have been arranged."""
    pair, names, wanted = job
    rows: list[Row] = []
    for name in names:
        if sum("refused" not in row for row in rows) == wanted:
            break
        rows.append(arrange(pair, name))
    return rows


def begun(
    rows: Iterable[Row], pairs: Sequence[Pair], order: dict[Pair, list[str]]
) -> list[tuple[Pair, Sequence[str], int]]:
    """What is left of each kitchen's own tasks: a sweep may have been stopped in the midst of one."""
    arranged: Counter[Pair] = Counter()
    tried: dict[Pair, set[str]] = defaultdict(set)
    for row in rows:
        if not row.get("extra"):
            pair = (row["layout"], row["style"])
            arranged[pair] += "refused" not in row
            tried[pair].add(row["task"])
    left = {pair: [name for name in order[pair] if name not in tried[pair]] for pair in pairs}
    return [(pair, left[pair], IN_EACH - arranged[pair]) for pair in pairs if left[pair] and arranged[pair] < IN_EACH]


def missing(
    rows: Iterable[Row], tasks_of: dict[Pair, list[str]], least: int = LEAST
) -> list[tuple[Pair, Sequence[str], int]]:
    """Further kitchens for the tasks that were arranged in too few: as many as each lacks, drawn by seed."""
    arranged: Counter[str] = Counter()
    tried: dict[str, set[Pair]] = defaultdict(set)
    for row in rows:
        arranged[row["task"]] += "refused" not in row
        tried[row["task"]].add((row["layout"], row["style"]))
    jobs: list[tuple[Pair, Sequence[str], int]] = []
    for number, name in enumerate(sorted({name for names in tasks_of.values() for name in names})):
        left = [pair for pair, names in tasks_of.items() if name in names and pair not in tried[name]]
        mixed = np.random.default_rng((SEED, number, len(tried[name]))).permutation(len(left))
        jobs += [(left[index], (name,), 1) for index in mixed[: max(0, least - arranged[name])]]
    return jobs


def sweep(pairs: Sequence[Pair], names: Sequence[str], parts: Path, workers: int, least: int = LEAST) -> list[Row]:
    """Arrange what has not been, until every task has so many kitchens, and return the rows of all that have."""
    tasks_of = suited(pairs, names)
    rows = [
        row for row in read_whole_lines(parts) if (row["layout"], row["style"]) in tasks_of and row["task"] in names
    ]
    mixed = [pairs[index] for index in np.random.default_rng(0).permutation(len(pairs))]
    rows += _run(begun(rows, mixed, orders(tasks_of)), parts, workers, extra=False)
    while jobs := missing(rows, tasks_of, least):
        rows += _run(jobs, parts, workers, extra=True)
    return rows


def _run(jobs: list[tuple[Pair, Sequence[str], int]], parts: Path, workers: int, *, extra: bool) -> list[Row]:
    parts.parent.mkdir(parents=True, exist_ok=True)
    found: list[Row] = []
    with parts.open("a", encoding="utf-8") as file:
        for rows in Bar(_work(fill, jobs, workers), total=len(jobs), unit="kitchen", smoothing=0):
            rows = [row | {"extra": extra} for row in rows]
            file.write("".join(json.dumps(row) + "\n" for row in rows))
            file.flush()
            found += rows
    return found


def _work(function: Callable[[Any], list[Row]], jobs: list[Any], workers: int) -> Iterator[list[Row]]:
    if workers == 1 or len(jobs) < 2:
        yield from map(function, jobs)
        return
    with multiprocessing.get_context("forkserver").Pool(workers) as pool:
        yield from pool.imap_unordered(function, jobs, chunksize=2)


def is_sound(row: Row) -> bool:
    """Nothing was found."""
    return not any(row.get(fault) for fault in FAULTS)


def summary(rows: Sequence[Row], names: Sequence[str]) -> dict[str, Any]:
    """Of each task: kitchens tried, arranged and sound; and each arrangement that is not."""
    of_task: dict[str, list[Row]] = {name: [] for name in names}
    for row in rows:
        of_task[row["task"]].append(row)
    arranged = [row for row in rows if "refused" not in row]
    tasks = {
        name: {
            "tried": len(found),
            "arranged": sum("refused" not in row for row in found),
            "unsound": sum(not is_sound(row) for row in found),
        }
        for name, found in of_task.items()
    }
    sound = sum(map(is_sound, arranged))
    return {
        "kitchens": len({(row["layout"], row["style"]) for row in arranged}),
        "arrangements": len(arranged),
        "sound": sound,
        "faults": {fault: sum(bool(row.get(fault)) for row in arranged) for fault in FAULTS},
        "fewest_kitchens_of_a_task": min(task["arranged"] for task in tasks.values()),
        "tasks": tasks,
        "unsound": [row for row in arranged if not is_sound(row)],
        "ratios": {"sound": round(sound / max(1, len(arranged)), 5)},
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Sweep, print, write; status 1 where anything is unsound, or a task was arranged too rarely."""
    options = parse(arguments)
    if options.fresh:
        options.parts.unlink(missing_ok=True)
    pairs, names = scene_ids("target") + scene_ids("pretrain")[:: options.every], composites()
    least = LEAST if options.every == 1 else 0
    body = summary(sweep(pairs, names, options.parts, options.workers, least), names)
    body |= {"machine": common.machine(), "versions": common.versions("robocasa-lerobot", "mujoco", "numpy")}
    worst = sorted(body["tasks"].items(), key=lambda item: -item[1]["unsound"])[:20]
    print(json.dumps({key: value for key, value in body.items() if key not in ("tasks", "unsound")}, indent=1))
    print(
        "\n".join(f"{name}: {task['unsound']} of {task['arranged']} unsound" for name, task in worst if task["unsound"])
    )
    common.write_result(options.out, "kitchen_tasks", body)
    return 0 if body["sound"] == body["arrangements"] and body["fewest_kitchens_of_a_task"] >= least else 1


if __name__ == "__main__":
    sys.exit(main())
