"""Which kitchens a split has: pairs of a layout and a style, and the groups and lists that users name them by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from robocasa_lerobot.envs.kitchens.layout import layout_ids
from robocasa_lerobot.envs.kitchens.materials import LAST_TARGET_ID, style_ids
from robocasa_lerobot.errors import UnknownNameError, UserError

SPLITS = ("pretrain", "target")
# Parts of the pretraining kitchens, for choosing between policies without a look at the target kitchens: fifty of the
# 2,500 to evaluate in, each layout and each style once, and all others to record in.
TRAINING, VALIDATION = "pretrain_train", "pretrain_val"
PARTS = {TRAINING: "pretrain", VALIDATION: "pretrain"}
Pairs = list[tuple[int, int]]

# Ids of groups of layouts, or of styles, by RoboCasa's negative numbers (docs/robocasa.md, section 6).
GROUPS: dict[int, tuple[int, ...]] = {
    -1: tuple(range(1, 11)),
    -2: tuple(range(11, 61)),
    -3: tuple(range(1, 61)),
    -4: (1, 3, 5, 6, 8),
    -5: (2, 4, 7, 9, 10),
    -6: (2, 4, 7, 8, 9, 10),
}
FIVE_LAYOUTS, FIVE_STYLES = (11, 15, 18, 40, 50), (14, 28, 34, 46, 58)
NAMED: dict[str, Pairs] = {
    "5x5": [(layout, style) for layout in FIVE_LAYOUTS for style in FIVE_STYLES],
    "5x1": [(layout, 34) for layout in FIVE_LAYOUTS],
}

# Layouts that lack something, or have it out of reach, by what tasks call them.
EXCLUDED: dict[str, tuple[int, ...]] = {
    "double_cab": (32, 41, 59),
    "dining_counter": (1, 3, 5, 6, 18, 20, 36, 39, 40, 43, 47, 50, 52),
    "island": (1, 3, 5, 6, 8, 9, 10, 11, 13, 18, 19, 22, 27, 30, 36, 40, 43, 46, 47, 52, 53, 60),
}
_WITH = {
    "oven": (2, 4, 7, 9, 12, 15, 17, 18, 29, 31, 34, 35, 37, 39, 42),
    "freezer": (2, 7, 9, 18, 21, 24, 29, 32, 38, 41, 43, 44, 45, 47, 57),
}
EXCLUDED |= {need: tuple(i for i in range(1, 61) if i not in usable) for need, usable in _WITH.items()}
PROBLEMATIC_BLENDER_LID_STYLES = (13, 29, 31)

_STYLES_ON = 29  # styles further on is the one in which a layout is kept: none of the 25 kitchens of `5x5`


def benchmark_split(split: str) -> str:
    """The benchmark's own split of which this is one, or a part: it says which objects and appliances there are.

    Raises:
        UnknownNameError: no such split.
    """
    if split not in (*SPLITS, *PARTS):
        raise UnknownNameError("split", split, (*SPLITS, *PARTS))
    return PARTS.get(split, split)


def validation_kitchens() -> Pairs:
    """The fifty pretraining kitchens in which nothing of `pretrain_train` is recorded, by layout."""
    ids = GROUPS[-2]
    return [(layout, ids[(place + _STYLES_ON) % len(ids)]) for place, layout in enumerate(ids)]


def expand(ids: int | Iterable[int], what: str) -> tuple[int, ...]:
    """Ids, of which negative ones stand for groups; `what` is "layout" or "style".

    Raises:
        UnknownNameError: an id or group that does not exist.
        UserError: no whole numbers, or none at all.
    """
    given = [ids] if isinstance(ids, int | np.integer | str) else list(ids)
    if not given or any(isinstance(i, str) or i != int(i) for i in given):
        raise UserError(f"{what}s: found {ids!r}, expected whole numbers, such as [1, 12], or -1 for a group of them.")
    known = layout_ids() if what == "layout" else style_ids()
    found: list[int] = []
    for number in map(int, given):  # NumPy's cannot be written as JSON
        if number in GROUPS:
            found += GROUPS[number]
        elif number in known:
            found.append(number)
        else:
            raise UnknownNameError(what, str(number), [*map(str, known), *map(str, GROUPS)])
    return tuple(dict.fromkeys(found))


def scene_ids(
    split: str,
    *,
    layouts: int | Iterable[int] | None = None,
    styles: int | Iterable[int] | None = None,
    exclude: Sequence[str] = (),
    exclude_styles: Sequence[int] = (),
) -> Pairs:
    """(layout, style) pairs of a split: target pairs (i, i), pretraining every layout with every style.

    Args:
        split: one of `SPLITS` or `PARTS`.
        layouts: of these only (ids or group ids); then every layout with every style.
        styles: the same for styles.
        exclude: names of `EXCLUDED`: what the task needs.
        exclude_styles: style ids.

    Raises:
        UnknownNameError: no such split, layout, style, group or need.
        UserError: nothing is left.
    """
    of_split = GROUPS[-1] if benchmark_split(split) == "target" else GROUPS[-2]
    if layouts is None and styles is None and split == "target":
        pairs = [(i, i) for i in range(1, LAST_TARGET_ID + 1)]
    else:
        chosen = [
            of_split if ids is None else expand(ids, what) for ids, what in ((layouts, "layout"), (styles, "style"))
        ]
        pairs = [(i, j) for i in chosen[0] for j in chosen[1]]
    if split in PARTS:
        apart = set(validation_kitchens())
        pairs = [pair for pair in pairs if (pair in apart) == (split == VALIDATION)]
    return without(pairs, exclude, exclude_styles)


def without(pairs: Pairs, exclude: Sequence[str], exclude_styles: Sequence[int] = ()) -> Pairs:
    """Pairs whose layouts have what a task needs.

    Raises:
        UnknownNameError: no such need.
        UserError: nothing is left.
    """
    for need in exclude:
        if need not in EXCLUDED:
            raise UnknownNameError("need of a kitchen", need, EXCLUDED)
    barred = {i for need in exclude for i in EXCLUDED[need]}
    left = [(i, j) for i, j in pairs if i not in barred and j not in exclude_styles]
    if not left:
        raise UserError(
            f"none of {len(pairs)} kitchens meets the needs ({', '.join(exclude) or 'styles'}): name others."
        )
    return left
