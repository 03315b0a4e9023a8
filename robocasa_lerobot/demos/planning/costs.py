"""What a plan costs: one set of constants, and where a kind of plan weighs otherwise."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanCosts:
    """Weights of a plan's defects; costs have no unit, and from about 2 on a plan will not do.

    Attributes:
        miss_per_m, miss_per_rad: of what a pose is missed by, beyond the free part.
        free_m, free_rad: misses that cost nothing.
        most_miss: bound of a pose's cost.
        near_limit_rad, near_limit: margin to a joint limit that is wanted, with the cost of a radian less.
        other_poses: factor of misses at poses other than the first solved one.
        turn: of a radian of the joint that turns most to get there.
        drive, drive_per_m: of driving at all, and of a metre of it.
        leg: of each straight move of a drive after the first.
        along_per_m: of a metre that the base goes while the hand is in contact.
        hit: of a body that is touched in a part of the path; most_hits: bodies that are counted.
        hit_at_pose: the same at the poses of a path in contact.
        clearance, clearance_m: of a robot that would touch something if it stood that much higher.
        near, near_m: of a body that the arm comes as near as this to on its path to the first pose.
        astray, astray_rad: of an arm that ends so far from the planned joint angles when its hand is led along a path.
        detour: of a path that was planned round something, and detour_per_rad of its length beyond the straight line.
        good_enough: cost up to which no other place to stand is looked at.
        hopeless: cost from which on a candidate is dropped.
    """

    miss_per_m: float = 30.0
    miss_per_rad: float = 2.0
    free_m: float = 0.003
    free_rad: float = 0.03
    most_miss: float = 4.0
    near_limit_rad: float = 0.25
    near_limit: float = 2.0
    other_poses: float = 0.7
    turn: float = 0.1
    drive: float = 0.25
    drive_per_m: float = 0.4
    leg: float = 0.15
    along_per_m: float = 0.0
    hit: float = 0.5
    most_hits: int = 3
    hit_at_pose: float = 0.5
    clearance: float = 0.0
    clearance_m: float = 0.0
    near: float = 0.1
    near_m: float = 0.02
    astray: float = 1.0
    astray_rad: float = 0.6
    detour: float = 0.15
    detour_per_rad: float = 0.03
    good_enough: float = 0.8
    hopeless: float = 8.0


REACHING = PlanCosts()
# Few poses near each other, from about where the robot stands: drives are short, and a pose that touches is a bad one.
NEARBY = PlanCosts(
    free_m=0.0, free_rad=0.0, other_poses=1.0, drive=0.0, drive_per_m=0.3, hit=0.3, hit_at_pose=0.7, good_enough=0.30
)
# Along the arc of a part: the pose may be missed a bit, since the part leads the hand.
IN_CONTACT = PlanCosts(
    miss_per_m=20.0,
    miss_per_rad=1.0,
    free_m=0.005,
    free_rad=0.0,
    near_limit_rad=0.2,
    near_limit=1.0,
    other_poses=1.0,
    turn=0.05,
    drive=0.0,
    drive_per_m=0.15,
    along_per_m=0.10,
    hit=0.3,
    hit_at_pose=0.8,
    clearance=0.25,
    clearance_m=0.018,
    hopeless=2.0,
)
