"""Which segments of sources fit a part of this scene, and the frames in which they do."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.demos.generate.course import Course, Try
from robocasa_lerobot.demos.generate.sources.frames import HANDLE, REST, Part, anchor, anchored, parts_of, shares_of
from robocasa_lerobot.demos.generate.sources.rules import rules_for
from robocasa_lerobot.demos.generate.sources.segments import PART
from robocasa_lerobot.demos.generate.sources.source import Piece, pieces_for
from robocasa_lerobot.demos.generate.sources.transform import inverse, make_pose, mirrored
from robocasa_lerobot.demos.motion import Array, rotation_about
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage

APART_SHARE = 0.12  # of its range: a part may stand as far before where it stood in the source
OTHER_LEVER_RAD = 0.25  # between where levers point
ALONG = 0.9  # cosine of a hinge to the part's x, the axis that a reflection leaves as it is
LEAST_SPIN_RAD = 0.1  # of a knob from where it stood in the source
NEARLY_DONE = 0.3  # of what the part with the most left to go has left
LEFT_SHARE = 0.003  # of its range that a segment must still have to go
HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
RELATIVE = ("turn",)  # verbs whose goal is counted from where the part stood
ONE_WAY = ("doors", "drawers", "racks")  # skills whose parts go one way all the time


@dataclass(frozen=True)
class Fit:
    """A source's segment on a part of this scene.

    Attributes:
        piece: the segment.
        part: of this scene.
        mirror: whether it is reflected, since the part hangs on the other side.
        flip: whether the hand has made half a turn about its fingers, which leaves a gripper as it was.
        spin: turn about the part's axis in its frame, radians, so that a knob is held as it was in the source's room,
            and a lever where it is.
        point: where its frame lies in the part, (3,) in the part's axes, metres.
        source_point: the same in the source.
    """

    piece: Piece
    part: Part
    mirror: bool
    flip: bool
    spin: float
    point: Array
    source_point: Array

    @classmethod
    def of(cls, piece: Piece, part: Part, *, flip: bool = False, spin: float = 0.0, other_side: bool = False) -> Fit:
        """With the frame at the middle of what the hand touches first."""
        segment, data = piece.segment, piece.data
        about = data.about["parts"][segment.ref]
        touched = data.touching[segment.ref][segment.contact : segment.release]
        points = data.contact_points[segment.ref][segment.contact : segment.release]
        known = ~np.isnan(points[:, 0])
        frame = rules_for(piece.source.rules, piece.words).frame
        group = frame or (HANDLE if (touched[known] == 1).mean() > 0.5 else REST)
        if group not in about["boxes"] or group not in part.boxes:
            group = next(iter(part.boxes))
        box = np.array(about["boxes"].get(group, next(iter(about["boxes"].values()))))
        shares = shares_of(points[known].mean(axis=0), box)
        mirror = other_side or part.side * int(about["side"]) < 0
        if part.lever is not None:
            turn = _turn_about(part.axis, points[known].mean(axis=0), part.lever)
            if abs(turn) > OTHER_LEVER_RAD:  # so is everything about the hinge
                return cls(piece, part, mirror, flip, spin + turn, np.zeros(3), np.zeros(3))
        return cls(
            piece, part, mirror, flip, spin, anchor(part.boxes[group], shares, mirror=mirror), anchor(box, shares)
        )

    def source_frame(self, step: int) -> Array:
        """Of the source at a step, (4, 4)."""
        return anchored(self.piece.data.poses[self.piece.segment.ref][step], self.source_point)

    def local(self, pose: Array, step: int) -> Array:
        """A source's world pose (4, 4) at a step in the part's frame, as it is to be here."""
        inside = inverse(self.source_frame(step)) @ pose
        if self.mirror:
            inside = mirrored(inside)
        if self.spin:
            inside = make_pose(np.zeros(3), rotation_about(self.part.axis, self.spin)) @ inside
        return inside @ HALF_TURN if self.flip else inside

    def way(self) -> tuple[float, float]:
        """Position of the part's joint at the segment's beginning and end in the source, as it would be here."""
        about = self.piece.data.about["parts"][self.piece.segment.ref]
        low, high = about["range"]
        first, far = self.piece.travel()
        sign = self._sign(low, high)
        begin = self._here((first - low) / (high - low), sign)
        end = self._here((first + far - low) / (high - low), sign)
        return begin, end

    def way_from(self, position: float) -> tuple[float, float]:
        """The same; of a goal that is counted from where the part stands, from there."""
        begin, end = self.way()
        return (position, position + end - begin) if self.words_relative else (begin, end)

    def as_try(self) -> Try:
        """What it is remembered by, where it comes to nothing."""
        return Try(self.piece.source.number, self.piece.segment.contact, self.part.name, self.mirror, self.flip)

    def apart(self, position: float) -> float:
        """How far a part is from where it stood when the segment began, as a share of its range."""
        return 0.0 if self.words_relative or self.piece.springs else abs(position - self.way()[0]) / self.part.span

    @property
    def words_relative(self) -> bool:
        """Whether the goal is counted from where the part stood."""
        return self.piece.words["verb"] in RELATIVE

    def _sign(self, low: float, high: float) -> bool:
        """Whether the part's joint counts the other way round than the source's."""
        own = self.part.range
        return (abs(low) > abs(high) and abs(own[0]) < abs(own[1])) or (
            abs(low) < abs(high) and abs(own[0]) > abs(own[1])
        )

    def _here(self, share: float, flipped: bool) -> float:
        share = 1.0 - share if flipped else share
        return float(self.part.range[0] + share * self.part.span)


def _turn_about(axis: Array, one: Array, other: Array) -> float:
    """By how much a point (3,) is turned about an axis through the origin to point as another one does, radians."""
    one, other = (point - axis * float(axis @ point) for point in (one, other))
    return float(np.arctan2(axis @ np.cross(one, other), one @ other))


def _folds_down(part: Part) -> bool:
    return not part.slides and abs(part.axis[0]) > ALONG


def _goes_on(piece: Piece) -> bool:
    """Whether a segment moves its part the way that its stage does, and does not knock it back."""
    path = piece.data.joints[piece.segment.ref][piece.data.stage == piece.segment.stage]
    return bool((path[-1] - path[0]) * piece.travel()[1] > 0)


def fits_of(env: KitchenEnv, stage: Stage, course: Course) -> list[Fit]:
    """Segments that lead the stage's parts on from where they stand."""
    drawn = env.scene.fill(stage.to)
    pieces = course.most_alike(pieces_for(course.sources, stage, PART, drawn), env, stage)
    found = []
    left: dict[str, float] = {}
    for part in parts_of(env, stage):
        for piece in pieces:
            own = piece.data.about["parts"][piece.segment.ref]
            if bool(own["slides"]) != part.slides or (own["side"] == 0) != (part.side == 0):
                continue
            if stage.skill in ONE_WAY and not _goes_on(piece):
                continue
            fit = Fit.of(piece, part)
            begin, end = fit.way()
            now, ahead = part.position(env.data), float(np.sign(end - begin))
            near = (begin - now) * ahead < APART_SHARE * part.span
            if stage.verb in RELATIVE or piece.springs or (near and (end - now) * ahead > LEFT_SHARE * part.span):
                left[part.name] = max(left.get(part.name, 0.0), abs(end - now) / part.span)
                spins = (0.0, begin - now) if stage.skill == "knobs" and abs(begin - now) > LEAST_SPIN_RAD else (0.0,)
                # A door that folds down is the same from either side of it.
                sides = (False, True) if stage.skill == "doors" and _folds_down(part) else (False,)
                found += [
                    Fit.of(piece, part, flip=flip, spin=spin, other_side=side)
                    for flip, spin, side in itertools.product((False, True), spins, sides)
                ]
    # Of several parts, as two doors, those that have hardly any way left come last.
    return [fit for fit in found if left[fit.part.name] > NEARLY_DONE * max(left.values())]
