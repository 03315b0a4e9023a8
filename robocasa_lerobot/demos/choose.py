"""Which tasks a command is about: names, task sets and `all`, and which of them a demonstrator can solve."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.demos.demonstrator import can_demonstrate, check_demonstrable
from robocasa_lerobot.envs.tasks.registry import get_task, task_names, task_set, task_sets
from robocasa_lerobot.errors import UnknownNameError, UserError

ALL = "all"
KINDS = ("atomic", "composite")  # of tasks: the 65 and the 300


@dataclass(frozen=True)
class Chosen:
    """Tasks that were asked for: those with a demonstrator, and those left out for want of one."""

    names: tuple[str, ...]
    left_out: tuple[str, ...]


def expand_names(text: str) -> tuple[str, ...]:
    """Tasks named in a comma-separated list of names, sets (`atomic_seen`, ...), kinds and `all`, each once.

    Raises:
        UnknownNameError: neither a task nor a set.
        UserError: the list is empty.
    """
    found: list[str] = []
    for word in (part.strip() for part in text.split(",")):
        if word == ALL:
            found += task_names()
        elif word in KINDS:
            found += [name for name in task_names() if task_facts()[name].kind == word]
        elif word in task_sets():
            found += task_set(word)
        elif word in task_names():
            found.append(word)
        elif word:
            known = [*task_names(), *task_sets(), *KINDS, ALL]
            raise UnknownNameError("task or task set", word, known, "`robocasa-lerobot tasks` lists them.")
    if not found:
        raise UserError(f"no task in {text!r}: give names or sets separated by commas, or `{ALL}`.")
    return tuple(dict.fromkeys(found))


def choose_tasks(text: str) -> Chosen:
    """The demonstrated ones among the tasks that a list names; see `expand_names`.

    Raises:
        UnknownNameError: neither a task nor a set.
        UserError: a task that is named itself has no demonstrator, or none of them has.
    """
    names = expand_names(text)
    named = {part.strip() for part in text.split(",")}
    check_demonstrable(name for name in names if name in named)
    able = tuple(name for name in names if can_demonstrate(get_task(name)))
    if not able:
        check_demonstrable(names)
    return Chosen(able, tuple(name for name in names if name not in able))
