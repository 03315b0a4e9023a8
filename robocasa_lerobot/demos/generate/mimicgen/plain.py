"""An attempt as MimicGen makes it: subtasks one after the other, whatever comes of them, the base at rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.generate.course import BRIDGE, CONTACT, Course
from robocasa_lerobot.demos.generate.execute import hand_now, pose_command
from robocasa_lerobot.demos.generate.mimicgen.subtasks import (
    DatagenInfo,
    boundaries,
    carried,
    read_datagen,
    selected,
    with_offsets,
)
from robocasa_lerobot.demos.generate.mimicgen.template import Subtask, Template
from robocasa_lerobot.demos.generate.sources.frames import body_pose
from robocasa_lerobot.demos.generate.sources.prepared import GROUP
from robocasa_lerobot.demos.generate.sources.transform import interpolated, yaw_pose
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.replay import demonstrations
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.stages import StageLog, StageOutcome
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UnknownNameError, UserError

STILL_STEPS = 30  # at the end, for what falls and settles: a goal that has to hold needs 15
_ARM = [contract.ACTION_SLICES[f"end_effector_{what}"] for what in ("position", "rotation")]


@dataclass(frozen=True)
class Sources:
    """Prepared demonstrations, where the subtasks of each end, and how they are taken."""

    template: Template
    infos: tuple[DatagenInfo, ...]
    ends: tuple[tuple[int, ...], ...]


@lru_cache(maxsize=4)
def read_sources(path: Path, template: Template, names: tuple[str, ...] = ()) -> Sources:
    """Read what MimicGen or `prepare` has written.

    Args:
        path: file or folder.
        template: of their task.
        names: files and demonstrations that are wanted; none means all.

    Raises:
        UserError: none is prepared, or one does not suit the template.
    """
    infos: list[DatagenInfo] = []
    for file, demo in demonstrations([path]):
        name = f"{file.stem}/{demo}"
        with h5py.File(file) as opened:
            group = opened[f"data/{demo}"]
            if GROUP in group and (not names or name in names):
                infos.append(read_datagen(len(infos), name, group[GROUP]))
    if not infos:
        raise UserError(f"{path}: no demonstration there has a {GROUP}. `robocasa-lerobot prepare {path}` writes it.")
    return Sources(template, tuple(infos), tuple(tuple(boundaries(info, template)) for info in infos))


def plain_episode(env: KitchenEnv, log: StageLog, sources: Sources, course: Course) -> Iterator[Array]:
    """Actions (12,), stored order, of an episode; it ends with the last subtask, and some steps of standing still.

    Raises:
        SkillError: it is over.
        UnknownNameError: the scene has nothing of a subtask's object_ref.
    """
    log.outcomes = [StageOutcome() for _ in env.declaration.stages]
    template, rng = sources.template, course.rng
    spans = [with_offsets(ends, template, rng) for ends in sources.ends]
    gripper, last, chosen = -1.0, None, -1
    for number, subtask in enumerate(template.subtasks):
        now = None if subtask.object_ref is None else pose_of(env, subtask.object_ref)
        if template.per_subtask or chosen < 0:
            own = [span[number] for span in spans]
            chosen = selected(subtask, sources.infos, own, now, hand_now(env), rng)
        info, span = sources.infos[chosen], spans[chosen][number]
        row = {"source": info.name, "demo": info.number, "kind": "subtask", "ref": subtask.object_ref}
        course.used.append(row | {"steps": list(span)})
        first = template.first_pose or number == 0
        poses, commands = carried(info, subtask, span, now, first=first)
        start = last if last is not None and template.from_last_target else hand_now(env)
        line = interpolated(start, poses[0], subtask.interpolation_steps)
        course.label = (-1, BRIDGE, -1)
        for pose in [*line[:-1], *[poses[0]] * subtask.fixed_steps]:
            yield _noised(pose_command(env, pose, gripper), subtask, rng, on_the_line=True)
        for step, (pose, gripper) in enumerate(zip(poses, commands.tolist(), strict=True)):
            course.label = (info.number, CONTACT, span[0] + max(0, step - first))
            yield _noised(pose_command(env, pose, gripper), subtask, rng, on_the_line=False)
        last = poses[-1]
    course.label = (-1, BRIDGE, -1)
    for _ in range(STILL_STEPS):
        yield action(gripper=gripper)
    raise SkillError("the subtasks are over")


def _noised(command: Array, subtask: Subtask, rng: np.random.Generator, *, on_the_line: bool) -> Array:
    if subtask.action_noise > 0.0 and (subtask.noise_on_the_line or not on_the_line):
        for where in _ARM:
            command[where] = np.clip(command[where] + rng.normal(0.0, subtask.action_noise, 3), -1.0, 1.0)
    return command


def pose_of(env: KitchenEnv, ref: str) -> Array:
    """Pose (4, 4) of what a template calls by a name: an object, a fixture's role, or a part of one, `drawer.box`.

    Raises:
        UnknownNameError: there is nothing of that name.
    """
    scene = env.scene
    if ref in scene.objects:
        return body_pose(env.data, env.model.body(ref).id)
    role, _, part = ref.partition(".")
    if role in scene.roles:
        fixture = scene.fixtures[scene.roles[role]]
        if not part:
            x, y, z = fixture.pos
            return yaw_pose(x, y, fixture.yaw, z)
        return body_pose(env.data, env.model.body(f"{fixture.name}_{part}").id)
    names = {env.model.body(body).name for body in range(env.model.nbody)}
    if ref in names:
        return body_pose(env.data, env.model.body(ref).id)
    raise UnknownNameError("object_ref", ref, [*scene.objects, *scene.roles])
