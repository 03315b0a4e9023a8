"""Whether this checkout's demonstrators still do the same as an earlier commit's: equal recordings to the bit.

For changes that should change nothing, where tests of single skills see too little: one recording of every atomic task
and of every fifth composite one (`--every`), by turns in either split, on both sides. Those that differ are listed with
their lengths and successes.

    python benchmarks/same_demos.py HEAD~3
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import common
from commands import result, run

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.progress import Bar

OUTPUT = common.REPOSITORY / "outputs" / "same_demos.json"
FIRST_SEED = 238_000  # of development
SPLITS = ("pretrain", "target")
RECORD = """
import hashlib, json, sys
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
found = {}
for job in sys.argv[1:]:
    task, split, seed = job.split("/")
    env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
    try:
        made = record_episode(env, int(seed), varied=True)
        digest = hashlib.sha256(made.actions.tobytes() + made.states.tobytes()).hexdigest()
        found[job] = [digest, len(made.actions), bool(made.success)]
    except Exception as error:
        found[job] = [f"{type(error).__name__}: {error}", 0, False]
    finally:
        env.close()
print("RESULT", json.dumps(found))
"""
AT_ONCE = 8  # recordings of one process: importing takes as long as one or two of them

type Made = tuple[str, int, bool]  # digest or error, steps, success


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", help="commit that is compared with")
    parser.add_argument("--every", type=int, default=5, help="of the composite tasks, each so many-th (default 5)")
    parser.add_argument("--tasks", default="", help="names or sets separated by commas, instead of these")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default {FIRST_SEED}")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    return parser.parse_args(arguments)


def jobs_of(tasks: Sequence[str], first_seed: int) -> list[str]:
    """What is recorded, as task/split/seed: a seed of its own for each task."""
    return [f"{name}/{SPLITS[number % 2]}/{first_seed + number}" for number, name in enumerate(tasks)]


def chosen(every: int) -> list[str]:
    """Every atomic task, and some of the composite ones."""
    return [*expand_names("atomic"), *expand_names("composite")[::every]]


def recorded(checkout: Path, jobs: Sequence[str]) -> dict[str, Made]:
    """What the demonstrators of a checkout do, by job."""
    made = result(run(checkout, ["-c", RECORD, *jobs]))
    return {job: (digest, steps, success) for job, (digest, steps, success) in made.items()}


def differing(before: dict[str, Made], now: dict[str, Made]) -> list[str]:
    """The jobs whose recordings are not equal."""
    return [job for job in before if before[job] != now[job]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Record, compare, print, write; 1 if anything differs."""
    options = parse(arguments)
    jobs = jobs_of(expand_names(options.tasks) if options.tasks else chosen(options.every), options.first_seed)
    found: dict[str, dict[str, Made]] = {"before": {}, "now": {}}
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.workers) as pool:
        sides = {"before": common.unpack(options.before, Path(folder) / "checkout"), "now": common.REPOSITORY}
        parts = [(side, jobs[at : at + AT_ONCE]) for at in range(0, len(jobs), AT_ONCE) for side in sides]
        made = pool.map(lambda part: (part[0], recorded(sides[part[0]], part[1])), parts)
        for side, some in Bar(made, total=len(parts), unit="part"):
            found[side].update(some)
    others = differing(found["before"], found["now"])
    rows = [
        [job, *(f"{found[side][job][1]} {'yes' if found[side][job][2] else 'no'}" for side in found)] for job in others
    ]
    if rows:
        print(common.table(["recording that differs", "steps, success before", "now"], rows))
    print(f"{len(jobs) - len(others)} of {len(jobs)} recordings are equal to those of {options.before} to the bit.")
    body = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy"),
        "before": options.before,
        "ratios": {"equal_share": round(1 - len(others) / len(jobs), 4)},
        "recordings": found,
    }
    common.write_result(options.out, "same_demos", body)
    print(options.out)
    return 1 if others else 0


if __name__ == "__main__":
    sys.exit(main())
