"""What a task must pass to be offered: sound in both splits, and solved there by its demonstrator."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import robocasa_lerobot
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.checks.tasks import CHECK_SEEDS, check_task
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.errors import OF_THE_MACHINE
from robocasa_lerobot.jobs.as_completed import as_they_end
from robocasa_lerobot.jsonl import read_whole_lines


@dataclass(frozen=True)
class Checked:
    """What was found out about a task in a split.

    Attributes:
        faults: in words; none is a pass.
        solved: first seed that the demonstrator solved; None where it solved none, or where there is no demonstrator.
        failed: seeds that it failed before.
    """

    task: str
    split: str
    faults: tuple[str, ...]
    solved: int | None
    failed: tuple[int, ...]


def check(task: str, split: str, seeds: Sequence[int] = CHECK_SEEDS) -> Checked:
    """`check_task` on every seed; then the demonstrator on one seed after the other until it has solved one.

    What either raises is a fault: the other tasks are checked all the same.
    """
    faults: list[str] = []
    failed: list[int] = []
    solved = None
    try:
        faults += check_task(task, split, seeds)
        if can_demonstrate(get_task(task)):
            solved = _first_solved(task, split, seeds, failed)
            if solved is None:
                faults.append(f"the demonstrator solved none of {len(failed)} seeds")
    except OF_THE_MACHINE:
        raise
    except Exception as error:
        faults.append(f"{type(error).__name__}: {error}")
    return Checked(task, split, tuple(faults), solved, tuple(failed))


def _first_solved(task: str, split: str, seeds: Sequence[int], failed: list[int]) -> int | None:
    """The first seed that the demonstrator solves; those before it come into `failed`."""
    with contextlib.closing(KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)) as env:
        for seed in seeds:
            if record_episode(env, seed, varied=True).success:
                return seed
            failed.append(seed)
    return None


def check_all(
    tasks: Sequence[str],
    splits: Sequence[str],
    seeds: Sequence[int] = CHECK_SEEDS,
    *,
    workers: int = 1,
    log: Path | None = None,
) -> Iterator[Checked]:
    """Every task in every split, in the order in which processes finish.

    Args:
        tasks: names.
        splits: names.
        seeds: tried in each.
        workers: processes.
        log: file that results are appended to as they come, a line each; those that it holds for the same seeds and
            the same code, of declarations, kitchens and skills, come first and are not made again.
    """
    before = [] if log is None else _logged(log, seeds)
    known = {(one.task, one.split): one for one in before}
    jobs = [(task, split, seeds) for split in splits for task in tasks]
    yield from (known[task, split] for task, split, _ in jobs if (task, split) in known)
    todo = [job for job in jobs if job[:2] not in known]
    for one in as_they_end(check, todo, workers):
        if log is not None:
            with log.open("a", encoding="utf-8") as file:
                file.write(json.dumps({**asdict(one), "seeds": list(seeds), "code": code_digest()}) + "\n")
        yield one


def _logged(log: Path, seeds: Sequence[int]) -> list[Checked]:
    log.parent.mkdir(parents=True, exist_ok=True)
    return [
        Checked(row["task"], row["split"], tuple(row["faults"]), row["solved"], tuple(row["failed"]))
        for row in read_whole_lines(log)
        if row["seeds"] == list(seeds) and row.get("code") == code_digest()
    ]


@functools.cache
def code_digest() -> str:
    """What tells the code that tasks are checked with from what it was before it was mended."""
    package = Path(robocasa_lerobot.__file__).parent
    digest = hashlib.sha256()
    for folder in ("demos", "envs"):
        for path in sorted((package / folder).rglob("*")):
            if path.suffix in (".py", ".yaml", ".json"):
                digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]
