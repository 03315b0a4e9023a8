"""The demonstrators: how often each solves its task in kitchens it was not made on, and how long it takes.

The seeds are those of the result that is there, or from 610,000 on, in both splits: nothing was chosen by them.
Every trial is a line of `outputs/demonstrators.jsonl`, so that a run can be stopped and continued; the result holds
all trials that are there.
They are kept beside it (`.trials.gz`), where a checkout without such a file begins. A trial says which declaration and
which code of skills it was made with: the same command makes those again for which that has changed, and no others,
and a result is not replaced by one of fewer trials because of them. `--fresh` makes all of them again:

    python benchmarks/demonstrators.py --tasks OpenDrawer,CloseDrawer --fresh

Rates may be measured beside other work, demonstrations an hour not: these are taken alone, of a few trials.

    python benchmarks/demonstrators.py --seeds 2 --first-seed 100200 \\
        --trials outputs/demonstrators_alone.jsonl --out benchmarks/results/demonstrators_alone.json
"""

from __future__ import annotations

import argparse
import gzip
import json
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

import common
from demonstrators_report import draw, page, ratios, summary, text
from demonstrators_sources import sources_of
from demonstrators_trial import Key, Trial

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.errors import differing
from robocasa_lerobot.files import write_text, written_aside
from robocasa_lerobot.progress import Bar

OUTPUT = common.RESULTS / "demonstrators.json"
PICTURE = common.RESULTS / "demonstrators.png"
TRIALS = common.REPOSITORY / "outputs" / "demonstrators.jsonl"
KEPT = ".trials.gz"
SPLITS = ("target", "pretrain")
FIRST_SEED = 610_000  # below, skills are tuned and compared, and earlier tables were made
LONGEST_S = 600  # of wall time; a trial that takes longer hangs, and has failed


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", default="all", help="names or sets separated by commas (default: all)")
    parser.add_argument("--seeds", type=int, default=20, help="seeds in each split (default 20)")
    parser.add_argument("--splits", default=",".join(SPLITS), help="default: both")
    parser.add_argument(
        "--first-seed", type=int, help=f"default: that of the result that is there, or {FIRST_SEED} where there is none"
    )
    parser.add_argument("--action-noise", type=float, default=0.0, help="as of `demos` (default 0)")
    parser.add_argument("--plain", action="store_true", help="without variety of speed, paths and grasps")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--fresh", action="store_true", help="forget finished trials of these tasks and settings")
    parser.add_argument("--report", action="store_true", help="run nothing: result and picture of what is there")
    parser.add_argument("--trials", type=Path, default=TRIALS, help="file of finished trials")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result; the picture lies beside it")
    options = parser.parse_args(arguments)
    if options.first_seed is None:
        there = json.loads(options.out.read_text(encoding="utf-8")) if options.out.is_file() else {}
        options.first_seed = there.get("settings", {}).get("first_seed", FIRST_SEED)
    return options


def attempt(key: Key, workers: int, commit: str) -> Trial:
    """Let the demonstrator try once. Nothing that goes wrong ends the benchmark: it counts as a failure."""
    task, split, seed, action_noise, varied = key
    started = time.perf_counter()
    signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(LONGEST_S)
    env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
    success, steps, reason, false_terms, stages = False, 0, "", (), ()
    try:
        recording = record_episode(env, seed, action_noise=action_noise, varied=varied)
        success, steps, reason = recording.success, len(recording.actions), recording.reason
        false_terms = recording.false_terms
        stages = tuple(
            (f"{row['skill']} {row['verb']}", row["attempts"], row["done"], row["skipped"])
            for row in recording.ep_meta["stages"]
        )
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
        env.close()
    seconds = round(time.perf_counter() - started, 3)
    return Trial(*key, success, steps, seconds, workers, reason, false_terms, commit, sources_of(task), stages)


def _too_long(number: int, frame: object) -> None:
    raise TimeoutError(f"no end after {LONGEST_S} s of wall time")


def read_trials(path: Path) -> dict[Key, Trial]:
    """Finished trials; of one that was made twice, the later."""
    if not path.exists():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    found = (json.loads(line) for line in lines if line.endswith("\n"))  # the last one may be cut off
    trials = (_trial(values) for values in found)
    return {trial.key: trial for trial in trials}


def _trial(values: dict[str, Any]) -> Trial:
    tuples = {"false_terms": tuple(values["false_terms"]), "stages": tuple(map(tuple, values.get("stages", ())))}
    return Trial(**{**values, **tuples})


def is_current(trial: Trial) -> bool:
    """Whether a trial was made with the present declaration and skills; those that do not say are taken as they are."""
    return trial.sources in ("", sources_of(trial.task))


def keep(trials: Iterable[Trial], path: Path) -> None:
    """Write down the trials of a result, packed; the same trials give the same bytes."""
    lines = _lines(sorted(trials, key=lambda trial: trial.key))
    with written_aside(path) as aside:
        aside.write_bytes(gzip.compress(lines.encode(), mtime=0))


def take_up(kept: Path, path: Path) -> None:
    """Begin the file of finished trials with those of the last result, where there is none yet."""
    if kept.exists() and not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, gzip.decompress(kept.read_bytes()).decode())


def forget(path: Path, keys: Iterable[Key]) -> None:
    """Remove trials from the file."""
    gone = set(keys)
    left = [trial for key, trial in read_trials(path).items() if key not in gone]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, _lines(left))


def _lines(trials: Iterable[Trial]) -> str:
    return "".join(json.dumps(asdict(trial)) + "\n" for trial in trials)


def run(jobs: list[Key], path: Path, workers: int) -> None:
    """Make the trials, and write each down when it has ended."""
    commit = common.versions()["commit"]
    path.parent.mkdir(parents=True, exist_ok=True)
    _mend(path)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["robocasa_lerobot.demos.recorder"])
    solved = failed = 0
    with ProcessPoolExecutor(workers, mp_context=context) as pool, path.open("a", encoding="utf-8") as file:
        futures = [pool.submit(attempt, job, workers, commit) for job in jobs]
        try:
            with Bar(as_completed(futures), total=len(futures), unit="trial", smoothing=0.02) as bar:
                for future in bar:
                    trial = future.result()
                    file.write(json.dumps(asdict(trial)) + "\n")
                    file.flush()
                    solved, failed = solved + trial.success, failed + (not trial.success)
                    bar.set_postfix(solved=solved, failed=failed)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _mend(path: Path) -> None:
    """End a line that was cut off when an earlier run was killed."""
    if path.exists() and (content := path.read_bytes()) and not content.endswith(b"\n"):
        path.write_bytes(content[: content.rfind(b"\n") + 1])


def others_there(out: Path, settings: Mapping[str, Any]) -> str:
    """What a result that is there was measured with, where that is something else; else nothing."""
    return differing(json.loads(out.read_text(encoding="utf-8"))["settings"], settings) if out.is_file() else ""


def trials_there(out: Path) -> int:
    """How many trials a result that is there counts; 0 where there is none."""
    return int(json.loads(out.read_text(encoding="utf-8")).get("trials", 0)) if out.is_file() else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing, print, write."""
    options = parse(arguments)
    settings = {"first_seed": options.first_seed, "action_noise": options.action_noise, "varied": not options.plain}
    if others := others_there(options.out, settings):  # whose trials would be dropped
        print(
            f"demonstrators: {options.out} was measured with {others}. Give the same again, or files of your own: "
            "--trials outputs/mine.jsonl --out outputs/mine.json.",
            file=sys.stderr,
        )
        return 2
    names = expand_names(options.tasks)
    splits = tuple(split.strip() for split in options.splits.split(","))
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    how = options.action_noise, not options.plain
    # Seed by seed, so that a run that is stopped has seen all tasks about equally often.
    able = [name for name in names if can_demonstrate(get_task(name))]
    jobs = [(name, split, seed, *how) for seed in seeds for split in splits for name in able]
    take_up(kept := options.out.with_suffix(KEPT), options.trials)
    if not options.report:
        if options.fresh:
            forget(options.trials, [key for key in read_trials(options.trials) if key[0] in names and key[3:] == how])
        done = {key for key, trial in read_trials(options.trials).items() if is_current(trial)}
        todo = [job for job in jobs if job not in done]
        print(f"{len(able)} of {len(names)} tasks have a demonstrator; {len(todo)} of {len(jobs)} trials to make")
        if todo:
            run(todo, options.trials, options.workers)
    # All that are there, also of seeds and splits that were not asked for this time.
    found = [t for t in read_trials(options.trials).values() if t.key[3:] == how and t.seed >= options.first_seed]
    trials = [trial for trial in found if is_current(trial)]
    if len(trials) < len(found):
        print(f"{len(found) - len(trials)} trials were made with other skills or declarations, and do not count")
        if len(trials) < (counted := trials_there(options.out)):  # nothing of what is committed is emptied
            print(
                f"demonstrators: {options.out} has {counted} trials, of which {len(trials)} would be left. It stays as "
                "it is. Give the same without --report for all of its tasks, which makes the others again, or "
                "--out outputs/mine.json.",
                file=sys.stderr,
            )
            return 2
    tasks = summary(trials, {name: can_demonstrate(get_task(name)) for name in task_names()})
    body = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy"),
        "settings": {
            **settings,
            "seeds_per_split": len({trial.seed for trial in trials}),
            "splits": [split for split in SPLITS if any(trial.split == split for trial in trials)],
        },
        "trials": len(trials),
        "commits": {c: sum(t.commit == c for t in trials) for c in sorted({t.commit for t in trials})},
        "ratios": ratios(tasks),
        "demonstrations_per_hour": per_hour(trials),
        "demonstrations_per_hour_of_kind": {
            kind: per_hour([trial for trial in trials if tasks[trial.task]["kind"] == kind])
            for kind in ("atomic", "composite")
        },
        "tasks": tasks,
    }
    print(text(body))
    common.write_result(options.out, "demonstrators", body)
    draw(tasks, picture := options.out.with_suffix(".png"))
    if trials:
        keep(trials, kept)
        options.out.with_suffix(".md").write_text(page(body, picture.name), encoding="utf-8")
    print(f"{options.out}, and beside it a page (.md), its picture (.png) and the trials ({KEPT})")
    return 0


def per_hour(trials: Sequence[Trial]) -> dict[str, float] | None:
    """Demonstrations that succeed, by the time that all trials took: of one process, and of all that worked."""
    if not trials:
        return None
    solved = sum(trial.success for trial in trials)
    return {
        "one_process": round(3600 * solved / sum(trial.wall_s for trial in trials), 1),
        "all_processes": round(3600 * solved / sum(trial.wall_s / trial.workers for trial in trials), 1),
    }


if __name__ == "__main__":
    sys.exit(main())
