"""How much more gets done by more processes: stepping, evaluating and converting with 1 to N, and what limits the next.

    python benchmarks/scaling.py                        # 1, 2, 4, ... processes, up to the cores that there are
    python benchmarks/scaling.py --processes 1,8,16 --kinds converting

No peer: the ratio is N processes to one of ours. Steps of envs are counted while all processes step; evaluating and
converting are whole runs, work for N times as many processes being N times as much. Evaluation is of a policy with
random weights, so that every trial lasts its horizon. Run it with nothing else on the machine: what limits is told
from how busy the cores are.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import common
import evaluation_sides
import training_sides
from commands import CLI, result, run
from scaling_limits import Use, Watch, limit
from workers import Worker, run_together

from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "scaling.json"
KINDS = ("steps_no_cameras", "steps_three_cameras", "evaluating", "converting")
DEMONSTRATED, EPISODES = "OpenDrawer", 4  # of the file that is converted, for each process
EVALUATED, TRIALS, IMAGE_SIZE = ["CloseDrawer", "OpenDrawer"], 1, 96  # trials of each task for each process
SEEDS_APART = 10_000


@dataclass(frozen=True)
class Done:
    """Control steps or frames that were done, and how many a second where that is known better than by a clock."""

    count: float
    rate: float | None = None


@dataclass(frozen=True)
class Measured:
    """One repetition: what was done a second (control steps, or frames), and what it took of the machine."""

    rate: float
    use: Use


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=_counts, default=_up_to_cores(), help="default: 1, 2, 4, ... to all cores")
    parser.add_argument("--kinds", default=",".join(KINDS), help="default: all")
    parser.add_argument("--seconds", type=float, default=20.0, help="of stepping, each time (default 20)")
    parser.add_argument("--repetitions", type=int, default=3, help="medians count (default 3)")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    options = parser.parse_args(arguments)
    options.kinds = common.chosen_kinds(parser, options.kinds, KINDS)
    return options


def _counts(text: str) -> list[int]:
    counts = sorted({int(word) for word in text.split(",")})
    if counts[0] < 1:
        raise argparse.ArgumentTypeError("processes are counted from 1 on")
    return sorted({1, *counts})  # everything is compared with one


def _up_to_cores() -> list[int]:
    cores = int(common.machine()["cores"])
    return sorted({1, cores, *(2**k for k in range(10) if 2**k <= cores)})


class Work:
    """The kinds of work; files that they need are made when they are first asked for.

    Args:
        scratch: folder for them.
        most: processes that will work at the same time.
        seconds: of stepping.
    """

    def __init__(self, scratch: Path, most: int, seconds: float) -> None:
        self._scratch, self._most, self._seconds = scratch, most, seconds
        self._stack = contextlib.ExitStack()
        self._workers: dict[bool, list[Worker]] = {}
        self._seed = 0

    def __enter__(self) -> Work:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def measure(self, kind: str, processes: int) -> Measured:
        """Do a kind of work with so many processes at a time."""
        work: dict[str, Callable[[int], Done]] = {
            "steps_no_cameras": lambda count: self._steps(False, count),
            "steps_three_cameras": lambda count: self._steps(True, count),
            "evaluating": self._evaluate,
            "converting": self._convert,
        }
        self._prepare(kind)
        with Watch() as watch:
            started = time.perf_counter()
            done = work[kind](processes)
            seconds = time.perf_counter() - started
        return Measured(done.rate or done.count / seconds, watch.use(done.count))

    def _prepare(self, kind: str) -> None:
        if kind == "evaluating" and not self._checkpoint.exists():
            evaluation_sides.make_checkpoint(self._checkpoint, training_sides.policy_settings("demo"), IMAGE_SIZE)
        if kind == "converting" and not self._demos(1).exists():
            for count in range(1, self._most + 1):
                self._record(count)
        if kind.startswith("steps") and (cameras := kind == "steps_three_cameras") not in self._workers:
            program = common.REPOSITORY / "benchmarks" / "ours_sim.py"
            made = [Worker(f"{kind} {i}", Path(sys.executable), program) for i in range(self._most)]
            for i, worker in enumerate(made):
                self._stack.enter_context(worker)
                worker.ask("make", cameras=cameras, seed=i)
            self._workers[cameras] = made

    def _steps(self, cameras: bool, processes: int) -> Done:
        self._seed += SEEDS_APART  # scenes that are new to everybody
        answers = run_together(self._workers[cameras][:processes], self._seconds, self._seed)
        return Done(sum(a["steps"] for a in answers), sum(a["steps"] / a["seconds"] for a in answers))

    @property
    def _checkpoint(self) -> Path:
        return self._scratch / "policy"

    def _evaluate(self, processes: int) -> Done:
        job = evaluation_sides.Job(
            str(self._checkpoint), EVALUATED, TRIALS * processes, processes, IMAGE_SIZE, str(self._fresh()), films=False
        )
        file = self._scratch / "job.json"
        file.write_text(json.dumps(dataclasses.asdict(job)), encoding="utf-8")
        script = common.REPOSITORY / "benchmarks" / "evaluation_sides.py"
        said = run(common.REPOSITORY, [str(script), evaluation_sides.OURS, str(file)])
        return Done(sum(result(said)["steps"]))

    def _demos(self, part: int) -> Path:
        return self._scratch / f"demos_{part}"

    def _record(self, part: int) -> None:
        """Demonstrations for one more process, each file with seeds of its own."""
        command = [*CLI, "demos", f"--tasks={DEMONSTRATED}", f"--episodes={EPISODES}", f"--out={self._demos(part)}"]
        run(common.REPOSITORY, [*command, f"--seed={SEEDS_APART * part}", "--workers=1"])

    def _convert(self, processes: int) -> Done:
        files = [str(self._demos(part) / f"{DEMONSTRATED}.hdf5") for part in range(1, processes + 1)]
        out = self._fresh()
        run(common.REPOSITORY, [*CLI, "convert", *files, f"--out={out}", f"--workers={processes}"])
        return Done(json.loads((out / "meta" / "info.json").read_text(encoding="utf-8"))["total_frames"])

    def _fresh(self) -> Path:
        shutil.rmtree(self._scratch / "out", ignore_errors=True)
        return self._scratch / "out"


def summary(found: dict[str, dict[int, list[Measured]]]) -> dict[str, dict[str, Any]]:
    """For each kind and number of processes: rate, times that of one, medians of what was used, and what limits."""
    cores = int(common.machine()["cores"])
    body: dict[str, dict[str, Any]] = {}
    for kind, by_count in found.items():
        rows: dict[int, tuple[float, Use]] = {
            count: (statistics.median(m.rate for m in repetitions), Use.median([m.use for m in repetitions]))
            for count, repetitions in by_count.items()
        }
        rate_of_one, use_of_one = rows[1]
        body[kind] = {
            str(count): {
                "per_second": common.spread([m.rate for m in by_count[count]]),
                "times_one": round(rate / rate_of_one, 3),
                **asdict(use),
                "limit": limit(count, cores, rate / rate_of_one, use, use_of_one),
            }
            for count, (rate, use) in rows.items()
        }
    return body


def report(body: dict[str, dict[str, Any]]) -> str:
    """A table for the terminal."""
    rows = [
        [
            kind, count, f"{row['per_second']['median']:.1f}", f"{row['times_one']:.2f}x", f"{row['cores']:.1f}",
            f"{1000 * row['processor_s']:.2f}", f"{row['memory_gib']:.1f}", row["limit"],
        ]
        for kind, by_count in body.items() for count, row in by_count.items()
    ]  # fmt: skip
    header = ["work", "processes", "a second", "of one", "cores busy", "processor ms each", "GiB more", "what limits"]
    return common.table(header, rows)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    busy = common.busy_share()
    found: dict[str, dict[int, list[Measured]]] = {kind: {n: [] for n in options.processes} for kind in options.kinds}
    jobs = [(k, n) for k in options.kinds for _ in range(options.repetitions) for n in options.processes]
    with tempfile.TemporaryDirectory() as folder, Work(Path(folder), max(options.processes), options.seconds) as work:
        bar = Bar(jobs, total=len(jobs), unit="part", smoothing=0)
        with bar:
            for kind, count in bar:
                bar.set_description(f"{kind}, {count} process{'es' * (count > 1)}")
                found[kind][count].append(work.measure(kind, count))
    body = summary(found)
    print(report(body))
    if busy is not None and busy > common.QUIET_SHARE:
        print(f"NOT QUIET: others used {100 * busy:.0f} % of the cores before. Repeat with nothing else running.")
    result = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy", "torch", "lerobot"),
        "others_share_of_cores": busy,
        "settings": {"seconds": options.seconds, "repetitions": options.repetitions},
        "ratios": {
            f"{kind}_{count}": row["times_one"]
            for kind, rows in body.items()
            for count, row in rows.items()
            if count != "1"
        },
        "kinds": body,
    }
    common.write_result(options.out, "scaling", result)
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
