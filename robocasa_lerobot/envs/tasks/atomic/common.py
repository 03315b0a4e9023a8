"""What atomic tasks share: their sets, distractors, and a short way to declare one."""

from __future__ import annotations

from robocasa_lerobot.envs.predicates import Goal
from robocasa_lerobot.envs.scene.wanted import Choice, FixtureWanted, ObjectWanted, Placement, RobotStart, SampleRegion
from robocasa_lerobot.envs.task import InitialState, Stage, Task
from robocasa_lerobot.envs.wording.atomic import WORDING

PHASE1 = ("pretrain300", "lifelong_phase1")
UNMULTIPLIED = ("pretrain100", "pretrain200", *PHASE1)
COMMON = (*UNMULTIPLIED, "mimicgen60")
SEEN = ("pretrain50", *COMMON, "atomic_seen")
TASKS: tuple[Task, ...] = ()


def atomic(
    name: str,
    horizon: int,
    summary: str,
    *,
    fixtures: tuple[FixtureWanted, ...],
    start: RobotStart,
    goal: Goal,
    stages: tuple[Stage, ...],
    objects: tuple[ObjectWanted, ...] = (),
    initial: tuple[InitialState, ...] = (),
    choices: tuple[Choice, ...] = (),
    sets: tuple[str, ...] = COMMON,
    needs: tuple[str, ...] = (),
    exclude_styles: tuple[int, ...] = (),
) -> Task:
    """An atomic task with its wording."""
    wording = WORDING[name]
    return Task(
        name=name,
        kind="atomic",
        activity="atomic",
        horizon=horizon,
        summary=summary,
        fixtures=fixtures,
        robot_start=start,
        objects=objects,
        initial=initial,
        choices=choices,
        goal=goal,
        instruction=wording.instruction,
        paraphrases=wording.paraphrases,
        stages=stages,
        sets=sets,
        needs=needs,
        exclude_styles=exclude_styles,
    )


def counter_near(role: str, *, size: tuple[float, float] = (0.0, 0.0), name: str = "counter") -> FixtureWanted:
    """The counter nearest to the fixture of a role."""
    return FixtureWanted(name, "counter", near=role, size=size)


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


def distractors(ref: str) -> ObjectWanted:
    """One to three things on the counter near a fixture."""
    return ObjectWanted("distr_counter", ("any",), on_counter(ref, (1.0, 0.5), offset=(0.0, 0.1)), count=(1, 3))


def place(object_: str = "obj", target: str = "counter", verb: str = "place", part: str = "") -> tuple[Stage, ...]:
    """The one stage of a pick-and-place task."""
    return (Stage("pick_place", verb, target, object=object_, part=part),)
