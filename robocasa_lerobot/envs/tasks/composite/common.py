"""What declarations of composite tasks share."""

from __future__ import annotations

from robocasa_lerobot.envs.predicates import Goal
from robocasa_lerobot.envs.scene.spec import Placement, SampleRegion
from robocasa_lerobot.envs.tasks.task import Stage, Task

TASKS: tuple[Task, ...] = ()


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
