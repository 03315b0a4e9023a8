"""What the page of tasks says of one of them: from its declaration, the benchmark's facts, and what was measured."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.benchmark.tasks import TaskFacts, published_task_sets, task_facts
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gallery.task_pages import goal_lines

# Upper ends of the classes of length, seconds of the human median; the last has none.
LENGTHS_S = (15, 30, 60)


@dataclass(frozen=True)
class Rate:
    """How often a task's demonstrator solves it; `low` and `high` are the ends of a 95 % interval, shares of 1."""

    solved: int
    trials: int
    low: float
    high: float


@dataclass(frozen=True)
class Card:
    """A task on the page.

    Attributes:
        name: of the task.
        declared: whether it can be run here; what follows from a declaration is empty where it cannot.
        demonstrated: whether it has a demonstrator.
        kind: "atomic" or "composite".
        family, activity: in words; empty for atomic tasks.
        skills, fixtures: in words.
        length: class of the human median's length, in words.
        human_s: length of a human demonstration, seconds.
        horizon_s: seconds until an episode has failed; None where none is known.
        sets: of the benchmark.
        instruction, summary: one sentence each; words in braces are drawn at reset.
        paraphrases: other wordings of the instruction.
        goal: depth and text of each line.
        rate: of the demonstrator, if it was measured.
    """

    name: str
    declared: bool
    demonstrated: bool
    kind: str
    family: str
    activity: str
    skills: tuple[str, ...]
    fixtures: tuple[str, ...]
    length: str
    human_s: float
    horizon_s: float | None
    sets: tuple[str, ...]
    instruction: str = ""
    summary: str = ""
    paraphrases: tuple[str, ...] = ()
    goal: tuple[tuple[int, str], ...] = ()
    rate: Rate | None = None


def cards(rates: Mapping[str, Rate] | None = None) -> list[Card]:
    """All tasks of the benchmark by name, those that are not declared here among them."""
    known = set(task_names())
    sets = published_task_sets()
    return [
        _card(
            facts,
            get_task(name) if name in known else None,
            tuple(each for each, members in sets.items() if name in members),
            (rates or {}).get(name),
        )
        for name, facts in sorted(task_facts().items())
    ]


def read_rates(path: Path) -> dict[str, Rate]:
    """Rates of demonstrators from a result of `benchmarks/demonstrators.py`.

    Raises:
        UserError: there is no such file, or it holds something else.
    """
    try:
        rows: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["tasks"]
        measured = {name: row for name, row in rows.items() if row.get("trials")}
        return {name: Rate(row["successes"], row["trials"], row["low"], row["high"]) for name, row in measured.items()}
    except OSError as error:
        raise UserError(f"--rates {path}: {error.strerror}. Give a JSON file of benchmarks/demonstrators.py.") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise UserError(
            f"--rates {path}: no result of benchmarks/demonstrators.py, which has `tasks` with successes and trials."
        ) from None


def length_class(seconds: float) -> str:
    """The class of a length, in words."""
    for low, high in zip((0, *LENGTHS_S), LENGTHS_S, strict=False):
        if seconds <= high:
            return f"up to {high} s" if low == 0 else f"{low} to {high} s"
    return f"over {LENGTHS_S[-1]} s"


def _card(facts: TaskFacts, task: Task | None, sets: tuple[str, ...], rate: Rate | None) -> Card:
    own: dict[str, Any] = {}
    if task is not None:
        own = {
            "instruction": task.instruction,
            "summary": task.summary,
            "paraphrases": tuple(task.paraphrases),
            "goal": tuple(_depth(line) for line in goal_lines(goal_of(task))),
        }
    return Card(
        name=facts.task,
        declared=task is not None,
        demonstrated=task is not None and can_demonstrate(task),
        kind=facts.kind,
        family=_words(facts.family),
        activity=_words(facts.activity),
        skills=tuple(dict.fromkeys(_words(stage.skill) for stage in stages_of(task))) if task else (),
        fixtures=tuple(dict.fromkeys(_words(wanted.kind) for wanted in task.fixtures)) if task else (),
        length=length_class(facts.human_seconds),
        human_s=facts.human_seconds,
        horizon_s=facts.horizon / contract.CONTROL_HZ if facts.horizon else None,
        sets=sets,
        rate=rate,
        **own,
    )


def _depth(line: str) -> tuple[int, str]:
    bare = line.lstrip(" ")
    return (len(line) - len(bare)) // 2 - 1, bare.removeprefix("- ").replace("`", "")


def _words(name: str | None) -> str:
    return (name or "").replace("_", " ").replace("-", " ")
