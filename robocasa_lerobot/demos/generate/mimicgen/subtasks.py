"""A prepared demonstration as MimicGen reads it, cut into a template's subtasks, and one of them carried over."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.generate.mimicgen.refs import refs_of
from robocasa_lerobot.demos.generate.mimicgen.template import (
    NEAREST,
    OBJECT,
    RANDOM,
    Subtask,
    Template,
    derived_signal,
)
from robocasa_lerobot.demos.generate.select import pose_distance
from robocasa_lerobot.demos.generate.sources.segments import signals_of
from robocasa_lerobot.demos.generate.sources.source import Source, UnfitSourcesError
from robocasa_lerobot.demos.generate.sources.transform import carried_over, interpolated
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.errors import UnknownNameError, UserError


@dataclass(frozen=True, eq=False)
class DatagenInfo:
    """What MimicGen's `datagen_info` holds of a demonstration of T steps; see `Prepared`.

    Attributes:
        number: among the sources.
        name: file and demonstration.
        eef: (T, 4, 4).
        target: (T, 4, 4).
        gripper: (T,).
        objects: (T, 4, 4) by name.
        signals: (T,) by name.
        seed: of its scene; -1 where the file does not say.
    """

    number: int
    name: str
    eef: Array
    target: Array
    gripper: Array
    objects: dict[str, Array]
    signals: dict[str, NDArray[np.int64]]
    seed: int = -1


def read_datagen(number: int, name: str, group: h5py.Group) -> DatagenInfo:
    """Read a group `datagen_info`, MimicGen's or ours.

    Raises:
        UserError: something that MimicGen writes is not there.
    """
    needed = ("eef_pose", "target_pose", "gripper_action", "object_poses", "subtask_term_signals")
    if lacking := [key for key in needed if key not in group]:
        raise UserError(f"{name}: its datagen_info has no {', '.join(lacking)}; prepare it again.")
    return DatagenInfo(
        number,
        name,
        eef=group["eef_pose"][()],
        target=group["target_pose"][()],
        gripper=group["gripper_action"][()][:, 0],
        objects={key: poses[()] for key, poses in group["object_poses"].items()},
        signals={key: values[()] for key, values in group["subtask_term_signals"].items()},
        seed=int(group.parent.attrs.get("seed", -1)),
    )


def datagen_of(number: int, source: Source) -> DatagenInfo:
    """The same of a source, as a derived template calls it.

    The signals are of its own segments: those in its file are of the common rules.
    """
    data, segments = source.data, list(source.segments)
    risen = zip(segments, signals_of(segments, len(data)).values(), strict=False)  # the last segment has none
    signals = {derived_signal(index, one.kind): values for index, (one, values) in enumerate(risen)}
    poses = {**data.poses, **{ref: data.poses[name] for ref, name in refs_of(source).items()}}
    return DatagenInfo(number, source.name, data.eef, data.target, data.gripper, poses, signals, source.seed)


def write_datagen(group: h5py.Group, info: DatagenInfo, env_name: str) -> None:
    """Write an empty group `datagen_info` for MimicGen's reader, and ours with a template."""
    group.attrs.update({"env_interface_name": f"MG_{env_name}", "env_interface_type": "robosuite"})
    arrays = {
        "eef_pose": info.eef,
        "target_pose": info.target,
        "gripper_action": info.gripper[:, None],
        **{f"object_poses/{name}": poses for name, poses in info.objects.items()},
        **{f"subtask_term_signals/{name}": values for name, values in info.signals.items()},
    }
    for key, values in arrays.items():
        group.create_dataset(key, data=values, compression="gzip")


def digest_of_infos(infos: Sequence[DatagenInfo]) -> str:
    """What tells one set of sources from another."""
    digest = hashlib.sha256()
    for info in infos:
        digest.update(f"{info.name} {len(info.eef)}".encode())
        digest.update(np.ascontiguousarray(info.target).tobytes())
    return digest.hexdigest()[:16]


def boundaries(info: DatagenInfo, template: Template) -> list[int]:
    """Where its subtasks end: after the step in which each signal has risen, from the end before on; the last with it.

    That step is a subtask's own, as MimicGen's `parse_source_dataset` has it.

    Raises:
        UnknownNameError: it has no such signal.
        UnfitSourcesError: a signal never rises.
    """
    ends: list[int] = []
    for subtask in template.subtasks[:-1]:
        signal = subtask.signal or ""
        if signal not in info.signals:
            raise UnknownNameError("subtask_term_signal", signal, info.signals)
        begin = ends[-1] if ends else 0
        risen = np.flatnonzero(np.diff(info.signals[signal].astype(np.int64)) > 0) + 1
        later = risen[risen >= begin]
        if not len(later):
            raise UnfitSourcesError(f"{info.name}: the signal {signal} does not rise from step {begin} on.")
        ends.append(int(later[0]) + 1)
    return [*ends, len(info.eef)]


def check_suits(info: DatagenInfo, template: Template) -> None:
    """Whether a demonstration can be taken by a template, whatever offsets are drawn.

    Raises:
        UnknownNameError: it has nothing of a subtask's object_ref, or no such signal.
        UnfitSourcesError: a signal never rises, or an offset may put a subtask's end before its beginning.
    """
    for subtask in template.subtasks:
        if subtask.object_ref is not None and subtask.object_ref not in info.objects:
            raise UnknownNameError("object_ref", subtask.object_ref, info.objects, f"({info.name})")
    ends = boundaries(info, template)
    spans = [(end + low, end + high) for end, (low, high) in _but_the_last(ends, template)]
    for (_, latest), (earliest, _) in itertools.pairwise([(0, 0), *spans, (ends[-1], ends[-1])]):
        if earliest <= latest:
            raise UnfitSourcesError(
                f"{info.name}: its subtasks end at steps {ends}, which offsets of the template may put before they "
                "begin. Take smaller subtask_term_offset_range, or leave the demonstration out."
            )


def with_offsets(ends: Sequence[int], template: Template, rng: np.random.Generator) -> list[tuple[int, int]]:
    """First and last step of each subtask, its end put off by as many steps as its template has drawn.

    Raises:
        UserError: one would end before it begins.
    """
    put_off = [end + int(rng.integers(low, high + 1)) for end, (low, high) in _but_the_last(ends, template)]
    edges = [0, *put_off, ends[-1]]
    if any(later <= earlier for earlier, later in itertools.pairwise(edges)):
        raise UserError(f"subtasks end at steps {edges[1:]}, one of them before it begins; take smaller offsets.")
    return list(itertools.pairwise(edges))


def _but_the_last(ends: Sequence[int], template: Template) -> list[tuple[int, tuple[int, int]]]:
    return [(end, one.offsets) for end, one in zip(ends, template.subtasks, strict=True)][:-1]


def selected(
    subtask: Subtask,
    sources: Sequence[DatagenInfo],
    spans: Sequence[tuple[int, int]],
    now: Array | None,
    hand: Array,
    rng: np.random.Generator,
) -> int:
    """Number (in the list) of the source that a subtask is taken from.

    Args:
        subtask: that is to be carried over.
        sources: to choose among.
        spans: first and last step of it in each.
        now: pose (4, 4) of its object.
        hand: pose (4, 4) of the hand.
        rng: of the draw.
    """
    if subtask.selection == RANDOM or now is None or subtask.object_ref is None:
        return int(rng.integers(len(sources)))
    far = []
    for info, (begin, _) in zip(sources, spans, strict=True):
        then = info.objects[subtask.object_ref][begin]
        if subtask.selection == OBJECT:
            far.append(pose_distance(now, then, subtask.weights))
        else:
            first = carried_over(now, then, info.eef[begin : begin + 1])[0]
            far.append(pose_distance(hand, first, subtask.weights))
    nearest = np.argsort(far, kind="stable")[: subtask.neighbours or NEAREST[subtask.selection]]
    return int(rng.choice(nearest))


def carried(
    info: DatagenInfo, subtask: Subtask, span: tuple[int, int], now: Array | None, *, first: bool
) -> tuple[Array, Array]:
    """Targets (n, 4, 4) and gripper commands (n,) of a subtask, relative to where its object is now.

    With `first` the pose that the hand had when it began comes before its targets.
    """
    begin, end = span
    poses, gripper = info.target[begin:end], info.gripper[begin:end]
    if first:
        poses, gripper = np.concatenate([info.eef[begin : begin + 1], poses]), np.concatenate([gripper[:1], gripper])
    if subtask.object_ref is None or now is None:
        return poses, gripper
    return carried_over(now, info.objects[subtask.object_ref][begin], poses), gripper


@dataclass(frozen=True)
class Target:
    """What is wanted of a control step.

    Attributes:
        pose: of the hand, (4, 4).
        gripper: command.
        subtask: that it belongs to.
        source: number of the demonstration that it comes from; -1 on the line to a subtask's first pose.
        step: of that demonstration; -1 on the line.
    """

    pose: Array
    gripper: float
    subtask: Subtask
    source: int = -1
    step: int = -1

    def noise(self, rng: np.random.Generator) -> Array:
        """On the six commands of the arm."""
        if self.source < 0 and not self.subtask.noise_on_the_line:
            return np.zeros(6)
        return rng.normal(0.0, self.subtask.action_noise, 6) if self.subtask.action_noise > 0.0 else np.zeros(6)


def targets(
    infos: Sequence[DatagenInfo],
    template: Template,
    rng: np.random.Generator,
    *,
    pose_of: Callable[[str], Array],
    hand: Callable[[], Array],
    begin: Callable[[DatagenInfo, Subtask, tuple[int, int]], None],
) -> Iterator[Target]:
    """An episode: a template's subtasks one after the other, each carried over from a source that is selected for it.

    Args:
        infos: sources.
        template: of their task.
        rng: of offsets and choices.
        pose_of: present pose (4, 4) of an object_ref.
        hand: present pose (4, 4) of the hand.
        begin: is told of each subtask that is about to begin, with its source and its first and last step there.

    Raises:
        UserError: a source does not suit the template.
    """
    spans = [with_offsets(boundaries(info, template), template, rng) for info in infos]
    last, chosen = None, -1
    for number, subtask in enumerate(template.subtasks):
        now = None if subtask.object_ref is None else pose_of(subtask.object_ref)
        if template.per_subtask or chosen < 0:
            chosen = selected(subtask, infos, [span[number] for span in spans], now, hand(), rng)
        info, span = infos[chosen], spans[chosen][number]
        begin(info, subtask, span)
        first = template.first_pose or number == 0
        poses, commands = carried(info, subtask, span, now, first=first)
        start = last if last is not None and template.from_last_target else hand()
        line = interpolated(start, poses[0], subtask.interpolation_steps)
        for pose in [*line[:-1], *[poses[0]] * subtask.fixed_steps]:
            yield Target(pose, float(commands[0]), subtask)  # the fingers are those of what comes
        for step, (pose, gripper) in enumerate(zip(poses, commands.tolist(), strict=True)):
            yield Target(pose, gripper, subtask, info.number, span[0] + max(0, step - first))
        last = poses[-1]
