"""This checkout beside an earlier commit of ours: processor time per step of simulator, converter and evaluation.

And per demonstration of planning: of all that a demonstrator does between two actions, in every third atomic task. Of
new scenes it is wall time, the median over all atomic tasks in both splits, of resets without and with three pictures.

Both sides do the same work, taking turns, on one thread per library, so that whatever else the machine does hits both;
medians count. Demonstrations and the policy (random weights, so that every trial lasts its horizon) are made by the
earlier commit, which both sides can read.

    python benchmarks/between_commits.py 500f015
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import dataclasses
import json
import os
import resource
import shutil
import statistics
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import common
import evaluation_sides
from commands import CLI, result, run

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "between_commits.json"
SIDES = ("before", "now")
KINDS = (
    *("sim", "sim_pictures", "convert", "evaluation", "evaluation_films", "planning"),
    *("new_scene", "new_scene_pictures"),
)
# As many that a command's start, ten seconds of imports on both sides, is the smaller part of its time.
TASK, EPISODES = "PickPlaceCounterToSink", 12
EVALUATED, TRIALS, IMAGE_SIZE = ["CloseDrawer", "PickPlaceCounterToSink"], 6, 96
STEPS = {"sim": 1200, "sim_pictures": 150}
CHECKPOINT = """
import sys
from pathlib import Path
sys.path.insert(0, "benchmarks")
import evaluation_sides, training_sides
evaluation_sides.make_checkpoint(Path(sys.argv[1]), training_sides.policy_settings("demo"), int(sys.argv[2]))
"""
CONTROL_STEP = """
import sys, time
import numpy as np
from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
task, steps, pictures = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "True"
cameras = contract.CAMERAS if pictures else ()
env = KitchenEnv(task, cameras=cameras, horizon=10**9, terminate_on_success=False)
rng = np.random.default_rng(0)
actions = rng.uniform(-0.3, 0.3, size=(steps, contract.ACTION_SIZE)).astype(np.float32)
env.reset(seed=1)  # elsewhere: the same actions in the same kitchen would show every view a second time
for action in actions[:20]:
    env.step(action)
env.reset(seed=0)
started = time.process_time()
for action in actions:
    env.step(action)
print("RESULT", (time.process_time() - started) / steps)
"""

_SET_CHILD_SUBREAPER = 36  # of prctl(2)
PLANNED_SEEDS, EVERY = 2, 3
PLANNING = """
import sys, time
from robocasa_lerobot.demos.demonstrator import SkillError, demonstrate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
seconds = []
for task in sys.argv[2].split(","):
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    for seed in range(100_000, 100_000 + int(sys.argv[1])):
        env.reset(seed=seed)
        actions, used, over = demonstrate(env), 0.0, False
        while not over:
            started = time.process_time()
            try:
                action = next(actions)
            except (SkillError, StopIteration):
                over = True
            used += time.process_time() - started
            if not over:
                *_, truncated, info = env.step(action.astype("float32"))
                over = truncated or info["success"]
        seconds.append(used)
    env.close()
print("RESULT", sum(seconds) / len(seconds))
"""
SCENES = """
import statistics, sys, time
from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
cameras = contract.CAMERAS if sys.argv[2] == "True" else ()
tasks = sys.argv[1].split(",")
KitchenEnv(tasks[0], cameras=cameras).reset(seed=0)
seconds = []
for number, task in enumerate(tasks):
    for split in ("target", "pretrain"):
        env = KitchenEnv(task, split=split, cameras=cameras)
        started = time.perf_counter()
        env.reset(seed=1000 + number)
        seconds.append(time.perf_counter() - started)
        env.close()
print("RESULT", statistics.median(seconds))
"""


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", help="commit that is compared with")
    parser.add_argument("--repetitions", type=int, default=5, help="of each side (default 5)")
    parser.add_argument("--kinds", default=",".join(KINDS), help="default: all")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    options = parser.parse_args(arguments)
    options.kinds = common.chosen_kinds(parser, options.kinds, KINDS)
    return options


def timed_run(checkout: Path, command: Sequence[str]) -> tuple[str, float]:
    """What a Python of a checkout prints, and the processor seconds of it and its children."""
    _adopt_orphans()
    before = _children_s()
    said = run(checkout, command)
    _await_orphans()
    return said, _children_s() - before


def _adopt_orphans() -> None:
    """Make this process the parent of what its children leave behind, where the system can do that (Linux).

    Workers are children of a fork server that nobody waits for: without this their seconds are counted nowhere.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _await_orphans() -> None:
    with contextlib.suppress(ChildProcessError):
        while True:
            os.waitpid(-1, 0)


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Work:
    """All kinds of work, as one side does them.

    Args:
        checkout: of the side.
        folder: for what it writes.
        demos: folder of HDF5 demonstrations.
        checkpoint: of the policy.
    """

    def __init__(self, checkout: Path, folder: Path, demos: Path, checkpoint: Path) -> None:
        self._checkout, self._folder, self._demos, self._checkpoint = checkout, folder, demos, checkpoint

    def seconds(self, kind: str) -> float:
        """Seconds per control step, frame, step of a trial, demonstration or scene; commands count with their start.

        Planning does not: the first call of a compiled function compiles it, in the first repetition.
        """
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        others: dict[str, Callable[[], float]] = {
            "convert": self._convert,
            "evaluation": lambda: self._evaluate(films=False),
            "evaluation_films": lambda: self._evaluate(films=True),
            "planning": self._plan,
            "new_scene": lambda: self._scene(pictures=False),
            "new_scene_pictures": lambda: self._scene(pictures=True),
        }
        return others.get(kind, lambda: self._simulate(kind))()

    def _plan(self) -> float:
        return self._answer(PLANNING, str(PLANNED_SEEDS), ",".join(expand_names("atomic")[::EVERY]))

    def _scene(self, pictures: bool) -> float:
        return self._answer(SCENES, ",".join(expand_names("atomic")), str(pictures))

    def _simulate(self, kind: str) -> float:
        return self._answer(CONTROL_STEP, TASK, str(STEPS[kind]), str(kind == "sim_pictures"))

    def _answer(self, program: str, *arguments: str) -> float:
        """The number that a program of this file prints as its result."""
        return float(result(run(self._checkout, ["-c", program, *arguments])))

    def _convert(self) -> float:
        out = self._folder / "dataset"
        command = [*CLI, "convert", str(self._demos / f"{TASK}.hdf5"), f"--out={out}", "--workers=1"]
        _, seconds = timed_run(self._checkout, command)
        info = json.loads((out / "meta" / "info.json").read_text(encoding="utf-8"))
        return seconds / int(info["total_frames"])

    def _evaluate(self, films: bool) -> float:
        job = evaluation_sides.Job(
            str(self._checkpoint), EVALUATED, TRIALS, 1, IMAGE_SIZE, str(self._folder / "out"), films=films
        )
        file = self._folder / "job.json"
        file.write_text(json.dumps(dataclasses.asdict(job)), encoding="utf-8")
        script = self._checkout / "benchmarks" / "evaluation_sides.py"
        said, seconds = timed_run(self._checkout, [str(script), evaluation_sides.OURS, str(file)])
        return seconds / sum(result(said)["steps"])


def measure(before: Path, scratch: Path, kinds: Sequence[str], repetitions: int) -> dict[str, dict[str, list[float]]]:
    """Seconds of all kinds on both sides, the sides in turn, each first as often as the other."""
    demos, checkpoint = scratch / "demos", scratch / "policy"
    if "convert" in kinds:
        command = [*CLI, "demos", f"--tasks={TASK}", f"--episodes={EPISODES}", f"--out={demos}"]
        run(before, [*command, "--workers=1"])
    if {"evaluation", "evaluation_films"} & set(kinds):
        run(before, ["-c", CHECKPOINT, str(checkpoint), str(IMAGE_SIZE)])
    work = {
        side: Work(checkout, scratch / side, demos, checkpoint)
        for side, checkout in (("before", before), ("now", common.REPOSITORY))
    }
    found: dict[str, dict[str, list[float]]] = {kind: {side: [] for side in SIDES} for kind in kinds}
    jobs = [(kind, turn) for turn in range(repetitions) for kind in kinds]
    with Bar(jobs, total=len(jobs), unit="pair") as bar:
        for kind, turn in bar:
            for side in SIDES if turn % 2 == 0 else SIDES[::-1]:
                found[kind][side].append(work[side].seconds(kind))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    busy = common.busy_share()
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        before = common.unpack(options.before, scratch / "checkout")
        found = measure(before, scratch, options.kinds, options.repetitions)
    medians = {kind: {side: statistics.median(values) for side, values in row.items()} for kind, row in found.items()}
    ratios = {f"{kind}_now_to_before": round(row["now"] / row["before"], 4) for kind, row in medians.items()}
    lines = [
        [kind, *(f"{1000 * row[side]:.2f}" for side in SIDES), f"{ratios[f'{kind}_now_to_before']:.3f}"]
        for kind, row in medians.items()
    ]
    print(common.table(["processor ms per step, demonstration", *SIDES, "ratio"], lines))
    body = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy", "torch", "lerobot"),
        "before": options.before,
        "busy_before": busy,
        "ratios": ratios,
        "seconds_each": {kind: {s: common.spread(v) for s, v in row.items()} for kind, row in found.items()},
    }
    common.write_result(options.out, "between_commits", body)
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
