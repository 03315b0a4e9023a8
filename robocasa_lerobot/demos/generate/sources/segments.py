"""Segments: the pieces of a demonstration in which the hand works on one thing, found from what preparing noted.

A stage about a part of a fixture has a segment for every time that the hand touches the part and moves it. A stage
that moves an object has one that takes hold of it and one that puts it down; one that uses an object, as to pour or to
wipe, has one that does so. What lies between, the free motion, is planned anew or bridged; MimicGen's own subtasks,
which cover all of a demonstration, end where the contact ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.generate.sources.frames import JOINTED
from robocasa_lerobot.demos.generate.sources.prepared import Prepared
from robocasa_lerobot.demos.generate.sources.rules import DERIVED, CutRules, rules_for
from robocasa_lerobot.demos.generate.sources.uses import RINSE, UNDER_WATER, USES, use_key, where_it_lay
from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.planning.base_room import wrap

PART, PICK, PLACE, USE = "part", "pick", "place", "use"
LEAVING_M = 0.12  # of the hand from where the contact ends: the retreat
DRIVES_M, TURNS_RAD = 0.10, 0.10  # of the base, which stays about where it is during an approach
LIFTED_M, MOVED_M = 0.07, 0.06  # an object that has risen, or gone, as far is in the hand, and out of a slot
FIRM_STEPS = 10  # of fingers that close
AT_M = 0.03  # farther from where it is used than it ever comes, an object is about there


@dataclass(frozen=True)
class Segment:
    """A piece of a demonstration; steps are counted from its beginning.

    Attributes:
        kind: PART, PICK, PLACE or USE.
        stage: number of its stage.
        ref: what it is relative to: a part's or an object's name; of PLACE and USE the object that is in the hand.
        begin: where the subtask begins, with the free motion before it.
        lead: where the hand comes near what it is about to touch, and goes straight to it from then on.
        contact: of a part, when it is touched first; of an object, when the fingers begin to close, or to open; of a
            use, when it comes as near to where it is used as it does at all.
        release: when that ends.
        end: where the segment ends: the hand is off.
        signal: name of the signal that says so.
    """

    kind: str
    stage: int
    ref: str
    begin: int
    lead: int
    contact: int
    release: int
    end: int

    @property
    def signal(self) -> str:
        """Of MimicGen's name for it: when its subtask is over."""
        return f"{self.kind}_{self.ref}"


def cut(found: Prepared, rules: Mapping[str, CutRules] = DERIVED) -> list[Segment]:
    """The segments of a demonstration, in the order of their contacts; they do not overlap.

    Args:
        found: what preparing noted.
        rules: by skill and verb, as "drawers open", where they are not the common ones.
    """
    raw: list[Segment] = []
    for number, words in enumerate(found.about["stages"]):
        steps = np.flatnonzero(found.stage == number)
        if not len(steps):
            continue
        stage = _Stage(number, words, int(steps[0]), int(steps[-1]) + 1, rules_for(rules, words))
        if words["skill"] in JOINTED:
            raw += _part_segments(found, stage)
        elif words["skill"] == "pick_place":
            raw += _object_segments(found, stage, raw)
    raw.sort(key=lambda one: one.contact)
    return list(_apart(found, raw))


def signals_of(segments: list[Segment], steps: int) -> dict[str, NDArray[np.int64]]:
    """For each segment but the last a signal (steps,) that rises where its contact has ended."""
    out: dict[str, NDArray[np.int64]] = {}
    for number, one in enumerate(segments[:-1]):
        rises = np.zeros(steps, dtype=np.int64)
        rises[min(one.release, steps - 1) :] = 1
        out[f"{number}_{one.signal}"] = rises
    return out


@dataclass(frozen=True)
class _Stage:
    """A stage of a demonstration: its number, its words, the steps [first, last), and the rules for it."""

    number: int
    words: dict[str, Any]
    first: int
    last: int
    rules: CutRules


def _part_segments(found: Prepared, stage: _Stage) -> Iterator[Segment]:
    rules, first, last = stage.rules, stage.first, stage.last
    for name in stage.words["parts"]:
        position = found.joints[name]
        low, high = found.about["parts"][name]["range"]
        for start, stop in runs(found.touching[name][first:last] > 0, rules.gap_steps):
            begin, end = first + start, min(first + stop, last)
            moved = np.abs(position[begin : min(end + 5, len(position))] - position[begin]).max()
            if moved > rules.moved_share * (high - low):
                lead = _lead(found, begin, first, rules.near_m, rules.far_steps)
                yield Segment(PART, stage.number, name, first, lead, begin, end, last)


def _object_segments(found: Prepared, stage: _Stage, before: list[Segment]) -> Iterator[Segment]:
    rules, first, last, name = stage.rules, stage.first, stage.last, stage.words["thing"]
    verb, touched = stage.words["verb"], found.touching[name] > 0
    # Commands to close that bring the object into the hand; the last one counts, and what was let go after it. What is
    # used may have been there before, and hardly move.
    holds = []
    for start, stop in runs(found.gripper[first:last] > 0, 0):
        begin, end = first + start, first + stop
        moved = (verb in USES and begin == first) or _carried(found, name, begin, end)
        if end - begin > FIRM_STEPS and touched[begin:end].mean() > 0.5 and moved:
            holds.append((begin, end))
    if not holds:
        return
    close, opened = holds[-1]
    lay, lifted = rest_step(before, name, close), close
    if close > first:
        lay, lifted = close, _when_lifted(found, name, close, opened)
        lead = _lead(found, close, first, rules.near_m, rules.far_steps)
        yield Segment(PICK, stage.number, name, first, lead, close, lifted, lifted)
    if verb in USES:
        # What is used where it stands never rises.
        yield from _use_segments(found, stage, lifted if lifted < opened else close, opened, lay)
    if verb != "pick" and (verb not in USES or verb == RINSE) and opened < last:
        lead = _lead(found, opened, close, rules.place_near_m, rules.far_steps)
        yield Segment(PLACE, stage.number, name, close, lead, opened, opened, last)


def _use_segments(found: Prepared, stage: _Stage, lifted: int, opened: int, lay: int) -> Iterator[Segment]:
    """The last time that a held object is about where it is used."""
    rules, name, last = stage.rules, stage.words["thing"], stage.last
    away = found.poses[name][:, :3, 3] - use_frames(found, stage.number, lay)[:, :3, 3]
    path = np.linalg.norm(away, axis=1)[lifted:opened]
    at = path < path.min() + AT_M
    about = runs(path < path.min() + rules.use_near_m, rules.gap_steps)
    start, stop = next(one for one in reversed(about) if at[slice(*one)].any())
    there = np.flatnonzero(at[start:stop]) + start
    if stage.words["verb"] in UNDER_WATER:
        stop = int(there[-1]) + 1  # no need to go back as it came
    contact, end = lifted + int(there[0]), lifted + stop
    lead = _lead(found, contact, lifted + start, np.inf, len(found))
    yield Segment(USE, stage.number, name, lifted, lead, contact, end, last if end == opened else end)


def use_frames(found: Prepared, stage: int, lay: int) -> Array:
    """Where a stage uses its object, (T, 4, 4); `lay` is the step at which that was taken from where it lay."""
    words = found.about["stages"][stage]
    if not words["about_itself"]:
        return found.poses[use_key(stage)]
    name = words["thing"]
    frame = where_it_lay(found.poses[name][lay], float(found.undersides[name][lay, 2]))
    return np.repeat(frame[None], len(found), axis=0)


def rest_step(segments: Sequence[Segment], name: str, before: int) -> int:
    """The last step up to one at which an object lay where it was taken from; the first of all where it never was."""
    taken = (one.contact for one in segments if one.kind == PICK and one.ref == name and one.contact <= before)
    return max(taken, default=0)


def _carried(found: Prepared, name: str, begin: int, end: int) -> bool:
    path = found.poses[name][begin:end, :3, 3]
    return bool(np.linalg.norm(path - path[0], axis=1).max() > MOVED_M)


def _when_lifted(found: Prepared, name: str, close: int, opened: int) -> int:
    path = found.poses[name][close:opened, :3, 3]
    up = (path[:, 2] - path[0, 2] > LIFTED_M) | (np.linalg.norm(path - path[0], axis=1) > 2 * MOVED_M)
    return close + int(np.argmax(up)) + 1 if up.any() else opened


def _lead(found: Prepared, contact: int, first: int, near_m: float, far_steps: int) -> int:
    """The step from which hand and base stay near where they are at a contact; fingers may close."""
    at, lead = found.eef[contact][:3, 3], contact
    while lead > max(first, contact - far_steps):
        step = lead - 1
        drives = np.hypot(*(found.base[contact] - found.base[step])[:2]) > DRIVES_M
        turns = abs(wrap(found.base[contact, 2] - found.base[step, 2])) > TURNS_RAD
        if drives or turns or np.linalg.norm(found.eef[step][:3, 3] - at) > near_m:
            break
        if lead < contact and found.gripper[step] > found.gripper[lead]:  # it has let something go here
            break
        lead = step
    return lead


def _apart(found: Prepared, segments: list[Segment]) -> Iterator[Segment]:
    """The same without overlaps: each begins where the one before has drawn the hand back."""
    begin = 0
    for number, one in enumerate(segments):
        later = segments[number + 1] if number + 1 < len(segments) else None
        end = one.end
        if one.kind == PART or later is not None:
            end = _left(found, one, min(later.lead, one.end) if later is not None and one.kind == PART else one.end)
        if later is not None:
            end = min(max(end, one.release), max(later.lead, one.release), later.contact)
        lead = min(max(one.lead, begin), one.contact)
        yield Segment(one.kind, one.stage, one.ref, begin, lead, one.contact, min(one.release, end), end)
        begin = end


def _left(found: Prepared, one: Segment, limit: int) -> int:
    """The step at which the hand is off what it worked on."""
    at = found.eef[min(one.release, len(found) - 1)][:3, 3]
    for step in range(one.release, limit):
        if np.linalg.norm(found.eef[step][:3, 3] - at) > LEAVING_M:
            return step
    return limit


def runs(held: NDArray[np.bool_], gap: int) -> list[tuple[int, int]]:
    """Where something holds, as [start, stop) pairs; breaks of at most `gap` steps do not count."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    out: list[tuple[int, int]] = []
    for start, stop in edges.reshape(-1, 2).tolist():
        if out and start - out[-1][1] <= gap:
            out[-1] = (out[-1][0], stop)
        else:
            out.append((start, stop))
    return out
