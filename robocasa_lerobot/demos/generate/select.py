"""Which sources' segments come into question for the next contact, and how plainly they are joined.

`feasible` leaves all of them to the planner, which takes the one whose whole segment the arm carries out best. The
others are MimicGen's: one is drawn at random, or among the few whose object, or whose first hand pose, lies nearest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.generate.sources.transform import inverse
from robocasa_lerobot.demos.motion import Array, axis_angle

NEAREST = 3  # among which one is drawn
SELECTIONS = ("feasible", "random", "nearest_object", "nearest_robot")
BASES = ("replan", "copy", "fixed")
BRIDGES = ("plan", "line")
LINE_STEPS = 5  # of a bridge along a line, as published


@dataclass(frozen=True)
class Manner:
    """How segments are chosen, where the base stands for them, and how they are joined.

    Attributes:
        select: one of `SELECTIONS`.
        base: `replan` stands where the sources' segments are reached best, `copy` only as the source stood, `fixed`
            drives to no segment, but along with one whose base drove.
        bridge: `plan` leads the arm round obstacles, `line` straight there.
    """

    select: str = "feasible"
    base: str = "replan"
    bridge: str = "plan"


def narrowed[T](
    options: Sequence[T],
    manner: Manner,
    rng: np.random.Generator,
    *,
    source: Callable[[T], int],
    object_change: Callable[[T], Array],
    first_pose: Callable[[T], Array],
    hand: Array,
) -> list[T]:
    """Those options that a way of selecting leaves; options of one source stay together.

    Args:
        options: segments as they would be carried out.
        manner: how they are chosen.
        rng: of the draw.
        source: number of an option's source.
        object_change: by what (4, 4) the thing it is about lies elsewhere before the robot than before the source's.
        first_pose: hand pose (4, 4) that an option begins with here.
        hand: pose (4, 4) of the hand now.
    """
    if manner.select == "feasible" or not options:
        return list(options)
    far: dict[int, float] = {}
    for option in options:
        number = source(option)
        if manner.select == "nearest_object":
            distance = pose_distance(np.eye(4), object_change(option))
        elif manner.select == "nearest_robot":
            distance = pose_distance(hand, first_pose(option))
        else:
            distance = 0.0
        far[number] = min(distance, far.get(number, np.inf))
    numbers = sorted(far, key=lambda number: (far[number], number))
    if manner.select != "random":
        numbers = numbers[:NEAREST]
    drawn = numbers[int(rng.integers(len(numbers)))]
    return [option for option in options if source(option) == drawn]


def pose_distance(one: Array, other: Array, weights: tuple[float, float] = (1.0, 1.0)) -> float:
    """Metres plus radians between two poses (4, 4), weighted: MimicGen's measure, whose own weights are 1."""
    change = inverse(one) @ other
    metres, radians = np.linalg.norm(change[:3, 3]), np.linalg.norm(axis_angle(change[:3, :3]))
    return float(weights[0] * metres + weights[1] * radians)
