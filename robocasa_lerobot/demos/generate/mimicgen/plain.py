"""An attempt as MimicGen makes it: subtasks one after the other, whatever comes of them, the base at rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import h5py
import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.demos.generate.course import BRIDGE, CONTACT, Course
from robocasa_lerobot.demos.generate.execute import hand_now, pose_command
from robocasa_lerobot.demos.generate.mimicgen.refs import name_here
from robocasa_lerobot.demos.generate.mimicgen.subtasks import (
    DatagenInfo,
    check_suits,
    read_datagen,
    targets,
)
from robocasa_lerobot.demos.generate.mimicgen.template import Subtask, Template
from robocasa_lerobot.demos.generate.sources.frames import body_pose
from robocasa_lerobot.demos.generate.sources.prepared import GROUP, HAND_IN_SITE
from robocasa_lerobot.demos.generate.sources.source import Stamp
from robocasa_lerobot.demos.generate.sources.transform import yaw_pose
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
    """Prepared demonstrations, and how they are taken."""

    template: Template
    infos: tuple[DatagenInfo, ...]


@lru_cache(maxsize=4)
def read_sources(path: Path, template: Template, first: int = 0, stamp: Stamp = ()) -> Sources:
    """Read what MimicGen or `prepare` has written.

    Args:
        path: file or folder.
        template: of their task.
        first: of each file only so many, the first ones; 0 takes all.
        stamp: of the files; others are read anew.

    Raises:
        UserError: none is prepared, or one does not suit the template.
    """
    infos: list[DatagenInfo] = []
    taken: Counter[Path] = Counter()
    for file, demo in demonstrations([path]):
        with h5py.File(file) as opened:
            group = opened[f"data/{demo}"]
            if GROUP in group and (not first or taken[file] < first):
                infos.append(_of_the_hand(read_datagen(len(infos), f"{file.stem}/{demo}", group[GROUP])))
                taken[file] += 1
    if not infos:
        raise UserError(f"{path}: no demonstration there has a {GROUP}. `robocasa-lerobot prepare {path}` writes it.")
    return suited(template, infos)


def _of_the_hand(info: DatagenInfo) -> DatagenInfo:
    """The same with the axes of the hand body, in which this robot's poses are given; files have the grip site's."""
    return replace(info, eef=info.eef @ HAND_IN_SITE, target=info.target @ HAND_IN_SITE)


def suited(template: Template, infos: Iterable[DatagenInfo]) -> Sources:
    """Demonstrations together with what they are taken by.

    Raises:
        UnknownNameError: one has nothing of a subtask's object_ref, or no such signal.
        UnfitSourcesError: a signal never rises, or an offset may put a subtask's end before its beginning.
    """
    found = Sources(template, tuple(infos))
    for info in found.infos:
        check_suits(info, template)  # before anything is made of them
    return found


def plain_episode(env: KitchenEnv, log: StageLog, sources: Sources, course: Course) -> Iterator[Array]:
    """Actions (12,), stored order, of an episode; it ends with the last subtask, and some steps of standing still.

    Raises:
        SkillError: it is over.
        UnknownNameError: the scene has nothing of a subtask's object_ref.
    """
    log.outcomes = [StageOutcome() for _ in env.declaration.stages]

    def begin(info: DatagenInfo, subtask: Subtask, span: tuple[int, int]) -> None:
        log.current = min(subtask.stage, len(log.outcomes) - 1)
        ref = subtask.object_ref and name_here(env, subtask.object_ref)
        row = {"source": info.name, "demo": info.number, "kind": "subtask", "ref": ref}
        course.used.append(row | {"steps": list(span)})

    gripper = -1.0
    wanted = targets(
        sources.infos,
        sources.template,
        course.rng,
        pose_of=lambda ref: pose_of(env, name_here(env, ref)),
        hand=lambda: hand_now(env),
        begin=begin,
    )
    for target in wanted:
        gripper = target.gripper
        course.label = (target.source, BRIDGE if target.source < 0 else CONTACT, target.step)
        command = pose_command(env, target.pose, gripper)
        course.clean.append(command.copy())
        noise = target.noise(course.rng)
        for where, part in zip(_ARM, (noise[:3], noise[3:]), strict=True):
            command[where] = np.clip(command[where] + part, -1.0, 1.0)
        yield command
    course.label = (-1, BRIDGE, -1)
    for _ in range(STILL_STEPS):
        course.clean.append(action(gripper=gripper))
        yield course.clean[-1]
    raise SkillError("the subtasks are over")


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
