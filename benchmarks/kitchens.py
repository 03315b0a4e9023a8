"""Every kitchen: 2,500 of the pretraining split and 10 of the target split, built, compiled, looked through, settled.

A kitchen is sound when it compiles, no two fixtures reach more than 2 mm into each other, everything that opens has a
metre free before it, and in a second nothing moves by more than 1 cm. The tasks that are registered take turns; one
that cannot be arranged in a kitchen is noted, and the next takes its place.

    python benchmarks/kitchens.py --workers 2

The sweep goes on where it was stopped; `--fresh` begins again. It notes wall and CPU time of each build; `--time`
measures them alone, on one process.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import common
import mujoco
import numpy as np

from robocasa_lerobot.envs.checks.soundness import MOVED_M, blocked_walkways, moved, overlaps
from robocasa_lerobot.envs.kitchens.materials import split_of
from robocasa_lerobot.envs.kitchens.splits import scene_ids, without
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.placement.at_rest import fell
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jsonl import read_whole_lines
from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "kitchens.json"
PARTS = common.REPOSITORY / "outputs" / "kitchens.jsonl"
MOST_TRIED = 8  # tasks in a kitchen until it counts as one in which nothing can be arranged
FALL_M = 0.02  # from where an object is put down, 4 mm above its surface, to where it rests


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--every", type=int, default=1, help="take every n-th kitchen of the pretraining split")
    parser.add_argument(
        "--limit", type=int, help="examine at most this many more, evenly spread; the result is of all that have been"
    )
    parser.add_argument("--fresh", action="store_true", help="forget what an earlier sweep has found")
    parser.add_argument("--time", type=int, default=0, metavar="N", help="time N builds on one process, nothing else")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    options = parser.parse_args(arguments)
    if not options.time:
        common.keep_samples_apart(parser, options.every, options.out, OUTPUT)
    return options


def examine(pair: tuple[int, int]) -> dict[str, Any]:
    """Everything about one kitchen."""
    layout_id, style_id = pair
    split, seed = split_of(layout_id), 100 * layout_id + style_id
    found: dict[str, Any] = {"layout": layout_id, "style": style_id, "split": split, "refused": {}}
    for task in _takers(pair):
        found["task"] = task.name
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            scene = build_scene(task, split, seed, kitchens=[pair])
        except UserError as error:  # an episode would take another kitchen
            found["refused"][task.name] = str(error)
            continue
        found["build_s"] = round(time.perf_counter() - wall, 4)
        found["build_cpu_s"] = round(time.process_time() - cpu, 4)
        break
    else:
        return found | {"error": "no task can be arranged"}
    model = scene.model
    plain = mujoco.MjData(model)
    mujoco.mj_kinematics(model, plain)
    mujoco.mj_comPos(model, plain)
    found["overlaps"] = [[o.first, o.second, o.depth] for o in overlaps(model, plain, scene.fixtures)]
    found["blocked"] = blocked_walkways(scene.layout)
    found |= unrest(scene, seed)
    found |= {"geoms": model.ngeom, "dofs": model.nv, "triangles": int(model.mesh_facenum.sum())}
    return found


def unrest(scene: Scene, seed: int) -> dict[str, dict[str, float]]:
    """What fell by more than 2 cm while an episode's first state settled, and what moves after that, metres by name."""
    data, _ = scene.initial_data(np.random.default_rng(seed))
    return {
        "fell": {name: round(by, 4) for name, by in fell(scene, data).items() if by > FALL_M},
        "moved": {name: round(by, 4) for name, by in moved(scene, data).items() if by > MOVED_M},
    }


def _takers(pair: tuple[int, int]) -> list[Task]:
    """Tasks that may be tried in a kitchen, the one whose turn it is first: those whose needs it meets."""
    names = task_names()
    first = (7 * pair[0] + pair[1]) % len(names)
    turns = [get_task(names[(first + turn) % len(names)]) for turn in range(len(names))]
    suited = []
    for task in turns:
        with contextlib.suppress(UserError):
            without([pair], task.needs, task.exclude_styles)
            suited.append(task)
    return suited[:MOST_TRIED]


def is_sound(row: dict[str, Any]) -> bool:
    """Nothing was found."""
    return not any(row.get(key) for key in ("error", "overlaps", "blocked", "fell", "moved"))


def sweep(pairs: list[tuple[int, int]], workers: int, limit: int | None) -> list[dict[str, Any]]:
    """Examine the kitchens that have not been, and return the rows of all that have."""
    rows = {(row["layout"], row["style"]): row for row in read_whole_lines(PARTS)}
    mixed = [pairs[index] for index in np.random.default_rng(0).permutation(len(pairs))]
    todo = [pair for pair in mixed if pair not in rows][:limit]
    PARTS.parent.mkdir(parents=True, exist_ok=True)
    with PARTS.open("a", encoding="utf-8") as file:
        for row in Bar(_work(todo, workers), total=len(todo), unit="kitchen", smoothing=0):
            file.write(json.dumps(row) + "\n")
            file.flush()
            rows[row["layout"], row["style"]] = row
    return [rows[pair] for pair in pairs if pair in rows]


def _work(pairs: list[tuple[int, int]], workers: int) -> Iterator[dict[str, Any]]:
    if workers == 1:
        yield from map(examine, pairs)
        return
    with multiprocessing.get_context("forkserver").Pool(workers) as pool:
        yield from pool.imap_unordered(examine, pairs, chunksize=4)


def timings(count: int) -> dict[str, Any]:
    """Seconds of building and compiling `count` pretraining kitchens, each pair of files read for the first time."""
    pairs = scene_ids("pretrain")
    chosen = [pairs[index] for index in np.random.default_rng(0).permutation(len(pairs))[:count]]
    task = get_task(task_names()[-1])
    rows = []
    for pair in Bar(chosen, unit="kitchen"):
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            build_scene(task, "pretrain", 1, kitchens=[pair])
        except UserError:
            continue  # counted by the sweep
        rows.append({"build_s": time.perf_counter() - wall, "build_cpu_s": time.process_time() - cpu})
    return {**build_seconds(rows), "others_share_of_cores": common.busy_share()}


def build_seconds(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Wall and CPU seconds of building and compiling; the CPU's are the process's own, whatever else runs beside it."""
    seconds = {"wall": [r["build_s"] for r in rows if "build_s" in r]}
    seconds["cpu"] = [r["build_cpu_s"] for r in rows if "build_cpu_s" in r]
    return {"builds": len(seconds["cpu"])} | {
        kind: {
            "median": round(statistics.median(values), 4),
            "p99": round(float(np.percentile(values, 99)), 4),
            "max": round(max(values), 4),
        }
        for kind, values in seconds.items()
        if values
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts by split, and the rows in which something was found."""
    body: dict[str, Any] = {}
    for split in ("target", "pretrain"):
        of_split = [row for row in rows if row["split"] == split]
        if of_split:
            body[split] = {
                "kitchens": len(of_split),
                "sound": sum(map(is_sound, of_split)),
                **{
                    key: sum(bool(row.get(key)) for row in of_split)
                    for key in ("error", "overlaps", "blocked", "fell", "moved")
                },
                "tasks_refused": sum(len(row.get("refused", {})) for row in of_split),
                "build_seconds": build_seconds(of_split),
                "geoms_median": statistics.median(row["geoms"] for row in of_split if "geoms" in row),
                "dofs_median": statistics.median(row["dofs"] for row in of_split if "dofs" in row),
            }
    return body


def main(arguments: Sequence[str] | None = None) -> int:
    """Sweep, print, write."""
    options = parse(arguments)
    before = json.loads(options.out.read_text(encoding="utf-8")) if options.out.exists() else {}
    body = {key: before[key] for key in ("splits", "unsound", "refused", "build_seconds") if key in before}
    if options.time:
        body["build_seconds"] = timings(options.time)
        print(json.dumps(body["build_seconds"], indent=1))
    else:
        if options.fresh:
            PARTS.unlink(missing_ok=True)
        pairs = scene_ids("target") + scene_ids("pretrain")[:: options.every]
        rows = sweep(pairs, options.workers, options.limit)
        body |= {"splits": summary(rows), "unsound": [row for row in rows if not is_sound(row)]}
        body["refused"] = [
            {"layout": row["layout"], "style": row["style"], "task": task, "why": why}
            for row in rows
            for task, why in row.get("refused", {}).items()
        ]
        print(json.dumps(body["splits"], indent=1))
    sound = body.get("splits", {})
    body["ratios"] = {f"sound_{split}": round(s["sound"] / s["kitchens"], 5) for split, s in sound.items()}
    body |= {"machine": common.machine(), "versions": common.versions("robocasa-lerobot", "mujoco", "numpy")}
    common.write_result(options.out, "kitchens", body)
    return 0 if all(s["sound"] == s["kitchens"] for s in sound.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
