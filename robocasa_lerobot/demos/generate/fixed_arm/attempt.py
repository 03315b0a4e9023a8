"""An attempt in the scene of such a file, its objects moved: MimicGen's way, in closed loop by the hand's pose."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.generate.fixed_arm.osc import ArmController
from robocasa_lerobot.demos.generate.fixed_arm.prepare import put_state
from robocasa_lerobot.demos.generate.mimicgen.subtasks import DatagenInfo, boundaries, carried, selected, with_offsets
from robocasa_lerobot.demos.generate.mimicgen.template import Subtask, Template
from robocasa_lerobot.demos.generate.sources.frames import body_pose
from robocasa_lerobot.demos.generate.sources.transform import command_to, interpolated
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
    spans = [with_offsets(boundaries(info, template), template, rng) for info in infos]
    gripper, last, chosen = -1.0, None, -1
    for number, subtask in enumerate(template.subtasks):
        ref = subtask.object_ref
        now = None if ref is None else body_pose(data, model.body(ref).id)
        if template.per_subtask or chosen < 0:
            chosen = selected(subtask, infos, [span[number] for span in spans], now, controller.hand(), rng)
        used.append(infos[chosen].number)
        first = template.first_pose or number == 0
        poses, commands = carried(infos[chosen], subtask, spans[chosen][number], now, first=first)
        start = last if last is not None and template.from_last_target else controller.hand()
        line = interpolated(start, poses[0], subtask.interpolation_steps)
        for pose in [*line[:-1], *[poses[0]] * subtask.fixed_steps]:
            yield _command(controller, pose, gripper, subtask, rng, on_the_line=True)
        for pose, gripper in zip(poses, commands.tolist(), strict=True):
            yield _command(controller, pose, gripper, subtask, rng, on_the_line=False)
        last = poses[-1]
    for _ in range(STILL_STEPS):
        yield np.array([0.0] * 6 + [gripper])


def _command(
    controller: ArmController,
    pose: Array,
    gripper: float,
    subtask: Subtask,
    rng: np.random.Generator,
    *,
    on_the_line: bool,
) -> Array:
    move, turn = command_to(pose, controller.hand())
    arm = np.concatenate([move, turn])
    if subtask.action_noise > 0.0 and (subtask.noise_on_the_line or not on_the_line):
        arm = arm + rng.normal(0.0, subtask.action_noise, 6)
    return np.array([*np.clip(arm, -1.0, 1.0), gripper])
