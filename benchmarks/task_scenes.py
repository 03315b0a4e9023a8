"""The kitchens of the 32 composite target tasks: resets with three pictures, and control steps beside robosuite's.

Each task in each split: a new scene with its first three pictures, then a window of stepping with them, in turns with a
window of robosuite 1.5.1's `PickPlace`, which has the same actions, pictures and loop (`peers/sim_loop.py`; what is the
same and what not: README, `sim_speed`). The first run makes robosuite's virtual environment.

    python benchmarks/task_scenes.py --quick
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import common
import numpy as np
from ours_tasks_sim import SPLITS, TASKS, reset_seed
from sim_speed import PEER_VERSIONS, check_peer, note_noise
from venvs import prepare_venv
from workers import Worker, WorkerError, run_together

from robocasa_lerobot import gl
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

BENCHMARKS = Path(__file__).parent
OUTPUT = common.RESULTS / "task_scenes.json"
OURS, PEER = "ours", "robosuite"
FIRST_SCENE = 100_400  # development seeds: nothing is solved here
RESETS, QUICK_RESETS = 4, 1  # of each task in each split
WINDOW_S, QUICK_WINDOW_S = 2.0, 1.0
AIMS = {"steps_three_cameras": 18.0, "reset_p99_s": 0.6}


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one reset of each task and short windows")
    parser.add_argument("--tasks", type=int, default=len(TASKS), help="only so many tasks, from the first on")
    parser.add_argument("--without-peer", action="store_true", help="ours alone: no ratios")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="JSON file to write")
    return parser.parse_args(arguments)


def measure(workers: dict[str, Worker], tasks: int, resets: int, window_s: float, noise: list[float]) -> dict[str, Any]:
    """Seconds of every reset, and steps per second of every window, by task and split."""
    rows: list[dict[str, Any]] = []
    steps: dict[str, list[float]] = {name: [0.0, 0.0] for name in workers}
    for number in Bar(range(len(SPLITS) * tasks), desc="tasks", unit="task"):
        split, task = divmod(number, tasks)
        seeds = [reset_seed(task, split, FIRST_SCENE + scene) for scene in range(resets)]
        seconds = [workers[OURS].ask("new_scene", seed=seed)["seconds"] for seed in seeds]
        row = {"task": TASKS[task], "split": SPLITS[split], "reset_s": [round(value, 4) for value in seconds]}
        order = list(workers) if number % 2 else list(reversed(workers))
        for name in order:
            note_noise(noise)
            (answer,) = run_together([workers[name]], window_s, seeds[0])
            steps[name][0] += answer["steps"]
            steps[name][1] += answer["seconds"]
            row[f"{name}_steps_per_s"] = round(answer["steps"] / answer["seconds"], 2)
        rows.append(row)
    every = [value for row in rows for value in row["reset_s"]]
    rates = {name: count / seconds for name, (count, seconds) in steps.items()}
    return {
        "ratios": {"steps_three_cameras": rates[OURS] / rates[PEER]} if PEER in rates else {},
        "steps_per_second": {name: round(rate, 2) for name, rate in rates.items()},
        "reset_s": {
            "count": len(every),
            "median": statistics.median(every),
            "p99": float(np.percentile(every, 99)),
            "max": max(every),
        },
        "slowest": [
            {"task": row["task"], "split": row["split"], "steps_per_s": row[f"{OURS}_steps_per_s"]}
            for row in sorted(rows, key=lambda row: row[f"{OURS}_steps_per_s"])[:5]
        ],
        "tasks": rows,
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    noise: list[float] = []
    try:
        backend = gl.ensure_gl()
        programs = {OURS: (Path(sys.executable), BENCHMARKS / "ours_tasks_sim.py")}
        if not options.without_peer:
            programs[PEER] = (prepare_venv("robosuite"), BENCHMARKS / "peers" / "robosuite_sim.py")
        workers: dict[str, Worker] = {}
        said: dict[str, dict[str, Any]] = {}
        try:
            for name, (python, program) in programs.items():
                workers[name] = Worker(name, python, program)
                said[name] = {"three_cameras": workers[name].ask("make", cameras=True, seed=0)}
            check_peer(said)
            resets, window_s = (QUICK_RESETS, QUICK_WINDOW_S) if options.quick else (RESETS, WINDOW_S)
            body = measure(workers, min(options.tasks, len(TASKS)), resets, window_s, noise)
        finally:
            for worker in workers.values():
                worker.close()
    except (UserError, WorkerError) as error:
        print(f"task_scenes: {error}", file=sys.stderr)
        return 2
    renderer = common.renderers(backend)
    body = {
        "machine": {**common.machine(), "renderer": renderer},
        "versions": {**common.versions("mujoco", "numpy", "numba"), "peer": PEER_VERSIONS},
        "aims": AIMS,
        "others_share_of_cores": common.spread(noise) if noise else None,
        **body,
    }
    common.write_result(options.out, "task_scenes", body)
    rows = [[name, f"{rate:.1f}"] for name, rate in body["steps_per_second"].items()]
    print(common.table(["control steps/s, three cameras", ""], rows))
    print({**body["ratios"], **body["reset_s"]})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
