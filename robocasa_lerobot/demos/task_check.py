"""What a task must pass to be offered: sound in both splits, and solved there by its demonstrator."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.checks.tasks import CHECK_SEEDS, check_task
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.jobs.as_completed import as_they_end


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
    """`check_task` on every seed; then the demonstrator on one seed after the other until it has solved one."""
    faults = check_task(task, split, seeds)
    failed: list[int] = []
    solved = None
    if can_demonstrate(get_task(task)):
        env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
        try:
            for seed in seeds:
                if record_episode(env, seed, varied=True).success:
                    solved = seed
                    break
                failed.append(seed)
        finally:
            env.close()
        if solved is None:
            faults.append(f"the demonstrator solved none of {len(failed)} seeds")
    return Checked(task, split, tuple(faults), solved, tuple(failed))


def check_all(
    tasks: Sequence[str], splits: Sequence[str], seeds: Sequence[int] = CHECK_SEEDS, *, workers: int = 1
) -> Iterator[Checked]:
    """Every task in every split, in the order in which processes finish."""
    jobs = [(task, split, seeds) for split in splits for task in tasks]
    yield from as_they_end(check, jobs, workers)
