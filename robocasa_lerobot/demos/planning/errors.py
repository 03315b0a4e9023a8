"""What planning raises."""

from __future__ import annotations


class SkillError(RuntimeError):
    """The skill cannot go on: what it tried and how far it came."""


class NoPlanError(SkillError):
    """There is no plan: what was asked for and what stands against it."""


class ShutInError(NoPlanError):
    """There is no plan, and little had to be looked at to know: all around the goal is taken."""


class LostError(SkillError):
    """Something has come to where the robot can do nothing about it any more: no attempt after this one is of use."""


class SlippedError(SkillError):
    """What was carried has left the hand, and may lie where it can be picked up again."""
