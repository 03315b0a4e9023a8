"""One demonstration of each of the 365 tasks by the commands that users type: recorded, converted, verified, replayed.

    python benchmarks/every_task.py --seed 300000 --strips 40

Minutes are of the wall clock, with films of three cameras at 256x256. A run that is stopped goes on with what is
missing; what earlier runs took is counted. A demonstration that replays, from its first state and its actions alone,
reaches the task's goal again. `--strips N` draws film strips of N tasks, drawn by the seed, to be looked at.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import common
import h5py
from commands import CLI

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.demos.hdf5 import read_summary
from robocasa_lerobot.files import write_text

FOLDER = common.REPOSITORY / "outputs" / "every_task"
OUTPUT = common.RESULTS / "every_task.json"


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", default="all", help="names or sets (default: all)")
    parser.add_argument("--split", default="pretrain", help="kitchens (default pretrain)")
    parser.add_argument("--seed", type=int, default=100_000, help="of each task's first attempt (default 100000)")
    parser.add_argument("--strips", type=int, default=0, help="tasks of which film strips are drawn (default: none)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where demonstrations and dataset go")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result; a page lies beside it")
    return parser.parse_args(arguments)


class Steps:
    """Runs commands one after the other, shows what they print, and keeps how long each took, over all runs."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "steps.json"
        folder.mkdir(parents=True, exist_ok=True)
        self.done: dict[str, dict[str, Any]] = json.loads(self._path.read_text()) if self._path.exists() else {}

    def run(self, name: str, words: Sequence[str], accepted: tuple[int, ...] = (0,)) -> str:
        """What a command printed; it is not run again where an earlier run of the same has ended well."""
        step = self.done.setdefault(name, {"seconds": 0.0, "status": None, "printed": ""})
        asked = _without_workers(words)
        if step["status"] in accepted:
            if step.get("words") != asked:
                raise SystemExit(
                    f"{self._path} is of `{' '.join(step.get('words') or ['another command'])}`; this one is "
                    f"`{' '.join(asked)}`. Give the same options again, or another --folder."
                )
            return str(step["printed"])
        print("robocasa-lerobot", *words, flush=True)
        started = time.monotonic()
        try:
            done = subprocess.run(
                [sys.executable, *CLI, *words], cwd=common.REPOSITORY, stdout=subprocess.PIPE, text=True, check=False
            )
            step |= {"status": done.returncode, "printed": done.stdout, "words": asked}
        finally:
            step["seconds"] += round(time.monotonic() - started, 3)
            write_text(self._path, json.dumps(self.done, indent=1) + "\n")
        print(done.stdout[-1500:], flush=True)
        if done.returncode not in accepted:
            raise SystemExit(f"robocasa-lerobot {words[0]} ended with status {done.returncode}.")
        return done.stdout


def _without_workers(words: Sequence[str]) -> list[str]:
    """The words that decide what comes of a command."""
    where = words.index("--workers") if "--workers" in words else len(words)
    return [*words[:where], *words[where + 2 :]]


def walk(args: argparse.Namespace, steps: Steps) -> dict[str, Any]:
    """Record, convert, verify and replay; what came of it."""
    workers = ("--workers", str(args.workers))
    demos, dataset = args.folder / "demos", args.folder / "dataset"
    wanted = ("--tasks", args.tasks, "--episodes", "1", "--split", args.split, "--seed", str(args.seed))
    # Status 1 says that tasks were given up: they are missing from the result, the others go on.
    steps.run("demos", ["demos", *wanted, *workers, "--out", str(demos)], accepted=(0, 1))
    files = sorted(demos.glob("*.hdf5"))
    # By as many processes as it chooses: each of its workers is two, so that `--workers` would not mean the same.
    steps.run("convert", ["convert", *map(str, files), "--overwrite", "--out", str(dataset)])
    verified = steps.run("verify", ["verify", str(dataset), *workers, "--report", "json"], accepted=(0, 1))
    replayed = json.loads(steps.run("replay", ["replay", str(demos), *workers, "--json"], accepted=(0, 1)))
    if args.strips:
        drawn = random.Random(args.seed).sample(files, min(args.strips, len(files)))
        folder = str(args.folder / "strips")
        steps.run("strips", ["replay", *map(str, sorted(drawn)), *workers, "--strips", folder], accepted=(0, 1))
    return summary(expand_names(args.tasks), files, replayed, json.loads(verified), steps)


def summary(
    names: Sequence[str], files: Sequence[Path], replayed: dict[str, Any], verified: dict[str, Any], steps: Steps
) -> dict[str, Any]:
    """The result's figures."""
    failed = sum(len(read_summary(path).failures) for path in files)
    rows = replayed["demonstrations"]
    control_steps = 0
    for path in files:
        with h5py.File(path) as file:
            control_steps += sum(len(group["actions"]) for group in file["data"].values())
    return {
        "ratios": {
            "tasks_recorded": len(files) / len(names),
            "replayed_from_actions": replayed["actions"],
            "replayed_from_states": replayed["states"],
        },
        "tasks": len(names),
        "missing": sorted(set(names) - {path.stem for path in files}),
        "failed_attempts": failed,
        "control_steps": control_steps,
        "bit_for_bit": sum(row["same_start"] and row["deviation"] == 0 for row in rows),
        "not_replayed": [Path(row["path"]).stem for row in rows if not row["actions"]],
        "verified": steps.done["verify"]["status"] == 0,
        "verification": {key: value for key, value in verified.items() if key != "root"},  # where it lay here
        "minutes": {name: round(step["seconds"] / 60, 1) for name, step in steps.done.items()},
    }


def page(found: dict[str, Any], args: argparse.Namespace) -> str:
    """The result as text."""
    recorded = round(found["ratios"]["tasks_recorded"] * found["tasks"])
    lines = [
        "# One demonstration of each task\n",
        f"`benchmarks/every_task.py`, {args.split} kitchens, seeds from {args.seed} on, {args.workers} processes.\n",
        f"- recorded: {recorded} of {found['tasks']} tasks, {found['control_steps']:,} control steps; "
        f"{found['failed_attempts']} attempts failed before",
        f"- replayed from their actions: {found['ratios']['replayed_from_actions']:.1%}; from their states: "
        f"{found['ratios']['replayed_from_states']:.1%}; {found['bit_for_bit']} pass through the recorded states "
        "bit for bit",
        f"- the dataset {'verifies' if found['verified'] else 'does not verify'}",
    ]
    lines += [f"- {name}: {', '.join(found[key])}" for name, key in
              (("not recorded", "missing"), ("not replayed", "not_replayed")) if found[key]]  # fmt: skip
    minutes = "".join(f"| {name} | {value} |\n" for name, value in found["minutes"].items())
    return "\n".join(lines) + f"\n\n| command | minutes |\n|---|--:|\n{minutes}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Do what is missing, and write the result."""
    args = parse(arguments)
    found = walk(args, Steps(args.folder))
    settings = {"tasks": args.tasks, "split": args.split, "seed": args.seed, "workers": args.workers}
    body = {**found, "settings": settings, "machine": common.machine(), "versions": common.versions("mujoco", "numpy")}
    common.write_result(args.out, "every_task", body)
    text = page(found, args)
    write_text(args.out.with_suffix(".md"), text)
    print(text)


if __name__ == "__main__":
    main()
