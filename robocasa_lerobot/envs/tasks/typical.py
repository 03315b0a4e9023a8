"""Goal and stages of a task for readers that have no scene: pages, lists, and the question which skills it needs."""

from __future__ import annotations

import functools

from robocasa_lerobot.envs.predicates.logic import Goal
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.tasks.task import BoundTask, Stage, Task, possible_stages

_SPLIT, _SEED = "target", 0


def stages_of(task: Task) -> tuple[Stage, ...]:
    """All stages that a task may have; where they are a function of the scene, those of one scene."""
    return _in_one_scene(_Named(task)).stages if callable(task.stages) else possible_stages(task.stages)


def goal_of(task: Task) -> Goal:
    """The goal of a task; where it is a function of the scene, that of one scene."""
    return task.goal if isinstance(task.goal, Goal) else _in_one_scene(_Named(task)).goal


class _Named:
    """A task as a key: the mappings in it have no hash."""

    def __init__(self, task: Task) -> None:
        self.task = task

    def __hash__(self) -> int:
        return hash(self.task.name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Named) and self.task is other.task


@functools.lru_cache(maxsize=512)
def _in_one_scene(named: _Named) -> BoundTask:
    return named.task.bound(build_scene(named.task, _SPLIT, _SEED))
