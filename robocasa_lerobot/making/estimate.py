"""How long our demonstrators and the conversion take, and what comes of it on disk: measured means, no promises.

On two cores of an AMD EPYC without a GPU: demonstrations of 72 tasks by `benchmarks/demonstrators.py`, kind by kind
(`benchmarks/results/demonstrators_alone.json`), drawing and encoding by `make bench-convert` (states, in two
processes: `benchmarks/results/convert_speed.json`), sizes of three
tasks' datasets at 128 pixels that `robocasa-lerobot data --make` made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.contract import IMAGE_SIZE
from robocasa_lerobot.data.registry.recipes import REPLAY
from robocasa_lerobot.making.needs import Need

# Of one core, failed attempts included; and the mean of the tasks' medians of steps, of 50 ms each.
SECONDS_PER_DEMONSTRATION: Mapping[str, float] = {"atomic": 0.71, "composite": 7.6}
STEPS_PER_DEMONSTRATION: Mapping[str, int] = {"atomic": 165, "composite": 950}
# Of one core: a source is carried out again, and what it touches is noted (18 demonstrations of three tasks).
PREPARING_SECONDS_PER_STEP = 0.003
# Of one core, with three cameras, by the height and width of their pictures.
STEPS_PER_SECOND: Mapping[int, float] = {64: 167.0, 256: 94.0}
# Of one core, a small policy that drives before it is corrected (`benchmarks/results/scaling.json`: trials).
DRIVEN_STEPS_PER_SECOND, DRIVEN_STEPS = 47.0, 175
BYTES_PER_STEP = 6_000
BYTES_PER_EPISODE = 500_000  # scene, textures and states, kept so that it can be drawn again


@dataclass(frozen=True)
class Estimate:
    """Of several datasets: demonstrations, steps, hours on so many cores, and bytes.

    Attributes:
        demonstrations, frames: in all.
        recording_hours, converting_hours: on `cores`; of downloads None.
        size: bytes on disk; of downloads None.
        cores: of this machine, or as many as asked for.
    """

    demonstrations: int
    frames: int
    recording_hours: float
    converting_hours: float
    size: int
    cores: int


def estimate(needs: Iterable[Need], cores: int) -> Estimate:
    """What making the datasets takes, their sources among it; those that are drawn again are not recorded."""
    facts = task_facts()
    demonstrations = frames = 0
    recording_seconds = converting_seconds = 0.0
    for need in needs:
        count = need.demonstrations or 0
        kind = facts[need.task].kind if need.task in facts else "atomic"  # of somebody's own tasks nothing is known
        demonstrations += count
        driven = 0 if need.policy is None else count * DRIVEN_STEPS
        steps = count * STEPS_PER_DEMONSTRATION[kind] + driven
        recording_seconds += driven / DRIVEN_STEPS_PER_SECOND
        frames += steps
        converting_seconds += steps * _seconds_per_step(need)
        if need.redrawn is None:
            recording_seconds += count * SECONDS_PER_DEMONSTRATION[kind] + _seconds_of_sources(need, kind)
    return Estimate(
        demonstrations,
        frames,
        recording_seconds / cores / 3600,
        converting_seconds / cores / 3600,
        frames * BYTES_PER_STEP + demonstrations * BYTES_PER_EPISODE,
        cores,
    )


def _seconds_per_step(need: Need) -> float:
    """Of one core, to draw and encode, by the number of pixels; larger pictures than were measured take more."""
    recipe = None if need.made is None else need.made.make
    pixels = IMAGE_SIZE if recipe is None else recipe.image_size
    (small, small_rate), (large, large_rate) = sorted(STEPS_PER_SECOND.items())
    share = max(0.0, (pixels**2 - small**2) / (large**2 - small**2))
    return (1 - share) / small_rate + share / large_rate


def _seconds_of_sources(need: Need, kind: str) -> float:
    """Of one core: to record what is multiplied, and to prepare it unless it is only repeated."""
    recipe = None if need.made is None else need.made.make
    if recipe is None:
        return 0.0
    steps = 0 if recipe.method == REPLAY else STEPS_PER_DEMONSTRATION[kind]
    each = SECONDS_PER_DEMONSTRATION[kind] + PREPARING_SECONDS_PER_STEP * steps
    return recipe.sources_for(need.demonstrations or 1) * each


def published_hours(needs: Iterable[Need]) -> float:
    """Hours of demonstrations in published datasets: people's by the mean length of each task's, MimicGen's by its own.

    Source: the benchmark's table of data (`benchmark/published/data.json`).
    """
    facts = task_facts()
    (multiplied,) = (row for row in published.read("data")["rows"] if row["source"] == "mg")

    def seconds(need: Need) -> float:
        if need.source == multiplied["source"]:
            return float(multiplied["hours"] * 3600 / multiplied["demonstrations"])
        return facts[need.task].human_seconds if need.task in facts else 0.0

    return sum((need.demonstrations or 0) * seconds(need) for need in needs) / 3600
