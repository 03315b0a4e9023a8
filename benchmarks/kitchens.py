"""Every kitchen: 2,500 of the pretraining split and 10 of the target split, built, compiled, looked through, settled.

A kitchen is sound when it compiles, no two fixtures reach more than 2 mm into each other, everything that opens has a
metre free before it, and in a second nothing moves by more than 1 cm. The tasks that are registered take turns.

    python benchmarks/kitchens.py --workers 2

The sweep goes on where it was stopped; `--fresh` begins again. Times of building are measured with `--time` alone, on
one process with nothing else on the machine.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import common
import mujoco
import numpy as np
from tqdm import tqdm

from robocasa_lerobot.envs.registry import get_task, task_names
from robocasa_lerobot.envs.scene.builder import build_scene
from robocasa_lerobot.envs.scene.kitchens import scene_ids
from robocasa_lerobot.envs.scene.layout import split_of
from robocasa_lerobot.envs.scene.soundness import MOVED_M, blocked_walkways, fell, moved, overlaps
from robocasa_lerobot.errors import UserError

OUTPUT = common.RESULTS / "kitchens.json"
PARTS = common.REPOSITORY / "outputs" / "kitchens.jsonl"
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
    return parser.parse_args(arguments)


def examine(pair: tuple[int, int]) -> dict[str, Any]:
    """Everything about one kitchen."""
    layout_id, style_id = pair
    split = split_of(layout_id)
    tasks = task_names()
    task = get_task(tasks[(7 * layout_id + style_id) % len(tasks)])
    found: dict[str, Any] = {"layout": layout_id, "style": style_id, "split": split, "task": task.name}
    seed = 100 * layout_id + style_id
    started = time.perf_counter()
    try:
        scene = build_scene(task, split, seed, kitchens=[pair])
    except UserError as error:
        return found | {"error": str(error)}
    found["build_s"] = round(time.perf_counter() - started, 4)
    model = scene.model
    plain = mujoco.MjData(model)
    mujoco.mj_kinematics(model, plain)
    mujoco.mj_comPos(model, plain)
    found["overlaps"] = [[o.first, o.second, o.depth] for o in overlaps(model, plain, scene.fixtures)]
    found["blocked"] = blocked_walkways(scene.layout)
    data, _ = scene.initial_data(np.random.default_rng(seed))
    found["fell"] = {name: round(by, 4) for name, by in fell(scene, data).items() if by > FALL_M}
    found["moved"] = {name: round(by, 4) for name, by in moved(scene, data).items() if by > MOVED_M}
    found |= {"geoms": model.ngeom, "dofs": model.nv, "triangles": int(model.mesh_facenum.sum())}
    return found


def is_sound(row: dict[str, Any]) -> bool:
    """Nothing was found."""
    return not any(row.get(key) for key in ("error", "overlaps", "blocked", "fell", "moved"))


def sweep(pairs: list[tuple[int, int]], workers: int, limit: int | None) -> list[dict[str, Any]]:
    """Examine the kitchens that have not been, and return the rows of all that have."""
    rows = {(row["layout"], row["style"]): row for row in _read()}
    mixed = [pairs[index] for index in np.random.default_rng(0).permutation(len(pairs))]
    todo = [pair for pair in mixed if pair not in rows][:limit]
    PARTS.parent.mkdir(parents=True, exist_ok=True)
    with PARTS.open("a", encoding="utf-8") as file:
        for row in tqdm(_work(todo, workers), total=len(todo), unit="kitchen", smoothing=0):
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


def _read() -> list[dict[str, Any]]:
    if not PARTS.exists():
        return []
    lines = PARTS.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]  # the last one may be cut off


def timings(count: int) -> dict[str, Any]:
    """Seconds of building and compiling `count` pretraining kitchens, each pair of files read for the first time."""
    pairs = scene_ids("pretrain")
    chosen = [pairs[index] for index in np.random.default_rng(0).permutation(len(pairs))[:count]]
    task = get_task(task_names()[-1])
    seconds = []
    for pair in tqdm(chosen, unit="kitchen"):
        started = time.perf_counter()
        try:
            build_scene(task, "pretrain", 1, kitchens=[pair])
        except UserError:
            continue  # counted by the sweep
        seconds.append(time.perf_counter() - started)
    return {
        "builds": len(seconds),
        "median": round(statistics.median(seconds), 4),
        "p99": round(float(np.percentile(seconds, 99)), 4),
        "max": round(max(seconds), 4),
        "others_share_of_cores": common.busy_share(),
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
                "geoms_median": statistics.median(row["geoms"] for row in of_split if "geoms" in row),
                "dofs_median": statistics.median(row["dofs"] for row in of_split if "dofs" in row),
            }
    return body


def main(arguments: Sequence[str] | None = None) -> int:
    """Sweep, print, write."""
    options = parse(arguments)
    before = json.loads(OUTPUT.read_text(encoding="utf-8")) if OUTPUT.exists() else {}
    body = {key: before[key] for key in ("splits", "unsound", "build_seconds") if key in before}
    if options.time:
        body["build_seconds"] = timings(options.time)
        print(json.dumps(body["build_seconds"], indent=1))
    else:
        if options.fresh:
            PARTS.unlink(missing_ok=True)
        pairs = scene_ids("target") + scene_ids("pretrain")[:: options.every]
        rows = sweep(pairs, options.workers, options.limit)
        body |= {"splits": summary(rows), "unsound": [row for row in rows if not is_sound(row)]}
        print(json.dumps(body["splits"], indent=1))
    sound = body.get("splits", {})
    body["ratios"] = {f"sound_{split}": round(s["sound"] / s["kitchens"], 5) for split, s in sound.items()}
    body |= {"machine": common.machine(), "versions": common.versions("robocasa-lerobot", "mujoco", "numpy")}
    common.write_result(OUTPUT, "kitchens", body)
    return 0 if all(s["sound"] == s["kitchens"] for s in sound.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
