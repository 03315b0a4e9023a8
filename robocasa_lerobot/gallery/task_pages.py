"""What a task is, in words: made from its declaration, for the terminal and for `docs/tasks.md`."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Iterable, Iterator
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.predicates import AllOf, AnyOf, Exactly, ForEach, Goal, Not, ObjectInside, Term, When
from robocasa_lerobot.envs.predicates.logic import every_goal_in
from robocasa_lerobot.envs.scene.initial_states import Initial
from robocasa_lerobot.envs.scene.scene_spec import InitialState
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    InitialOpenness,
    InsideOf,
    ObjectSpec,
    OnCounter,
    Placement,
    RobotStart,
)
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of

DEMONSTRATOR = "Demonstrator: "  # start of the line that says whether there is one
_HEAD = """# Tasks

Generated from the declarations by `make docs`; do not edit. `robocasa-lerobot tasks NAME` prints one of them,
`robocasa-lerobot tasks NAME --pictures FILE.png` renders its first and its last state.

Horizons are control steps at {hz} Hz. The human median is the length of the published demonstrations. Words in braces
are drawn at reset. Terms of the goal have the names that they have in `info["success_terms"]`, where `x`
under "not" is `not_x`; distances are metres, angles radians, openness and turns shares of the part's range.
"""
_INSIDE_NOTE = (
    "The published test of being inside grows more lenient the shorter an edge of the region is; here the corners of "
    "the object's bounding box are inside by metres, the same for every region."
)


def pages(tasks: Iterable[Task]) -> str:
    """The whole of `docs/tasks.md`: an overview by skill, then each task."""
    tasks = list(tasks)
    lines = [_HEAD.format(hz=contract.CONTROL_HZ)]
    for skill in sorted({_skill(task) for task in tasks}):
        lines += [f"- **{skill}**: " + ", ".join(f"[{t.name}](#{t.name.lower()})" for t in tasks if _skill(t) == skill)]
    for task in tasks:
        lines += ["", f"## {task.name}", "", *page(task)]
    return "\n".join(lines) + "\n"


def page(task: Task) -> Iterator[str]:
    """Lines of Markdown about one task."""
    human = task.facts.human_seconds
    able = "yes" if can_demonstrate(task) else "none yet"
    yield f"> {task.instruction}"
    yield ""
    yield task.summary
    yield ""
    yield "Other wordings: " + " / ".join(task.paraphrases)
    yield ""
    ours = "; ours, none is published" if task.facts.horizon is None else ""
    yield f"- Horizon: {task.horizon} steps ({task.horizon / contract.CONTROL_HZ:g} s{ours})" + (
        f"; human median {human:g} s" if human else ""
    )
    yield f"- {DEMONSTRATOR}{able}; stages: " + ", ".join(
        " ".join(filter(None, (s.skill, s.verb, s.object, s.target, s.part))) for s in stages_of(task)
    )
    yield f"- Sets: {', '.join(sorted(task.facts.sets))}"
    yield f"- Fixtures: {'; '.join(map(_fixture, task.fixtures))}"
    if task.choices:
        yield f"- Drawn at reset: {'; '.join(map(_choice, task.choices))}"
    yield f"- The robot starts {_start(task.robot_start)}"
    if task.initial:
        yield f"- At reset: {'; '.join(map(_initial, task.initial))}"
    if task.objects:
        yield "- Objects:"
        yield from (f"  - {_object(wanted)}" for wanted in task.objects)
    if task.needs or task.exclude_styles:
        without = f"; not styles {', '.join(map(str, task.exclude_styles))}" if task.exclude_styles else ""
        yield f"- Kitchens: those with {', '.join(task.needs) or 'anything'}{without}"
    yield "- Goal:"
    yield from goal_lines(goal_of(task))
    notes = [note for note in (task.facts.note, _INSIDE_NOTE if asks_inside(goal_of(task)) else None) if note]
    yield from (f"- Other than the original: {note}" for note in notes)


def goal_lines(goal: Goal, indent: str = "  ") -> Iterator[str]:
    """A goal as a list in Markdown: the terms with their thresholds, and how they are joined."""
    if isinstance(goal, AllOf | AnyOf):
        yield f"{indent}- {'all of' if isinstance(goal, AllOf) else 'one of'}"
        for part in goal.parts:
            yield from goal_lines(part, indent + "  ")
    elif isinstance(goal, Not):
        yield f"{indent}- not"
        yield from goal_lines(goal.part, indent + "  ")
    elif isinstance(goal, Exactly):
        yield f"{indent}- exactly {goal.n} of"
        for part in goal.parts:
            yield from goal_lines(part, indent + "  ")
    elif isinstance(goal, When):
        for value, part in goal.goals.items():
            yield f"{indent}- where {{{goal.choice}}} is {value}"
            yield from goal_lines(part, indent + "  ")
    elif isinstance(goal, ForEach):
        yield f"{indent}- for each of `{goal.object}`"
        yield from goal_lines(goal.pattern, indent + "  ")
    else:
        assert isinstance(goal, Term), goal
        first = (inspect.getdoc(type(goal)) or "").splitlines()[0]
        fields = [f"{name} {_value(value)}" for name, value in _fields(goal) if not isinstance(value, Goal)]
        yield f"{indent}- `{goal.name}`: {first}" + (f" ({', '.join(fields)})" if fields else "")
        for part in goal.inner:
            yield from goal_lines(part, indent + "  ")


def _skill(task: Task) -> str:
    return stages_of(task)[0].skill.replace("_", " ")


def asks_inside(goal: Goal) -> bool:
    """Whether a goal has something inside a fixture."""
    return any(isinstance(part, ObjectInside) for part in every_goal_in(goal))


def _fixture(wanted: FixtureSpec) -> str:
    said = f"`{wanted.role}` ({wanted.kind.replace('_', ' ')}"
    if wanted.near:
        said += f" near {wanted.near}"
    if wanted.other_than:
        said += f", other than {', '.join(wanted.other_than)}"
    if any(wanted.size):
        said += f", at least {wanted.size[0]:g} x {wanted.size[1]:g} m"
    return said + ")"


def _choice(choice: Choice) -> str:
    if choice.of:
        return f"{{{choice.name}}}, a part of {choice.of}"
    return f"{{{choice.name}}}: {' or '.join(choice.options)}"


def _start(start: RobotStart) -> str:
    said = f"{'beside' if start.beside else 'in front of'} `{start.fixture}`"
    if start.at_object:
        said += f", in line with the region of `{start.at_object}`"
    return said + (f", {start.setback:g} m farther back" if start.setback else "")


def _initial(state: InitialState) -> str:
    if isinstance(state, InitialOpenness):
        part = f", {state.part}," if state.part else ""
        return f"`{state.fixture}`{part} open by {_bounds((state.low, state.high))}"
    assert isinstance(state, Initial)
    first = (inspect.getdoc(type(state)) or "").splitlines()[0].rstrip(".")
    values = ", ".join(f"{name} {_value(value)}" for name, value in _fields(state))
    return f"{first[0].lower()}{first[1:]} ({values})"


def _object(wanted: ObjectSpec) -> str:
    said = f"`{wanted.name}`: {_number(wanted.count)}{' or '.join(group.replace('_', ' ') for group in wanted.groups)}"
    if wanted.same_category_as:
        kind = "model" if wanted.same_model else "category"
        own = wanted.same_category_as == wanted.name
        said += f", all of one {kind}" if own else f", of the {kind} of `{wanted.same_category_as}`"
    if wanted.part_of:
        said += f" of `{wanted.part_of}`"
    asked = ["graspable"] if wanted.graspable else []
    asked += [word.replace("_", " ") for word in wanted.properties]
    if asked:
        said += f" ({', '.join(asked)})"
    return f"{said}, {_where(wanted.start)}"


def _number(count: tuple[int, int] | str) -> str:
    if isinstance(count, str):
        return f"{count} x "
    low, high = count
    return "" if (low, high) == (1, 1) else f"{low} to {high} x " if low != high else f"{low} x "


def _where(start: OnCounter | InsideOf | Placement) -> str:
    if isinstance(start, OnCounter):
        return f"on the counter {'at' if start.loc == 'above' else 'beside'} `{start.near}`"
    if isinstance(start, InsideOf):
        return f"in `{start.fixture}`"
    said = f"on `{start.object}`" if start.object else f"on or in `{start.fixture}`"
    if start.region.ref:
        said += f" near `{start.region.ref}`"
    return said + (f", in a {start.try_to_place_in} where it can" if start.try_to_place_in else "")


def _fields(record: Any) -> Iterator[tuple[str, Any]]:
    """Names and values of a record's fields that are not left at their default."""
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        default = field.default
        named = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
        if named or value != default:
            yield field.name.replace("_", " "), value


def _value(value: Any) -> str:
    if isinstance(value, tuple) and len(value) == 2 and all(isinstance(v, int | float) for v in value):
        return _bounds(value)
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_value(entry)}" for key, entry in value.items())
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_value, value)) + ")"
    return f"`{value}`" if isinstance(value, str) else str(value)


def _bounds(bounds: tuple[float, float]) -> str:
    low, high = bounds
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
