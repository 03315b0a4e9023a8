"""What a recording came to, as a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recording import RecordingResult
from robocasa_lerobot.wilson import wilson_interval

_REASONS = 3


def print_summary(results: Sequence[RecordingResult]) -> int:
    """Print a line for each task and the most frequent reasons of failures; 1 if a task was given up, else 0.

    Rates have Wilson intervals of their own; that of all tasks counts every attempt alike.
    """
    width = max(len(result.task) for result in results)
    header = f"{'task':<{width}}  episodes   steps  s/episode  attempts  succeeded           file"
    print(f"{header}\n{'-' * len(header)}")
    for result in results:
        length = f"{result.steps / contract.CONTROL_HZ / result.episodes:.1f}" if result.episodes else "-"
        rate = _rate(result.tried - len(result.failures), result.tried)
        where = "given up" if result.gave_up else str(result.path)
        print(
            f"{result.task:<{width}}  {result.episodes:>8}  {result.steps:>6}  {length:>9}  {result.tried:>8}  "
            f"{rate:<18}  {where}"
        )
    if len(results) > 1:
        tried = sum(result.tried for result in results)
        failed = sum(len(result.failures) for result in results)
        print(
            f"{'all':<{width}}  {sum(r.episodes for r in results):>8}  {sum(r.steps for r in results):>6}  {'':>9}  "
            f"{tried:>8}  {_rate(tried - failed, tried)}"
        )
    for result in results:
        if result.failures:
            print(f"\n{result.task} failed {len(result.failures)} times:")
        for reason, seeds in _reasons(result):
            shown = ", ".join(map(str, seeds[:5])) + (", ..." if len(seeds) > 5 else "")
            print(f"  {len(seeds)} x {reason} (seeds {shown})")
    for result in results:
        if result.gave_up:
            print(f"\n{result.gave_up}")
    return 1 if any(result.gave_up for result in results) else 0


def _rate(succeeded: int, tried: int) -> str:
    """A rate with its Wilson interval."""
    if not tried:
        return "-"
    low, high = wilson_interval(succeeded, tried)
    return f"{succeeded / tried:.0%} ({low:.0%} to {high:.0%})"


def _reasons(result: RecordingResult) -> list[tuple[str, list[int]]]:
    """The most frequent reasons, with the terms that did not hold, and their seeds."""
    said = [
        (failure.reason or "the goal does not hold at the end")
        + (f" [false: {', '.join(failure.false_terms)}]" if failure.false_terms else "")
        for failure in result.failures
    ]
    return [
        (reason, [failure.seed for failure, other in zip(result.failures, said, strict=True) if other == reason])
        for reason, _ in Counter(said).most_common(_REASONS)
    ]
