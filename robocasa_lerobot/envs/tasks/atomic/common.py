"""What declarations of atomic tasks share."""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.envs.scene.spec import FixtureSpec, ObjectSpec, Placement, SampleRegion
from robocasa_lerobot.envs.tasks.task import Stage, Task

WITHIN_REACH_M = (0.5, 1.65)  # heights of shelves that the arm reaches
# Turns of cookware, radians. Handles of our pans lie along -x, RoboCasa's along -y: a quarter turn brings them to the
# front, with RoboCasa's usual turn, of up to 45 degrees, about that. An ear of our pots lies along -x too.
HANDLE_TO_FRONT = (0.25 * np.pi, 0.75 * np.pi)
# Away from the knobs: 45 to 67.5 degrees off the front, to its left or to its right.
HANDLE_LEFT, HANDLE_RIGHT = (0.125 * np.pi, 0.25 * np.pi), (0.75 * np.pi, 0.875 * np.pi)
# Handles of our mugs lie along +x, a quarter turn on from RoboCasa's: less that they point where theirs do.
MUG_UNDER_SPOUT = (-0.375 * np.pi, -0.25 * np.pi)
MUG_ON_COUNTER = (-0.25 * np.pi, 0.0)
_KNOBS_BURNER = SampleRegion(name="{knob}")
TASKS: tuple[Task, ...] = ()


def counter_near(role: str, *, size: tuple[float, float] = (0.0, 0.0), name: str = "counter") -> FixtureSpec:
    """The counter nearest to the fixture of a role."""
    return FixtureSpec(name, "counter", near=role, size=size)


def on_counter(
    ref: str,
    size: tuple[float, float],
    *,
    loc: str = "nn",
    pos: tuple[float | str | None, float | str | None] = ("ref", -1.0),
    offset: tuple[float, float] = (0.0, 0.0),
    counter: str = "counter",
    **more: object,
) -> Placement:
    """On the role "counter", by default at its front edge, in line with the fixture of the role `ref`."""
    return Placement(counter, region=SampleRegion(ref=ref, loc=loc), size=size, pos=pos, offset=offset, **more)  # type: ignore[arg-type]


def distractors(ref: str) -> ObjectSpec:
    """One to three objects on the counter near a fixture."""
    return ObjectSpec("distr_counter", ("any",), on_counter(ref, (1.0, 0.5), offset=(0.0, 0.1)), count=(1, 3))


def place(object_: str = "obj", target: str = "counter", verb: str = "place", part: str = "") -> tuple[Stage, ...]:
    """The one stage of a pick-and-place task."""
    return (Stage("pick_place", verb, target, object=object_, part=part),)


def in_cabinet(
    role: str, size: tuple[float, float], *, pos: tuple[float | str | None, float | None] = (0.0, -1.0), **more: object
) -> Placement:
    """On a shelf of a cabinet that the arm reaches, by default at its front."""
    return Placement(role, region=SampleRegion(height=WITHIN_REACH_M), size=size, pos=pos, **more)  # type: ignore[arg-type]


def on_burner(
    region: SampleRegion = _KNOBS_BURNER, size_m: float = 0.02, *, rotation: tuple[float, float] | None = None
) -> Placement:
    """Cookware about the middle of a burner.

    Args:
        region: of the stove: by default the burner of the knob that was drawn.
        size_m: edge of the square that its middle is drawn in.
        rotation: bounds of its turn, radians; by default its handle is to the left or the right of the front, away
            from the knobs.
    """
    return Placement(
        "stove",
        region=region,
        size=(size_m, size_m),
        pos=(0.0, 0.0),
        rotation=rotation or HANDLE_LEFT,
        other_rotation=None if rotation else HANDLE_RIGHT,
        ensure_inside=False,
    )
