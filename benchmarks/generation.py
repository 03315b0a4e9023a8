"""Generation: how often attempts succeed in kitchens that the sources are not from, and what that is worth an hour.

Sources are prepared demonstrations (`robocasa-lerobot demos`, then `prepare`). Every task and seed is tried by each of
the arms in turn, in one run, so that their times compare:

    ours       `generate` as it is
    mimicgen   `generate --method mimicgen`: whole subtasks, joined by lines, the base at rest
    scripted   the demonstrator itself, which needs no sources
    far        ours, the base starting up to 1.5 m away and at any heading; of tasks whose published data does not drive
    one        ours with one source of each task
    own        ours in the sources' own scenes

    python benchmarks/generation.py --source sources/ --arms ours=100,mimicgen=20,scripted=20,far=20
    python benchmarks/generation.py --source sources/ --tasks KettleBoiling,ButterOnPan --arms ours --attempts 20

Every attempt is a line of the trials' file, so that a run can be stopped and continued; nothing is left out of a rate,
and an attempt that raises has failed. The first tries alone are counted beside: what a single pass over the segments
comes to.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import common
from generation_picture import draw
from generation_report import Trial, ratios, summary, text

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.prepare import file_identity
from robocasa_lerobot.demos.generate.sources.source import sources_of
from robocasa_lerobot.demos.quality.measure import start_of
from robocasa_lerobot.demos.quality.summary import square_of
from robocasa_lerobot.demos.recorder import Recording, record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.files import write_text
from robocasa_lerobot.jsonl import read_whole_lines
from robocasa_lerobot.progress import Bar

FIRST_SEED = 100_500  # development's; sources are from 100,000 on
FAR_M = 1.5
BLOCK = 10  # seeds of a task that are tried before the next task's: its sources are read once for them
ARMS = ("ours", "mimicgen", "scripted", "far", "one", "own")
# Of the 60 tasks: those of which the benchmark's own data drives, which are not asked of the arm `far`.
DRIVING = (
    "CloseBlenderLid", "CloseMicrowave", "CloseStandMixerHead", "OpenFridgeDrawer", "OpenMicrowave",
    "PickPlaceCounterToMicrowave", "PickPlaceCounterToOven", "PickPlaceDrawerToCounter",
    "PickPlaceMicrowaveToCounter", "TurnOnStove", "TurnOffStove",
)  # fmt: skip
OUTPUT = common.RESULTS / "generation.json"


@dataclass(frozen=True)
class Job:
    """An attempt to be made: task, seed, arm, the folder of its sources, the commit, and how many run at once."""

    task: str
    seed: int
    arm: str
    source: Path
    commit: str = ""
    workers: int = 1

    @property
    def key(self) -> tuple[str, int, str]:
        """What makes it one attempt."""
        return self.task, self.seed, self.arm


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, required=True, help="folder of prepared demonstrations")
    parser.add_argument("--tasks", default="", help="names or sets (default: those that have a file there)")
    parser.add_argument(
        "--arms",
        default="ours,mimicgen,scripted",
        help=f"of {', '.join(ARMS)}; ours=100 for other attempts (default %(default)s)",
    )
    parser.add_argument("--attempts", type=int, default=10, help="of each task, where an arm does not say (default 10)")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default {FIRST_SEED}")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--trials", type=Path, default=common.REPOSITORY / "outputs" / "generation.jsonl")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result; a page and a picture lie beside it")
    return parser.parse_args(arguments)


def settings_of(job: Job) -> GenerationSettings:
    """Of an attempt."""
    return GenerationSettings(
        job.task, 1, split="pretrain", varied=False, source=str(job.source),
        start_within_m=FAR_M if job.arm == "far" else 0.0,
        first_sources=1 if job.arm == "one" else 0,
        method="mimicgen" if job.arm == "mimicgen" else "contacts",
    )  # fmt: skip


def record(job: Job, settings: GenerationSettings, env: KitchenEnv) -> Recording:
    """Make an attempt in the way of its arm."""
    if job.arm == "scripted":
        return record_episode(env, job.seed, varied=True)
    return settings.record(env, job.seed)


def attempt(job: Job) -> Trial:
    """Make one attempt. Nothing that goes wrong ends the benchmark: it counts as a failure."""
    settings, started = settings_of(job), time.perf_counter()
    try:
        if job.arm != "scripted":
            settings.read()  # before the clock: `generate` reads a task's sources once
        started = time.perf_counter()
        with contextlib.closing(settings.make_env()) as env:
            recording = record(job, settings, env)
            seconds = round(time.perf_counter() - started, 3)
            env.reset(seed=job.seed)
            start = square_of(start_of(env))
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        seconds = round(time.perf_counter() - started, 3)
        return Trial(*job.key, False, False, 0, seconds, 0, (), False, reason, job.commit, job.workers)
    rows = recording.ep_meta.get("generation", {}).get("segments", [])
    return Trial(
        *job.key,
        success=recording.success,
        ever=recording.success or bool(recording.rewards.any()),
        steps=len(recording.actions),
        seconds=seconds,
        segments=len(rows),
        sources=tuple(row["demo"] for row in rows),
        first_try=recording.success and not any(row.get("in_vain") for row in rows) and not _again(recording),
        reason=recording.reason,
        commit=job.commit,
        workers=job.workers,
        start=start,
    )


def _again(recording: Recording) -> bool:
    """Whether a stage was begun a second time."""
    return any(stage["attempts"] > 1 for stage in recording.ep_meta.get("stages", ()))


def arms_of(text: str, attempts: int) -> dict[str, int]:
    """Attempts at each task, by arm, from `ours=100,mimicgen`."""
    found = {}
    for word in text.split(","):
        arm, _, number = (part.strip() for part in word.partition("="))
        if arm not in ARMS or not (number or "1").isdigit():
            raise SystemExit(f"--arms {word}: expected one of {', '.join(ARMS)}, or as ours=100.")
        found[arm] = int(number or attempts)
    return found


def jobs_of(args: argparse.Namespace, names: Iterable[str], arms: Mapping[str, int]) -> list[Job]:
    """All attempts, some seeds after others, so that a run that is stopped has seen all tasks about equally often.

    A task without sources of its own has no scenes of its own either, for the arm `own`, and no whole subtasks for
    the arm `mimicgen`.
    """
    commit = common.versions()["commit"]
    with_file = [name for name in names if (args.source / f"{name}.hdf5").exists()]
    own = {name: [one.seed for one in sources_of(args.source, name)] for name in with_file} if "own" in arms else {}
    jobs = []
    for begin in range(0, max(arms.values()), BLOCK):
        for name in names:
            for number in range(begin, begin + BLOCK):
                for arm, attempts in arms.items():
                    known = own.get(name, [])
                    if number >= (min(attempts, len(known)) if arm == "own" else attempts):
                        continue
                    if (arm == "far" and name in DRIVING) or (arm == "mimicgen" and name not in with_file):
                        continue
                    seed = known[number] if arm == "own" else args.first_seed + number
                    jobs.append(Job(name, seed, arm, args.source, commit, args.workers))
    return jobs


def keep_to_sources(folder: Path, names: Sequence[str], trials: Path) -> None:
    """Note which sources a file of trials is about; sources that were prepared anew are others.

    Raises:
        SystemExit: it is about others.
    """
    own = {folder / f"{name}.hdf5" for name in names} & set(folder.glob("*.hdf5"))
    paths = own if len(own) == len(names) else folder.glob("*.hdf5")
    files = {path.name: file_identity(path) for path in sorted(paths)}
    note = trials.with_suffix(".sources.json")
    note.parent.mkdir(parents=True, exist_ok=True)
    if trials.exists() and (not note.exists() or json.loads(note.read_text()) != files):
        raise SystemExit(f"{trials} holds attempts with other sources than those in {folder} now. Remove it, or give "
                         "another file by --trials.")  # fmt: skip
    write_text(note, json.dumps(files))


def run(jobs: Sequence[Job], path: Path, workers: int) -> None:
    """Make attempts, and write each down when it has ended."""
    path.parent.mkdir(parents=True, exist_ok=True)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["robocasa_lerobot.demos.generate.settings"])
    with ProcessPoolExecutor(workers, mp_context=context) as pool, path.open("a", encoding="utf-8") as file:
        futures = [pool.submit(attempt, job) for job in jobs]
        try:
            for future in Bar(as_completed(futures), total=len(futures), unit="attempt"):
                file.write(json.dumps(asdict(future.result())) + "\n")
                file.flush()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _trial(row: Mapping[str, Any]) -> Trial:
    start = row.get("start")
    return Trial(**{**row, "sources": tuple(row["sources"]), "start": None if start is None else tuple(start)})


def read(path: Path) -> dict[tuple[str, int, str], Trial]:
    """Finished attempts; a line that a kill has cut off is made anew."""
    trials = map(_trial, read_whole_lines(path))
    return {(trial.task, trial.seed, trial.arm): trial for trial in trials}


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the missing attempts, and write the result."""
    args = parse(arguments)
    arms = arms_of(args.arms, args.attempts)
    names = expand_names(args.tasks) if args.tasks else tuple(sorted(path.stem for path in args.source.glob("*.hdf5")))
    jobs = jobs_of(args, names, arms)
    keep_to_sources(args.source, names, args.trials)
    done = read(args.trials)
    if todo := [job for job in jobs if job.key not in done]:
        run(todo, args.trials, args.workers)
        done = read(args.trials)
    trials = [done[job.key] for job in jobs]
    body = {
        "ratios": ratios(trials),
        "arms": {arm: summary(own) for arm in arms if (own := [trial for trial in trials if trial.arm == arm])},
        "settings": {"attempts": arms, "first_seed": args.first_seed, "split": "pretrain"},
        "commits": sorted({trial.commit for trial in trials}),
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy"),
    }
    common.write_result(args.out, "generation", body)
    picture = args.out.with_suffix(".png")
    draw(body["arms"], picture)
    head = f"`benchmarks/generation.py`, pretraining kitchens, seeds from {args.first_seed} on."
    page = text(trials, f"{head}\n\n![What is kept of each task's attempts]({picture.name})")
    write_text(args.out.with_suffix(".md"), page)
    print(page)


if __name__ == "__main__":
    main()
