"""How far anybody has come in a task: its stages' conditions, met in order, whoever moves the robot."""

from __future__ import annotations

import mujoco

from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.stage_text import stage_text
from robocasa_lerobot.envs.tasks.task import BoundTask


class StageProgress:
    """Counts the stages of an episode whose conditions have been met, one after the other.

    A stage counts from the moment when its condition holds after all before it have counted; that it comes undone later
    takes nothing away. An episode that reaches the goal has met all stages, whatever course it took.

    Attributes:
        total: stages of the episode.
        met: stages that have counted.
        given: those of them that held at the start already, before anybody moved.
    """

    def __init__(self, task: BoundTask, scene: Scene, data: mujoco.MjData) -> None:
        self._scene, self._stages = scene, task.stages
        self._conditions = [stage_condition(task, stage) for stage in task.stages]
        self.total = len(task.stages)
        self.met = 0
        self.note(data, success=False)
        self.given = self.met

    def note(self, data: mujoco.MjData, success: bool) -> None:
        """Look at the state after a step; `success`: the goal holds in it."""
        if success:
            self.met = self.total
        # The goal is the condition of an only stage, and has been asked already.
        while 1 < self.total > self.met and self._conditions[self.met].evaluate(self._scene, data, {}):
            self.met += 1

    @property
    def next_text(self) -> str | None:
        """What the first stage that has not counted is called; None where all have."""
        return None if self.met == self.total else stage_text(self._stages[self.met], self._scene)
