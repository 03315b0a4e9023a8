"""An attempt in the scene of such a file, its objects moved: MimicGen's way, in closed loop by the hand's pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.generate.fixed_arm.osc import ArmController
from robocasa_lerobot.demos.generate.fixed_arm.prepare import put_state
from robocasa_lerobot.demos.generate.mimicgen.subtasks import DatagenInfo, targets
from robocasa_lerobot.demos.generate.mimicgen.template import Template
from robocasa_lerobot.demos.generate.sources.frames import body_pose
from robocasa_lerobot.demos.generate.sources.transform import command_to
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS

STILL_STEPS = 30  # at the end, for what is still moving


@dataclass(frozen=True)
class ArmScene:
    """A scene of a file.

    Attributes:
        model: of it.
        start: a recorded first state (1 + nq + nv,).
        solved: whether the task is done.
    """

    model: mujoco.MjModel
    start: Array
    solved: Callable[[mujoco.MjModel, mujoco.MjData], bool]

    def begin(self, moved: Callable[[mujoco.MjModel, Array], Array] = lambda model, state: state) -> mujoco.MjData:
        """The start, with its objects where `moved` puts them in the state."""
        data = mujoco.MjData(self.model)
        put_state(self.model, data, moved(self.model, self.start.copy()))
        return data


@dataclass(frozen=True)
class Attempt:
    """What came of an attempt of T steps: whether the goal held to its end, and ever; states and actions.

    Attributes:
        success: whether it held for the last `SUCCESS_HOLD_STEPS`.
        ever: whether it held in any step, which is what MimicGen counts.
        states: (T, 1 + nq + nv).
        actions: (T, 7).
        sources: numbers of the sources, subtask by subtask.
    """

    success: bool
    ever: bool
    states: Array
    actions: Array
    sources: tuple[int, ...]


def generate(
    scene: ArmScene, data: mujoco.MjData, infos: Sequence[DatagenInfo], template: Template, rng: np.random.Generator
) -> Attempt:
    """Carry the template's subtasks over, from where `data` stands.

    Raises:
        UserError: a source does not suit the template.
    """
    controller = ArmController(scene.model, data)
    used: list[int] = []
    states, actions, held = [], [], []
    for action in _actions(scene.model, data, controller, infos, template, rng, used):
        states.append(np.concatenate([[data.time], data.qpos, data.qvel]))
        actions.append(action)
        controller.step(action)
        held.append(scene.solved(scene.model, data))
    return Attempt(
        success=len(held) >= SUCCESS_HOLD_STEPS and all(held[-SUCCESS_HOLD_STEPS:]),
        ever=any(held),
        states=np.array(states),
        actions=np.array(actions),
        sources=tuple(used),
    )


def _actions(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    controller: ArmController,
    infos: Sequence[DatagenInfo],
    template: Template,
    rng: np.random.Generator,
    used: list[int],
) -> Iterator[Array]:
    gripper = -1.0
    wanted = targets(
        infos,
        template,
        rng,
        pose_of=lambda ref: body_pose(data, model.body(ref).id),
        hand=controller.hand,
        begin=lambda info, subtask, span: used.append(info.number),
    )
    for target in wanted:
        gripper = target.gripper
        arm = np.concatenate(command_to(target.pose, controller.hand())) + target.noise(rng)
        yield np.array([*np.clip(arm, -1.0, 1.0), gripper])
    for _ in range(STILL_STEPS):
        yield np.array([0.0] * 6 + [gripper])
