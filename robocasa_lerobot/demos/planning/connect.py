"""RRT-Connect: a joint path round what the straight line meets, then shortened.

J. Kuffner and S. LaValle, "RRT-Connect: an efficient approach to single-query path planning" (2000). Two trees grow
from the start and from the goal; a line is tested as one batch of configurations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import Array

STEP_RAD = 0.35  # by which a tree grows at once, of the joint that turns most
TEST_RAD = 0.06  # between tested configurations
ITERATIONS, SHORTCUTS = 80, 30
GOAL_BIAS_RAD = 1.2  # samples lie about the line from start to goal, as far as this from it
EVERYWHERE = 0.25  # share of the samples that lie anywhere

Free = Callable[[Array], NDArray[np.bool_]]
Project = Callable[[Array], Array]


@dataclass
class _Tree:
    nodes: list[Array]
    parents: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, joints: Array) -> int:
        return int(np.argmin(((np.array(self.nodes) - joints) ** 2).sum(axis=1)))

    def add(self, joints: Array, parent: int) -> int:
        self.nodes.append(joints)
        self.parents.append(parent)
        return len(self.nodes) - 1

    def branch(self, index: int) -> list[Array]:
        """From the root to a node."""
        found = []
        while index >= 0:
            found.append(self.nodes[index])
            index = self.parents[index]
        return found[::-1]


def connect(
    start: Array,
    goal: Array,
    free: Free,
    low: Array,
    high: Array,
    generator: np.random.Generator,
    *,
    iterations: int = ITERATIONS,
    shortcuts: int = SHORTCUTS,
    project: Project | None = None,
) -> Array | None:
    """A joint path (k, n) from after the start to the goal itself, both (n,) radians, or None.

    Args:
        start: where the arm is; it is not tested.
        goal: where it is to come.
        free: whether each of configurations (N, n) may be taken, (N,).
        low: limits (n,), radians.
        high: the same.
        generator: the path is a function of it and of the rest.
        iterations: samples after which it gives up.
        shortcuts: attempts to leave out a part of what was found.
        project: brings a sample (n,) to where a condition holds that few configurations meet by chance.
    """
    if not free(goal[None])[0]:
        return None
    if _clear(start, goal, free):
        return goal[None].copy()
    here, there = _Tree([start]), _Tree([goal])
    for _ in range(iterations):
        sample = _sample(start, goal, low, high, generator)
        if project is not None:
            sample = project(sample)
        new = _extend(here, sample, free, once=True)
        if new is not None:
            other = _extend(there, here.nodes[new], free, once=False)
            if other is not None and np.array_equal(there.nodes[other], here.nodes[new]):
                path = [*here.branch(new), *there.branch(other)[-2::-1]]
                if path[0] is not start:
                    path.reverse()
                return np.array(_shorten(path, free, generator, shortcuts)[1:])
        here, there = there, here
    return None


def _sample(start: Array, goal: Array, low: Array, high: Array, generator: np.random.Generator) -> Array:
    if generator.random() < EVERYWHERE:
        return generator.uniform(low, high)
    near = start + generator.random() * (goal - start)
    return np.clip(near + generator.uniform(-GOAL_BIAS_RAD, GOAL_BIAS_RAD, size=len(start)), low, high)


def _extend(tree: _Tree, towards: Array, free: Free, *, once: bool) -> int | None:
    """Grow a tree towards a configuration, one step or until it is there or meets something; the last new node."""
    at = tree.nearest(towards)
    begin = tree.nodes[at]
    away = float(np.abs(towards - begin).max())
    steps = max(int(np.ceil(away / STEP_RAD)), 1)
    ends = [begin + (towards - begin) * (step / steps) for step in range(1, steps)] + [towards]
    last = None
    for end in ends[:1] if once else ends:
        if not _clear(tree.nodes[at], end, free):
            break
        last = at = tree.add(end, at)
    return last


def _clear(begin: Array, end: Array, free: Free) -> bool:
    """Whether a line is free, its end included."""
    count = max(int(np.ceil(float(np.abs(end - begin).max()) / TEST_RAD)), 1)
    shares = np.arange(count, 0, -1)[:, None] / count
    return bool(free(begin + shares * (end - begin)).all())


def _shorten(path: list[Array], free: Free, generator: np.random.Generator, attempts: int) -> list[Array]:
    """Leave out what lies between two nodes that a free line joins."""
    for _ in range(attempts):
        if len(path) < 3:
            break
        first, last = sorted(int(i) for i in generator.choice(len(path), size=2, replace=False))
        if last - first > 1 and _clear(path[first], path[last], free):
            path = [*path[: first + 1], *path[last:]]
    return path
