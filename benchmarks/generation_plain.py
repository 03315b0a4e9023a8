"""Plain MimicGen, as its paper and RoboCasa's use of it have it: what ours is measured beside.

Every subtask of a source is carried over whole: T_new = T_object_now inv(T_object_source) T_target, with the object's
pose taken once, when the subtask begins; subtasks are joined by five points on a line; of the sources one of the five
whose first hand pose lies nearest is drawn for each subtask; the base stands still. A. Mandlekar et al., "MimicGen"
(2023); RoboCasa's settings: `nearest_neighbor_interpolation`, transform_first_robot_pose, select_src_per_subtask.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from robocasa_lerobot.demos.generate.execute import hand_now, pose_command
from robocasa_lerobot.demos.generate.select import LINE_STEPS, pose_distance
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.frames import body_pose, parts_of
from robocasa_lerobot.demos.generate.sources.segments import PART, PICK
from robocasa_lerobot.demos.generate.sources.source import Piece, Source, sources_of
from robocasa_lerobot.demos.generate.sources.transform import carried_over, interpolated, yaw_pose
from robocasa_lerobot.demos.motion import Array, action
from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.stages import StageLog, StageOutcome
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

NEAREST = 5  # RoboCasa's; MimicGen's own is 3
STILL_STEPS = 30  # at the end, for what falls and settles: a goal that has to hold needs 15
_STREAM = 11


def plain_attempt(settings: GenerationSettings, env: KitchenEnv, seed: int) -> Recording:
    """Make the attempt of a seed as MimicGen would; its noise is that of the settings."""
    sources, rng = sources_of(settings.folder, settings.task), np.random.default_rng([seed, _STREAM])
    return settings.labelled_episode(env, seed, lambda env, style, log: _carried_over(env, log, sources, rng))


def _carried_over(
    env: KitchenEnv, log: StageLog, sources: Sequence[Source], rng: np.random.Generator
) -> Iterator[Array]:
    log.outcomes = [StageOutcome() for _ in env.declaration.stages]
    alike = _of_one_kind(sources)
    gripper = -1.0
    for number in range(len(alike[0].segments)):
        pieces = [Piece(source, source.segments[number]) for source in alike]
        ways = [_way(env, piece) for piece in pieces]
        nearest = np.argsort([pose_distance(hand_now(env), first) for first, _ in ways], kind="stable")[:NEAREST]
        drawn = int(rng.choice(nearest))
        first, targets = ways[drawn]
        commands = pieces[drawn].data.gripper[pieces[drawn].segment.begin : pieces[drawn].segment.end]
        for pose in interpolated(hand_now(env), first, LINE_STEPS):
            yield pose_command(env, pose, gripper)
        for pose, gripper in zip(targets, commands.tolist(), strict=True):
            yield pose_command(env, pose, gripper)
    for _ in range(STILL_STEPS):
        yield action(gripper=gripper)
    raise SkillError("the sources' subtasks are over")


def _of_one_kind(sources: Sequence[Source]) -> list[Source]:
    """Those with the most frequent sequence of subtasks: MimicGen knows one for each task."""

    def kinds(source: Source) -> tuple[tuple[str, str], ...]:
        return tuple((one.kind, one.ref) for one in source.segments)

    usual, _ = Counter(kinds(source) for source in sources if source.segments).most_common(1)[0]
    return [source for source in sources if kinds(source) == usual]


def _way(env: KitchenEnv, piece: Piece) -> tuple[Array, Array]:
    """First hand pose (4, 4) and targets (T, 4, 4) of a subtask, relative to where its object is now."""
    segment, data = piece.segment, piece.data
    now, then = _frames(env, piece)
    first, *_ = carried_over(now, then, data.eef[segment.begin : segment.begin + 1])
    return first, carried_over(now, then, data.target[segment.begin : segment.end])


def _frames(env: KitchenEnv, piece: Piece) -> tuple[Array, Array]:
    """Of the object that a subtask is about: here, and in the source when it began, (4, 4) each."""
    segment, data = piece.segment, piece.data
    if segment.kind == PART:
        stage = env.declaration.stages[segment.stage]
        part = next((one for one in parts_of(env, stage) if one.name == segment.ref), parts_of(env, stage)[0])
        return body_pose(env.data, part.body), data.poses[segment.ref][segment.begin]
    if segment.kind == PICK:
        return body_pose(env.data, env.model.body(segment.ref).id), data.poses[segment.ref][segment.begin]
    where = piece.words["place"]
    assert isinstance(where, str)
    if where in data.poses and where in env.scene.objects:
        return body_pose(env.data, env.model.body(where).id), data.poses[where][segment.begin]
    fixture, about = env.scene.fixture(where), data.about["fixtures"][where]
    return yaw_pose(*fixture.pos[:2], fixture.yaw, fixture.pos[2]), yaw_pose(
        *about["pos"][:2], about["yaw"], about["pos"][2]
    )
