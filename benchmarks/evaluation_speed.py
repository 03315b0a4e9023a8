"""Our evaluation beside `lerobot-eval`, in one run: trials per hour, and where the time goes.

The same policy, kitchens, tasks of different lengths and seeds, each side in a process of its own and in turn; whole
commands are timed, from their start to their end and but for our report, which LeRobot has none of, once with films
(LeRobot makes ten for each task, whatever one asks for) and once without.

    python benchmarks/evaluation_speed.py --quick
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import common
import evaluation_sides as sides
import training_sides

from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "evaluation_speed.json"
TASKS = ["CloseDrawer", "PickPlaceCounterToSink", "OpenDrawer"]  # 450, 600 and 750 steps
Sides = Sequence[tuple[str, bool]]
IMAGE_SIZES = {"demo": 96, "compact": 128}


@dataclass(frozen=True)
class Effort:
    """How much is measured: policies, trials of each task, runs of each side."""

    policies: tuple[str, ...]
    trials: int
    repetitions: int


FULL = Effort(("demo", "compact"), trials=6, repetitions=2)
QUICK = Effort(("demo",), trials=4, repetitions=1)


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one small policy, few trials: about 5 minutes")
    parser.add_argument("--without-films", action="store_true", help="leave out the runs with films")
    parser.add_argument("--workers", type=int, default=2, help="env processes on both sides (default 2)")
    parser.add_argument("--trials", type=int, help="trials of each task")
    parser.add_argument("--policies", nargs="+", choices=sorted(IMAGE_SIZES), help="presets in configs/policies")
    parser.add_argument(
        "--output", type=Path, default=OUTPUT, help=f"JSON file; default: {OUTPUT.relative_to(common.REPOSITORY)}"
    )
    return parser.parse_args(arguments)


def run_side(side: str, job: sides.Job, folder: Path) -> dict[str, Any]:
    """One whole command of a side, with its seconds."""
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    file = folder / "job.json"
    file.write_text(json.dumps(dataclasses.asdict(dataclasses.replace(job, out=str(out)))), encoding="utf-8")
    command = [sys.executable, str(Path(sides.__file__)), side, str(file)]
    started = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - started
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if done.returncode or not lines:
        raise SystemExit(f"{side} failed:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}")
    return {"seconds": seconds, **json.loads(lines[-1].removeprefix("RESULT "))}


def measure(
    policy: str, effort: Effort, workers: int, chosen: Sides, folder: Path, bar: Any, noise: list[float]
) -> dict[str, Any]:
    """All sides for one policy, in turn in every repetition."""
    size = IMAGE_SIZES[policy]
    checkpoint = sides.make_checkpoint(folder / policy, training_sides.policy_settings(policy), size)
    job = sides.Job(str(checkpoint), TASKS, effort.trials, workers, size, out="", films=False)
    runs: dict[str, list[dict[str, Any]]] = {name_of(*side): [] for side in chosen}
    for repetition in range(effort.repetitions):
        for side, films in chosen if repetition % 2 == 0 else chosen[::-1]:
            busy = common.busy_share()
            if busy is not None:
                noise.append(busy)
            result = run_side(side, dataclasses.replace(job, films=films), folder)
            runs[name_of(side, films)].append(result)
            bar.write(f"{policy}: {name_of(side, films)}: {result['seconds']:.0f} s", file=sys.stderr)
            bar.update()
    return {name: summary(found, effort.trials * len(TASKS)) for name, found in runs.items()}


def name_of(side: str, films: bool) -> str:
    """A side's key in the result."""
    return f"{side}, {'with' if films else 'without'} films"


def summary(runs: list[dict[str, Any]], trials: int) -> dict[str, Any]:
    """Trials per hour over the repetitions, with the last one's details."""
    rates = common.spread([3600.0 * trials / run["seconds"] for run in runs])
    return {"trials_per_hour": rates, "seconds": [run["seconds"] for run in runs], "last": runs[-1]}


def ratios(found: dict[str, dict[str, Any]]) -> dict[str, float]:
    """Our trials per hour over LeRobot's, by the medians."""
    out = {}
    for policy, sides_of in found.items():
        for films in (True, False):
            if name_of(sides.OURS, films) not in sides_of:
                continue
            ours, theirs = (
                sides_of[name_of(side, films)]["trials_per_hour"]["median"] for side in (sides.OURS, sides.LEROBOT)
            )
            out[f"{policy}, {'with' if films else 'without'} films"] = ours / theirs
    return out


def report(body: dict[str, Any]) -> str:
    """Tables for the terminal."""
    rows = []
    for policy, sides_of in body["policies"].items():
        for name, values in sides_of.items():
            split = ", ".join(f"{part} {100 * share:.0f} %" for part, share in values["last"]["split"].items())
            rows.append((f"{policy}: {name}", f"{values['trials_per_hour']['median']:.0f}", split))
    lines = [common.table(("side", "trials/hour", "share of time"), rows), ""]
    lines += [f"ours is {ratio:.2f} times LeRobot's: {name}" for name, ratio in body["ratios"].items()]
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    effort = QUICK if options.quick else FULL
    effort = dataclasses.replace(
        effort, trials=options.trials or effort.trials, policies=tuple(options.policies or effort.policies)
    )
    noise: list[float] = []
    chosen = tuple(side for side in sides.SIDES if not (options.without_films and side[1]))
    total = len(effort.policies) * effort.repetitions * len(chosen)
    with tempfile.TemporaryDirectory() as folder, Bar(total=total, unit="run", smoothing=0) as bar:
        found = {
            policy: measure(policy, effort, options.workers, chosen, Path(folder), bar, noise)
            for policy in effort.policies
        }
    body = {
        "mode": "quick" if options.quick else "full",
        "machine": common.machine(),
        "versions": common.versions("robocasa-lerobot", "lerobot", "mujoco", "torch"),
        "ratios": ratios(found),
        "tasks": TASKS,
        "effort": {**dataclasses.asdict(effort), "workers": options.workers},
        "policies": found,
        "others_share_of_cores": common.spread(noise) if noise else None,
    }
    print(report(body))
    common.write_result(options.output, "evaluation_speed", body)
    print(f"\nwritten: {options.output}")
    return 0


if __name__ == "__main__":
    os.environ.setdefault("HF_HUB_OFFLINE", "1")
    raise SystemExit(main())
