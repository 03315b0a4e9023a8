"""Generation: how often attempts succeed in kitchens that the sources are not from, task by task.

Sources are prepared demonstrations (`robocasa-lerobot demos`, then `prepare`). Every attempt is a line of the trials'
file, so that a run can be stopped and continued; nothing is left out of a rate, and an attempt that raises has failed.
The first tries alone are counted beside: what a single pass over the segments comes to.

    python benchmarks/generation.py --source sources/ --tasks OpenDrawer,CloseDrawer --attempts 10
    python benchmarks/generation.py --source sources/ --own              # in the sources' own kitchens
    python benchmarks/generation.py --source sources/ --select random --bridge line --base fixed
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import common

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.demos.generate.select import BASES, BRIDGES, SELECTIONS
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.source import sources_of
from robocasa_lerobot.evaluation.statistics.rates import wilson_interval
from robocasa_lerobot.progress import Bar

FIRST_SEED = 100_500  # development's; sources are from 100,000 on


@dataclass(frozen=True)
class Trial:
    """An attempt: `manner` says how it was made, `segments` the contacts it took, `sources` whose they were."""

    task: str
    seed: int
    manner: str
    success: bool
    steps: int
    seconds: float
    segments: int
    sources: tuple[int, ...]
    first_try: bool
    reason: str


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, required=True, help="folder of prepared demonstrations")
    parser.add_argument("--tasks", default="", help="names or sets (default: those that have a file there)")
    parser.add_argument("--attempts", type=int, default=10, help="of each task (default 10)")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"default {FIRST_SEED}")
    parser.add_argument("--own", action="store_true", help="in the sources' own scenes, once each")
    parser.add_argument("--select", choices=SELECTIONS, default="feasible")
    parser.add_argument("--base", choices=BASES, default="replan")
    parser.add_argument("--bridge", choices=BRIDGES, default="plan")
    parser.add_argument("--cap", type=float, default=0.2, help="as of `generate` (default 0.2)")
    parser.add_argument("--trials", type=Path, default=common.REPOSITORY / "outputs" / "generation.jsonl")
    parser.add_argument("--out", type=Path, default=common.RESULTS / "generation.md")
    return parser.parse_args(arguments)


def attempt(settings: GenerationSettings, seed: int, manner: str) -> Trial:
    """Make one attempt. Nothing that goes wrong ends the benchmark: it counts as a failure."""
    env, started = settings.make_env(), time.perf_counter()
    try:
        recording = settings.record(env, seed)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        return Trial(settings.task, seed, manner, False, 0, time.perf_counter() - started, 0, (), False, reason)
    finally:
        env.close()
    rows = recording.ep_meta["generation"]["segments"]
    told = [(row["kind"], row.get("part", row["ref"])) for row in rows]
    return Trial(
        task=settings.task,
        seed=seed,
        manner=manner,
        success=recording.success,
        steps=len(recording.actions),
        seconds=time.perf_counter() - started,
        segments=len(rows),
        sources=tuple(row["demo"] for row in rows),
        first_try=recording.success and len(set(told)) == len(told),
        reason=recording.reason,
    )


def table(trials: Sequence[Trial], source: Path) -> str:
    """Markdown: one line for each task, and one for all."""
    lines = [
        "| task | sources | kept | rate | 95 % | first try | s an attempt | most used source |",
        "|---|--:|--:|--:|---|--:|--:|--:|",
    ]
    for name in [*dict.fromkeys(trial.task for trial in trials), "all"]:
        mine = [trial for trial in trials if name in (trial.task, "all")]
        kept = [trial for trial in mine if trial.success]
        low, high = wilson_interval(len(kept), len(mine))
        used = Counter(number for trial in kept for number in trial.sources)
        most = f"{max(used.values()) / sum(used.values()):.0%}" if used and name != "all" else ""
        count = len(sources_of(source, name)) if name != "all" else ""
        lines.append(
            f"| {name} | {count} | {len(kept)} of {len(mine)} | {len(kept) / len(mine):.0%} | "
            f"{low:.0%} to {high:.0%} | {sum(trial.first_try for trial in mine) / len(mine):.0%} | "
            f"{sum(trial.seconds for trial in mine) / len(mine):.1f} | {most} |"
        )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the missing attempts, and write the table."""
    args = parse(arguments)
    names = expand_names(args.tasks) if args.tasks else tuple(sorted(path.stem for path in args.source.glob("*.hdf5")))
    manner = f"{args.select} {args.base} {args.bridge} cap {args.cap:g}" + (" own" if args.own else "")
    lines = args.trials.read_text().splitlines() if args.trials.exists() else []
    done = [Trial(**json.loads(line) | {"sources": tuple(json.loads(line)["sources"])}) for line in lines]
    known = {(trial.task, trial.seed, trial.manner): trial for trial in done}
    wanted = []
    for name in names:
        settings = GenerationSettings(
            name, 1, split="pretrain", varied=False, source=str(args.source),
            select=args.select, base=args.base, bridge=args.bridge, cap=args.cap,
        )  # fmt: skip
        own = [one.seed for one in sources_of(args.source, name)]
        seeds = own if args.own else range(args.first_seed, args.first_seed + args.attempts)
        wanted += [(settings, seed) for seed in seeds]
    args.trials.parent.mkdir(parents=True, exist_ok=True)
    with args.trials.open("a") as file:
        for settings, seed in Bar(
            [one for one in wanted if (one[0].task, one[1], manner) not in known], unit="attempt"
        ):
            trial = attempt(settings, seed, manner)
            known[trial.task, trial.seed, manner] = trial
            file.write(json.dumps(asdict(trial)) + "\n")
            file.flush()
    chosen = [known[settings.task, seed, manner] for settings, seed in wanted]
    where = "the sources' own scenes" if args.own else f"seeds from {args.first_seed} on"
    text = f"# Generated attempts: {manner}\n\nPretraining kitchens, {where}.\n\n{table(chosen, args.source)}\n"
    args.out.write_text(text)
    print(text)


if __name__ == "__main__":
    main()
