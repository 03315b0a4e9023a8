"""What declarations of composite tasks share."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from robocasa_lerobot.envs.predicates import (
    AllOf,
    AnyOf,
    Goal,
    GripperFar,
    GripperFarFromPart,
    ObjectOn,
    ObjectTouches,
    StateIs,
)
from robocasa_lerobot.envs.scene.spec import Placement, SampleRegion
from robocasa_lerobot.envs.tasks.task import Stage, Task

TASKS: tuple[Task, ...] = ()
BLENDER_ON = AllOf(StateIs("blender", "on"), GripperFarFromPart("blender", "button"))  # it runs with its lid on only
JAR_MOUTH_M = (0.085, 0.085, None)  # greatest width and depth of what goes into a blender


def fetch(name: str, source: str, target: str, *, part: str = "", until: Goal | None = None) -> tuple[Stage, ...]:
    """Three stages: pick an object up at a fixture, carry it to another one or to an object, put it down there.

    Args:
        name: of the object.
        source: role of the fixture that it is taken from.
        target: role of the fixture, or name of the object, that it goes to.
        part: of the target.
        until: when it is done, where not as it always is.
    """
    return (
        Stage("pick_place", "pick", source, object=name),
        Stage("navigation", "drive", target, object=name),
        Stage("pick_place", "place", target, object=name, part=part, until=until),
    )


def fetch_in_turn(
    names: Iterable[str],
    source: str,
    target: str,
    *,
    part: str = "",
    until: Callable[[str], Goal] | None = None,
    along: bool = False,
) -> tuple[Stage, ...]:
    """Several objects, one after the other, with a drive back before each but the first.

    Args:
        names: of the objects.
        source: as of `fetch`.
        target: as of `fetch`.
        part: as of `fetch`.
        until: by an object's name, when it is done, where not as it always is.
        along: the way back leads to the object, where its fixture is long; else to the fixture.
    """
    stages: list[Stage] = []
    for name in names:
        if stages:
            stages.append(Stage("navigation", "drive", name if along else source))
        stages += fetch(name, source, target, part=part, until=until and until(name))
    return tuple(stages)


def cover_and_blend() -> tuple[Stage, Stage]:
    """The lid of the role "blender" is put on, then its button is pressed."""
    lid = "{blender}_lid"
    return (
        Stage(
            "pick_place",
            "cover",
            "blender",
            object=lid,
            until=AllOf(StateIs("blender", "lid"), GripperFar(lid, 0.15)),
        ),
        Stage("buttons", "press", "blender", part="button", until=BLENDER_ON),
    )


def before_stool(
    size: tuple[float, float] | None,
    *,
    counter: str = "dining_counter",
    stool: str = "stool",
    pos: tuple[float | str | None, float | str | None] = ("ref", "ref"),
    **more: object,
) -> Placement:
    """On the dining counter before a stool, by default as a place is laid there."""
    return Placement(counter, region=SampleRegion(ref=stool), size=size, pos=pos, **more)  # type: ignore[arg-type]


def on_shelf(
    level: str,
    size: tuple[float, float],
    pos: tuple[float | None, float | None] = (0.0, -1.0),
    *,
    compartment: str = "fridge",
    **more: object,
) -> Placement:
    """On a usable shelf of the role "fridge", by its level (`predicates.shelves`), by default at its front."""
    region = SampleRegion(name=f"{compartment}_shelf:{level}")
    return Placement("fridge", region=region, size=size, pos=pos, **more)  # type: ignore[arg-type]


def together(name: str, other: str, vessel: str) -> Goal:
    """In a vessel that is too narrow for two things side by side: in touch with it, or with the other one that is."""
    return AnyOf(ObjectOn(name, vessel), AllOf(ObjectTouches(name, other), ObjectOn(other, vessel)))


def both_together(first: str, second: str, vessel: str) -> tuple[Goal, Goal]:
    """Both of two things are in such a vessel."""
    return together(first, second, vessel), together(second, first, vessel)
