"""The vocabulary of goals. Thresholds and formulas are those of robocasa 1.0.1 where its check is sound."""

from robocasa_lerobot.envs.predicates.fixtures import (
    BurnerLevel,
    DoorsClosed,
    DoorsOpen,
    DrawerClosed,
    DrawerOpen,
    PartTurned,
    PartWithin,
    StateIs,
)
from robocasa_lerobot.envs.predicates.logic import AllOf, AnyOf, Goal, Not, Term, When
from robocasa_lerobot.envs.predicates.objects import (
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
)
from robocasa_lerobot.envs.predicates.robot import GripperFar, GripperFarFromPart, StandsBefore
from robocasa_lerobot.envs.predicates.shelves import OnShelf, inside

__all__ = [
    "AllOf",
    "AnyOf",
    "BurnerLevel",
    "DoorsClosed",
    "DoorsOpen",
    "DrawerClosed",
    "DrawerOpen",
    "Goal",
    "GripperFar",
    "GripperFarFromPart",
    "Not",
    "ObjectAtSite",
    "ObjectInBasin",
    "ObjectInside",
    "ObjectOn",
    "ObjectTouches",
    "ObjectTouchesAnyCounter",
    "ObjectUpright",
    "OnShelf",
    "PartTurned",
    "PartWithin",
    "StandsBefore",
    "StateIs",
    "Term",
    "When",
    "inside",
]
