"""Where our tasks differ from the published ones, and how many kitchens admit each: `docs/deviations.md`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from robocasa_lerobot.envs.kitchens.footprints import PlacementError
from robocasa_lerobot.envs.kitchens.layout import load_layout
from robocasa_lerobot.envs.kitchens.splits import EXCLUDED, SPLITS, benchmark_split, scene_ids
from robocasa_lerobot.envs.objects.catalogue import CATEGORIES
from robocasa_lerobot.envs.predicates.objects import INSIDE_MARGIN_M
from robocasa_lerobot.envs.scene.build import arrange
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.envs.tasks.typical import goal_of
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gallery.task_pages import asks_inside
from robocasa_lerobot.jobs.as_completed import as_they_end
from robocasa_lerobot.progress import Bar

TRIES = 5  # arrangements of a task in a kitchen before it counts as one that does not admit it
FEW = Fraction(1, 5)  # of the kitchens: a task that fewer admit says why
_HEAD = """# Other than the original

Generated from the declarations by `make docs`; do not edit. What our tasks ask for is compared with the published tasks
by tests, sentence by sentence (`tests/envs/test_composites.py`, `tests/envs/test_atomic_blueprints.py`); what differs,
and why, stands here. A task that is a little easier or harder than the original's gives another rate: read ours with
this page.

## In many tasks
- Instructions: they ask for the same in words of our own. A policy that was trained on the published data is told
  sentences here that it has not seen, and one that was trained here likewise there.
- Objects: the {extended} categories of which RoboCasa365 has generated models only are drawn like the others, {of} in
  all; its default registries leave them out.
- Nor does a scene have two objects of one category by chance, which an instruction could not tell apart, but in tasks
  that are about several alike.
- Being inside ({inside} tasks): the published tolerance is 0.05 over the length of the region's edge, so that the
  shorter the edge, the farther an object may stand out, half a metre in drawers; here it is {margin} m everywhere, and
  the object's own origin is inside.
- Contacts of objects: `solref` is 0.004 s, two steps of the physics, where the original has 0.001; objects start 4 mm
  above what they stand on and settle before the episode, 10 mm in the original.

## Task by task
A task without a row asks for what the published one does, and all kitchens admit it; where a cell is empty, some
kitchens do not, and nothing else differs.

"Kitchens" are those in which the task finds its fixtures, and room for its objects within {tries} draws: of the
{target} target kitchens, and of one kitchen of each of the {pretrain} pretraining layouts. Scenes are drawn from these
alone.

| task | target | pretraining | what differs |
|---|---:|---:|---|
"""


@dataclass(frozen=True)
class Admitted:
    """Kitchens of a split that a task can be set up in, and how many were asked."""

    kitchens: int
    of: int

    @property
    def share(self) -> Fraction:
        """Of all that were asked."""
        return Fraction(self.kitchens, self.of)


def deviations(tasks: Sequence[Task], workers: int = 1) -> str:
    """The whole of `docs/deviations.md`: each task that differs, or that not all kitchens admit.

    Args:
        tasks: in the order of the page.
        workers: processes; the page is the same with any number.
    """
    asked = {split: kitchens(split) for split in SPLITS}
    lines = [_HEAD.format(**_in_many(), **{split: len(pairs) for split, pairs in asked.items()}).rstrip("\n")]
    jobs = [(task.name,) for task in tasks]
    with Bar(as_they_end(_admitted_in_both, jobs, workers), total=len(jobs), unit="task", disable=None) as bar:
        by_task = dict(bar)
    for task in tasks:
        found, said = by_task[task.name], explained(task)
        if said or any(one.share < 1 for one in found):
            numbers = " | ".join(f"{one.kitchens} of {one.of}" for one in found)
            lines.append(f"| [{task.name}](tasks.md#{task.name.lower()}) | {numbers} | {said} |")
    return "\n".join(lines) + "\n"


def _in_many() -> dict[str, object]:
    """Numbers of what differs in many tasks."""
    tasks = [get_task(name) for name in task_names()]
    return {
        "tries": TRIES,
        "extended": sum(category.extended for category in CATEGORIES.values()),
        "of": sum(not category.added for category in CATEGORIES.values()),
        "inside": sum(asks_inside(goal_of(task)) for task in tasks),
        "margin": INSIDE_MARGIN_M,
    }


def _admitted_in_both(name: str) -> tuple[str, tuple[Admitted, ...]]:
    return name, tuple(admitted(get_task(name), split) for split in ("target", "pretrain"))


def explained(task: Task) -> str:
    """What differs from the published task, and which kitchens it leaves out."""
    return " ".join(filter(None, [task.facts.note, *_left_out(task)]))


def admitted(task: Task, split: str) -> Admitted:
    """In how many kitchens of a split a task can be set up, by drawing; always the same ones."""
    pairs = kitchens(split)
    return Admitted(sum(_fits(task, split, *pair) for pair in pairs), len(pairs))


def kitchens(split: str) -> list[tuple[int, int]]:
    """Of each layout of a split one kitchen: its own style where there are pairs, else styles in turn."""
    found: dict[int, list[int]] = {}
    for layout, style in scene_ids(split):
        found.setdefault(layout, []).append(style)
    return [(layout, styles[number % len(styles)]) for number, (layout, styles) in enumerate(sorted(found.items()))]


def _fits(task: Task, split: str, layout_id: int, style_id: int) -> bool:
    if any(layout_id in EXCLUDED[need] for need in task.needs) or style_id in task.exclude_styles:
        return False
    for seed in range(TRIES):
        try:
            arrange(np.random.default_rng(seed), task, benchmark_split(split), load_layout(layout_id, style_id))
        except (PlacementError, UserError):
            continue
        return True
    return False


def _left_out(task: Task) -> Iterator[str]:
    if task.needs:
        yield f"Kitchens with {' and '.join(need.replace('_', ' ') for need in task.needs)} only, as published."
    if task.exclude_styles:
        yield f"Not in styles {', '.join(map(str, task.exclude_styles))}."
