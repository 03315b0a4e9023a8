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
from robocasa_lerobot.envs.predicates.heat_and_water import OnBurner, UnderWater
from robocasa_lerobot.envs.predicates.logic import AllOf, AnyOf, Exactly, ForEach, Goal, Not, Term, When
from robocasa_lerobot.envs.predicates.memory import Never, Once, StepsWhile, WithMemory, parts_with_memory
from robocasa_lerobot.envs.predicates.near import Near, NearerThan, OnOneSide
from robocasa_lerobot.envs.predicates.objects import (
    ObjectAtSite,
    ObjectInBasin,
    ObjectInside,
    ObjectOn,
    ObjectOnRack,
    ObjectTilt,
    ObjectTouches,
    ObjectTouchesAnyCounter,
    ObjectUpright,
    OverBasin,
)
from robocasa_lerobot.envs.predicates.placed_by import BeforeStools, Beside, HandlePoints, Higher, NearFixture, RestsOn
from robocasa_lerobot.envs.predicates.robot import (
    Grasped,
    GripperFar,
    GripperFarFromPart,
    GripperTouches,
    StandsBefore,
    StandsNear,
)
from robocasa_lerobot.envs.predicates.shelves import OnShelf, inside
from robocasa_lerobot.envs.predicates.traces import MovedSince, Strokes

__all__ = [
    "AllOf",
    "AnyOf",
    "BeforeStools",
    "Beside",
    "BurnerLevel",
    "DoorsClosed",
    "DoorsOpen",
    "DrawerClosed",
    "DrawerOpen",
    "Exactly",
    "ForEach",
    "Goal",
    "Grasped",
    "GripperFar",
    "GripperFarFromPart",
    "GripperTouches",
    "HandlePoints",
    "Higher",
    "MovedSince",
    "Near",
    "NearFixture",
    "NearerThan",
    "Never",
    "Not",
    "ObjectAtSite",
    "ObjectInBasin",
    "ObjectInside",
    "ObjectOn",
    "ObjectOnRack",
    "ObjectTilt",
    "ObjectTouches",
    "ObjectTouchesAnyCounter",
    "ObjectUpright",
    "OnBurner",
    "OnOneSide",
    "OnShelf",
    "Once",
    "OverBasin",
    "PartTurned",
    "PartWithin",
    "RestsOn",
    "StandsBefore",
    "StandsNear",
    "StateIs",
    "StepsWhile",
    "Strokes",
    "Term",
    "UnderWater",
    "When",
    "WithMemory",
    "inside",
    "parts_with_memory",
]
