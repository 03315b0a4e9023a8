"""Which objects a parallel gripper can lift: every graspable category, every instance, the best of 16 poses.

A pose counts if the gripper, coming from above, closes on the object, lifts it by 10 cm and holds it for 2 s.
Instances that are done are kept in `outputs/grasps.jsonl`, so that a run can be stopped and continued.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from pathlib import Path

from common import REPOSITORY, RESULTS, machine, table, versions, write_result
from grasping_trial import CLOSE_S, HOLD_S, LIFT_M, POSES, Outcome, try_instance

from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.progress import Bar

AIM_OVERALL, AIM_CATEGORY = 0.95, 0.60
PROGRESS = REPOSITORY / "outputs" / "grasps.jsonl"


def _work(job: tuple[str, int]) -> tuple[str, int, Outcome]:
    try:
        return (*job, try_instance(*job))
    except Exception as error:  # one broken instance must not end the run; it counts as not lifted
        return (*job, Outcome(False, 0, 0, f"{type(error).__name__}: {error}"))


def measure(jobs: list[tuple[str, int]], processes: int, progress: Path | None) -> dict[tuple[str, int], Outcome]:
    """Outcomes by (category, index); those in the progress file are not repeated."""
    done: dict[tuple[str, int], Outcome] = {}
    if progress is not None and progress.exists():
        for line in progress.read_text().splitlines():
            name, index, outcome = json.loads(line)
            done[name, index] = Outcome(**outcome)
    left = [job for job in jobs if job not in done]
    if progress is not None:
        progress.parent.mkdir(parents=True, exist_ok=True)
    with multiprocessing.get_context("forkserver").Pool(processes) as pool:
        results = pool.imap_unordered(_work, left, chunksize=4)
        for name, index, outcome in Bar(results, total=len(left), desc="grasps", unit="instance"):
            done[name, index] = outcome
            if progress is not None:
                with progress.open("a") as file:
                    file.write(json.dumps([name, index, vars(outcome)]) + "\n")
    return {job: done[job] for job in jobs}


def summary(outcomes: dict[tuple[str, int], Outcome]) -> dict[str, dict[str, object]]:
    """Share of instances that were lifted, by category."""
    out: dict[str, dict[str, object]] = {}
    for name in sorted({name for name, _ in outcomes}):
        mine = {index: outcome for (category, index), outcome in outcomes.items() if category == name}
        lifted = sum(o.lifted for o in mine.values())
        first = sum(o.lifted and o.tried == 1 for o in mine.values())
        out[name] = {
            "share": lifted / len(mine),
            "instances": len(mine),
            "share_first_pose": first / len(mine),
            "not_lifted": {str(i): o.reason for i, o in sorted(mine.items()) if not o.lifted},
        }
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--categories", help="names separated by commas (default: every graspable one)")
    parser.add_argument("--quick", action="store_true", help="one instance of each category; writes no result")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--restart", action="store_true", help="forget what an interrupted run had done")
    arguments = parser.parse_args()
    graspable = [name for name, category in catalogue.CATEGORIES.items() if category.graspable]
    names = arguments.categories.split(",") if arguments.categories else graspable
    indices = range(1) if arguments.quick else range(catalogue.INSTANCES_PER_CATEGORY)
    everything = not arguments.quick and not arguments.categories
    if arguments.restart:
        PROGRESS.unlink(missing_ok=True)
    start = time.perf_counter()
    outcomes = measure([(n, i) for n in names for i in indices], arguments.processes, PROGRESS if everything else None)
    seconds = time.perf_counter() - start
    categories = summary(outcomes)
    overall = sum(o.lifted for o in outcomes.values()) / len(outcomes)
    first = sum(o.lifted and o.tried == 1 for o in outcomes.values()) / len(outcomes)
    weak = {name: c["share"] for name, c in categories.items() if float(str(c["share"])) < 1.0}
    print(
        table(
            ["category", "lifted"], [[n, f"{float(str(s)):.0%}"] for n, s in sorted(weak.items(), key=lambda i: str(i))]
        )
    )
    print(f"{overall:.1%} of {len(outcomes)} instances, {first:.1%} with the first pose; {seconds:.0f} s")
    if everything:
        worst = min(float(str(c["share"])) for c in categories.values())
        body = {
            "machine": machine(),
            "versions": versions("mujoco", "numpy"),
            "settings": {"poses": POSES, "lift_m": LIFT_M, "hold_s": HOLD_S, "close_s": CLOSE_S},
            "ratios": {"lifted": overall, "lifted_with_first_pose": first, "worst_category": worst},
            "aims": {"lifted": AIM_OVERALL, "worst_category": AIM_CATEGORY},
            "categories": categories,
        }
        write_result(RESULTS / "grasps.json", "grasps", body)
        PROGRESS.unlink(missing_ok=True)


if __name__ == "__main__":
    main()
