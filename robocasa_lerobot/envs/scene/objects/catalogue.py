"""Categories of objects with their properties, and the instances of each, split between pretraining and target.

An instance is a small record drawn from (category, index); nothing is stored but the rule. The split follows
RoboCasa365's: of n sorted instances the first max(n - 5, ceil(n / 2)) are for pretraining, the rest for target.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np

from robocasa_lerobot.errors import UnknownNameError, UserError

INSTANCES_PER_CATEGORY = 8

Rgba = tuple[float, float, float, float]


@dataclass(frozen=True)
class Category:
    """A kind of object.

    Attributes:
        name: as in RoboCasa365.
        groups: that it belongs to, besides the group of its own name and "any".
        shape: a key of `objects.shapes.SHAPES`.
        size_low, size_high: bounds of full extents x, y, z in metres, before the shape's own proportions.
        colours: main colours of its instances.
        graspable: whether a parallel gripper of 8 cm opening takes it from above.
        washable: whether it may go into a sink.
    """

    name: str
    groups: tuple[str, ...]
    shape: str
    size_low: tuple[float, float, float]
    size_high: tuple[float, float, float]
    colours: tuple[tuple[float, float, float], ...]
    graspable: bool = True
    washable: bool = False


@dataclass(frozen=True)
class Instance:
    """One object model.

    Attributes:
        category: its kind.
        index: in 0 .. INSTANCES_PER_CATEGORY - 1.
        size: full extents x, y, z, metres.
        rgba: main colour.
        seed: for details such as labels.
    """

    category: Category
    index: int
    size: tuple[float, float, float]
    rgba: Rgba
    seed: int

    @property
    def model(self) -> str:
        """Name of the model, e.g. `apple_3`."""
        return f"{self.category.name}_{self.index}"


_RED, _GREEN, _YELLOW = (0.72, 0.13, 0.11), (0.45, 0.62, 0.22), (0.93, 0.80, 0.20)
_STEEL, _DARK, _WOOD = (0.75, 0.76, 0.78), (0.15, 0.15, 0.16), (0.70, 0.50, 0.30)
_BLUE, _WHITE, _TEAL = (0.20, 0.38, 0.66), (0.92, 0.92, 0.90), (0.20, 0.55, 0.52)

_ALL = (
    Category("apple", ("fruit", "food"), "round", (0.064,) * 3, (0.070,) * 3, (_RED, _GREEN, _YELLOW), washable=True),
    Category(
        "orange",
        ("fruit", "food"),
        "round",
        (0.064,) * 3,
        (0.070,) * 3,
        ((0.95, 0.55, 0.12), (0.97, 0.62, 0.18)),
        washable=True,
    ),
    Category(
        "lemon",
        ("fruit", "vegetable", "food"),
        "oval",
        (0.075, 0.050, 0.050),
        (0.088, 0.058, 0.058),
        (_YELLOW,),
        washable=True,
    ),
    Category(
        "tomato", ("vegetable", "food"), "round", (0.058, 0.058, 0.050), (0.068, 0.068, 0.058), (_RED,), washable=True
    ),
    Category(
        "potato",
        ("vegetable", "food"),
        "oval",
        (0.085, 0.055, 0.050),
        (0.105, 0.065, 0.058),
        ((0.72, 0.58, 0.38), (0.62, 0.45, 0.30)),
        washable=True,
    ),
    Category(
        "cucumber",
        ("vegetable", "food"),
        "rod",
        (0.15, 0.038, 0.038),
        (0.19, 0.046, 0.046),
        ((0.20, 0.42, 0.16),),
        washable=True,
    ),
    Category(
        "carrot",
        ("vegetable", "food"),
        "rod",
        (0.14, 0.030, 0.030),
        (0.18, 0.038, 0.038),
        ((0.93, 0.48, 0.12),),
        washable=True,
    ),
    Category(
        "bar_soap",
        ("cleaner",),
        "block",
        (0.080, 0.050, 0.026),
        (0.095, 0.060, 0.034),
        ((0.90, 0.86, 0.76), (0.75, 0.85, 0.88), (0.86, 0.72, 0.78)),
        washable=True,
    ),
    Category(
        "sponge",
        ("cleaner",),
        "sponge",
        (0.090, 0.060, 0.030),
        (0.110, 0.068, 0.038),
        (_YELLOW, (0.90, 0.62, 0.30)),
        washable=True,
    ),
    Category(
        "can",
        ("drink", "packaged_food"),
        "can",
        (0.060, 0.060, 0.100),
        (0.066, 0.066, 0.122),
        (_RED, _BLUE, _TEAL, _STEEL),
        washable=True,
    ),
    Category(
        "cup",
        ("receptacle", "stackable"),
        "vessel",
        (0.066, 0.066, 0.085),
        (0.074, 0.074, 0.105),
        (_BLUE, _WHITE, _TEAL, _RED),
        washable=True,
    ),
    Category(
        "bowl",
        ("receptacle", "stackable"),
        "vessel",
        (0.14, 0.14, 0.055),
        (0.17, 0.17, 0.070),
        (_WHITE, _BLUE, _TEAL),
        graspable=False,
        washable=True,
    ),
    Category(
        "boxed_drink",
        ("drink", "packaged_food"),
        "carton",
        (0.055, 0.042, 0.105),
        (0.065, 0.050, 0.130),
        (_GREEN, _RED, _BLUE),
    ),
    Category(
        "cereal",
        ("packaged_food",),
        "carton",
        (0.150, 0.055, 0.220),
        (0.190, 0.070, 0.270),
        (_YELLOW, _RED, _BLUE),
        graspable=False,
    ),
    Category(
        "spoon",
        ("utensil",),
        "spoon",
        (0.170, 0.036, 0.018),
        (0.190, 0.042, 0.022),
        (_STEEL, _WOOD),
        graspable=False,
        washable=True,
    ),
    Category(
        "fork",
        ("utensil",),
        "fork",
        (0.170, 0.028, 0.014),
        (0.195, 0.034, 0.018),
        (_STEEL,),
        graspable=False,
        washable=True,
    ),
    Category(
        "knife",
        ("utensil",),
        "knife",
        (0.190, 0.022, 0.014),
        (0.230, 0.028, 0.018),
        (_STEEL,),
        graspable=False,
        washable=True,
    ),
    Category(
        "spatula",
        ("utensil",),
        "spatula",
        (0.240, 0.070, 0.016),
        (0.280, 0.085, 0.020),
        (_DARK, _WOOD),
        graspable=False,
        washable=True,
    ),
    Category("rolling_pin", ("tool",), "rod", (0.22, 0.042, 0.042), (0.26, 0.050, 0.050), (_WOOD,), washable=True),
    Category("peeler", ("tool",), "knife", (0.150, 0.026, 0.018), (0.170, 0.032, 0.022), (_STEEL,), washable=True),
)

CATEGORIES: dict[str, Category] = {category.name: category for category in _ALL}
GROUPS: tuple[str, ...] = tuple(sorted({"any", *CATEGORIES, *(g for c in _ALL for g in c.groups)}))
SPLITS = ("pretrain", "target")


def categories_of(group: str) -> tuple[Category, ...]:
    """Categories of a group; "any" has all, and every category is a group of its own.

    Raises:
        UnknownNameError: no such group.
    """
    if group not in GROUPS:
        raise UnknownNameError("object group", group, GROUPS)
    return tuple(c for c in _ALL if group in ("any", c.name, *c.groups))


def split_indices(split: str) -> range:
    """Indices of the instances of a split.

    Raises:
        UnknownNameError: no such split.
    """
    pretrain = max(INSTANCES_PER_CATEGORY - 5, math.ceil(INSTANCES_PER_CATEGORY / 2))
    ranges = {"pretrain": range(pretrain), "target": range(pretrain, INSTANCES_PER_CATEGORY)}
    if split not in ranges:
        raise UnknownNameError("object split", split, SPLITS)
    return ranges[split]


def instance(category: Category, index: int) -> Instance:
    """The instance of an index: a pure function of category and index."""
    seed = zlib.crc32(f"{category.name}/{index}".encode())
    rng = np.random.default_rng(seed)
    share = rng.random(3)
    if category.size_low[0] == category.size_low[1]:
        share[1] = share[0]  # round things stay round
    low, high = np.asarray(category.size_low), np.asarray(category.size_high)
    size = low + share * (high - low)
    colour = np.asarray(category.colours[index % len(category.colours)]) * rng.uniform(0.88, 1.06)
    red, green, blue = (float(np.clip(c, 0, 1)) for c in colour)
    return Instance(category, index, (float(size[0]), float(size[1]), float(size[2])), (red, green, blue, 1.0), seed)


def sample(
    rng: np.random.Generator,
    groups: tuple[str, ...],
    split: str,
    *,
    graspable: bool = False,
    washable: bool = False,
    max_height: float | None = None,
    exclude: frozenset[str] = frozenset(),
) -> Instance:
    """Draw an instance: a category of the groups that has the properties, then one of the split's instances.

    Args:
        rng: generator that is advanced.
        groups: names of groups; their categories are united.
        split: "pretrain" or "target".
        graspable: ask for the property.
        washable: ask for the property.
        max_height: bound of the size along z, metres.
        exclude: names of categories that are not wanted.

    Raises:
        UserError: no category is left.
    """
    names = sorted({category.name for group in groups for category in categories_of(group)} - exclude)
    pool = [CATEGORIES[name] for name in names]
    pool = [c for c in pool if (c.graspable or not graspable) and (c.washable or not washable)]
    pool = [c for c in pool if max_height is None or c.size_high[2] <= max_height]
    if not pool:
        raise UserError(f"no object category fits groups {groups} with the properties asked for; widen the groups.")
    category = pool[int(rng.integers(len(pool)))]
    return instance(category, int(rng.choice(split_indices(split))))
