"""Does the demo learn? `make demo` as it is for several seeds, then more trials of what it has trained.

Each seed has demonstrations, a training and trials of its own; no seed is left out. The demo itself shows few trials,
which say little; here are 40 of each policy on each task. Everything lies in `outputs/bench_demo/seed_<n>` and goes on
where it was stopped; `--fresh` begins again, which every change of kitchens, demonstrators, policies or training needs.

    python benchmarks/demo.py --seeds 3
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import common

from robocasa_lerobot.evaluation.statistics.rates import success_rate

OUTPUT = common.RESULTS / "demo.json"
WORK = common.REPOSITORY / "outputs" / "bench_demo"
SCRIPT = common.REPOSITORY / "scripts" / "demo.sh"
TASKS = ("OpenDrawer", "CloseDrawer")
CHECKPOINTS = {
    "untrained": "pretrain/checkpoints/000000",
    "pretrained": "pretrain/checkpoints/last",
    "finetuned": "finetune/checkpoints/last",
}
HORIZON = 250  # control steps; the demo's own
# What the demo should reach, in shares of trials.
AIMS = {("pretrained", "OpenDrawer"): 0.60, ("pretrained", "CloseDrawer"): 0.85}
_SEEDS_APART = 5000  # of trials: far from the demo's own


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="how many, from 0 on (default 3)")
    parser.add_argument("--trials", type=int, default=40, help="of each policy on each task and seed (default 40)")
    parser.add_argument("--policies", default="pretrained,finetuned", help="of untrained, pretrained, finetuned")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--work", type=Path, default=WORK, help="folder of demos, checkpoints and trials")
    parser.add_argument("--fresh", action="store_true", help="forget what is there")
    parser.add_argument("--report", action="store_true", help="run nothing: the result of what is there")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result; a page (.md) lies beside it")
    return parser.parse_args(arguments)


def run_seed(folder: Path, seed: int, policies: Sequence[str], trials: int, workers: int) -> None:
    """The demo with a seed, and the trials, each where it was stopped."""
    fresh = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "SEED": str(seed), "PYTHON": sys.executable, "WORKERS": str(workers)}
    busy, started = common.busy_share(), time.perf_counter()
    finished = folder / "demo.json"
    if not finished.exists():
        steps = _run_demo(folder, environment)
        minutes = (time.perf_counter() - started) / 60
        # Of a demo that went on after a stop, only its last part was timed.
        times = {"minutes": round(minutes, 2), "steps": steps, "busy_before": busy} if fresh else None
        finished.write_text(json.dumps(times), encoding="utf-8")
    paths = [f"outputs/demo/{CHECKPOINTS[name]}/pretrained_model" for name in policies]
    command = [sys.executable, str(common.REPOSITORY / "eval.py"), f"--policy.path={','.join(paths)}"]
    command += [f"--policy.label={','.join(policies)}", f"--env.tasks={','.join(TASKS)}", f"--env.horizon={HORIZON}"]
    command += [f"--trials={trials}", f"--seed={_SEEDS_APART + seed}", f"--workers={workers}", "--videos=0"]
    subprocess.run([*command, "--report=false", "--out=trials"], cwd=folder, check=True)


def _run_demo(folder: Path, environment: dict[str, str]) -> dict[str, float]:
    """Run it, show what it prints, and return the seconds of its steps."""
    marks: list[tuple[str, float]] = []
    process = subprocess.Popen(["sh", str(SCRIPT)], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        print(line, end="", flush=True)
        if line.startswith("== "):
            title = line.split(maxsplit=2)[2].split(":")[0].split(",")[0].strip()
            marks.append((title, time.perf_counter()))
    if process.wait():
        raise subprocess.CalledProcessError(process.returncode, str(SCRIPT))
    return {name: round(end - at, 1) for (name, at), (_, end) in itertools.pairwise(marks)}


def outcomes(folder: Path, policy: str, task: str) -> list[bool]:
    """Whether each trial of a policy on a task succeeded; one that broke off did not."""
    path = folder / "trials" / "trials.jsonl"
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    trials = {line["trial"]: line for line in lines if line.get("label") == policy and line.get("task") == task}
    return [bool(line["success"]) for line in trials.values()]


def result(work: Path, seeds: Sequence[int], policies: Sequence[str]) -> dict[str, Any]:
    """Rates over all seeds with their intervals, those of each seed, times, and the ratios to what is aimed at."""
    cells: dict[str, Any] = {}
    for policy in policies:
        for task in TASKS:
            per_seed = [outcomes(work / f"seed_{seed}", policy, task) for seed in seeds]
            solved, count = sum(map(sum, per_seed)), sum(map(len, per_seed))
            if count:
                rate = success_rate(solved, count)
                cells[f"{policy}/{task}"] = {
                    "solved": solved,
                    "trials": count,
                    "rate": round(rate.rate, 4),
                    "interval_95": [round(rate.low, 4), round(rate.high, 4)],
                    "per_seed": [f"{sum(one)}/{len(one)}" for one in per_seed],
                }
    finished = {seed: work / f"seed_{seed}" / "demo.json" for seed in seeds}
    times = {seed: json.loads(path.read_text(encoding="utf-8")) for seed, path in finished.items() if path.exists()}
    return {
        "machine": common.machine(),
        "versions": common.versions("lerobot", "torch", "mujoco"),
        "settings": {"seeds": list(seeds), "horizon": HORIZON, "tasks": list(TASKS)},
        "ratios": _ratios(cells),
        "cells": cells,
        "demo": {str(seed): value for seed, value in times.items()},
    }


def _ratios(cells: dict[str, Any]) -> dict[str, float]:
    found = {
        f"{policy}_{task}_over_aim": round(cells[f"{policy}/{task}"]["rate"] / aim, 3)
        for (policy, task), aim in AIMS.items()
        if f"{policy}/{task}" in cells
    }
    before, after = (cells.get(f"{policy}/OpenDrawer") for policy in ("pretrained", "finetuned"))
    if before and after and before["rate"]:
        found["finetuned_over_pretrained_OpenDrawer"] = round(after["rate"] / before["rate"], 3)
    return found


def page(body: dict[str, Any]) -> str:
    """The result as a Markdown table."""
    lines = [
        "# Does the demo learn?",
        "",
        f"Written by `make bench-demo`, {body['versions']['commit']}. Each seed has its own demonstrations, recorded "
        "in the ten target kitchens, in which the policies are tried as well; its own training; and its own trials (at "
        f"most {body['settings']['horizon']} control steps); intervals are Wilson's, 95 %, and do not cover what "
        "another training would change: the seeds beside each other show that.",
        "",
        "| policy | task | solved | rate | 95 % interval | seeds |",
        "|---|---|--:|--:|--:|---|",
    ]
    for name, cell in body["cells"].items():
        policy, task = name.split("/")
        low, high = (100 * end for end in cell["interval_95"])
        lines.append(
            f"| {policy} | {task} | {cell['solved']}/{cell['trials']} | {100 * cell['rate']:.0f} % "
            f"| {low:.0f} to {high:.0f} % | {', '.join(cell['per_seed'])} |"
        )
    lines += ["", "Minutes of a demo beside other work say little: see what share of the cores was busy when it began."]
    lines += ["", "| seed | minutes of the demo | cores busy before | its steps, seconds |", "|---|--:|--:|---|"]
    for seed, times in body["demo"].items():
        steps = (
            ", ".join(f"{name} {seconds:.0f}" for name, seconds in times["steps"].items()) if times else "stopped once"
        )
        minutes, share = (times["minutes"], times["busy_before"]) if times else ("", None)
        busy = "" if share is None else f"{share:.0%}"
        lines.append(f"| {seed} | {minutes} | {busy} | {steps} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing, print, write."""
    options = parse(arguments)
    policies = [name for name in options.policies.split(",") if name]
    unknown = [name for name in policies if name not in CHECKPOINTS]
    if unknown:
        raise SystemExit(f"--policies: found {', '.join(unknown)}, expected some of {', '.join(CHECKPOINTS)}.")
    seeds = range(options.seeds)
    work = options.work.resolve()
    if not options.report:
        if options.fresh:
            shutil.rmtree(work, ignore_errors=True)
        for seed in seeds:
            run_seed(work / f"seed_{seed}", seed, policies, options.trials, options.workers)
    body = result(work, list(seeds), policies)
    common.write_result(options.out, "demo", body)
    options.out.with_suffix(".md").write_text(page(body), encoding="utf-8")
    print(page(body))
    return 0


if __name__ == "__main__":
    sys.exit(main())
