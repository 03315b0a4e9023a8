"""Categories of objects with their properties, the instances of each, and how they are drawn.

The categories are records in `categories.yaml`. An instance is a pure function of (category, index): nothing is stored
but the rule. The split follows RoboCasa365's: of n sorted instances the first max(n - 5, ceil(n / 2)) are for
pretraining, the rest for target; with ten of each category, five and five.
"""

from __future__ import annotations

import functools
import math
import zlib
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from robocasa_lerobot.envs.kept_files import kept, stamp
from robocasa_lerobot.envs.objects.draft import Draft, Interior, Model
from robocasa_lerobot.envs.objects.forms import find_form
from robocasa_lerobot.envs.objects.model_bytes import from_bytes, to_bytes
from robocasa_lerobot.envs.objects.paint import Rgb
from robocasa_lerobot.errors import UnknownNameError, UserError

INSTANCES_PER_CATEGORY = 10
SPLITS = ("pretrain", "target")
PROPERTIES = ("graspable", "washable", "cookable", "microwavable", "fridgable", "freezable", "dishwashable")

Rgba = tuple[float, float, float, float]
Size = tuple[float, float, float]

_SPREAD = 0.06  # of sizes around a category's own, to either side, all axes alike
_STRETCH = 0.05  # of single axes, on top of it
# Groups that are made of others (docs/robocasa.md, section 6).
_UNIONS: dict[str, tuple[str, ...]] = {
    "food": ("vegetable", "fruit", "sweets", "dairy", "meat", "bread_food", "pastry", "cooked_food"),
    "in_container": ("food", "tool", "iced_item"),
    "container": ("plate",),
    "container_set2": ("plate", "bowl"),
    "kettle": ("kettle_non_electric",),
    "cookware": ("pan", "pot", "saucepan", "kettle_non_electric"),
    "pots_and_pans": ("pan", "pot"),
    "food_set1": ("apple", "baguette", "banana", "carrot", "cheese", "cucumber", "egg", "lemon", "orange", "potato"),
    "group1": ("apple", "carrot", "banana", "bowl", "can"),
    "oven_ready": (
        "corn",
        "fish",
        "steak",
        "tray",
        "potato",
        "sweet_potato",
        "chicken_drumstick",
        "eggplant",
        "broccoli",
    ),
}
_EVERYTHING = ("all", "any")


@dataclass(frozen=True)
class Category:
    """A kind of object.

    Attributes:
        name: as in RoboCasa365.
        groups: that it belongs to, besides the group of its own name, the unions of groups, "all" and "any".
        properties: of PROPERTIES.
        shape: name of its form, of `objects.draft.FORMS`.
        typical_size: full extents x, y, z in metres, as it stands or lies.
        colours: main colours, which its instances have in turn.
        tied: x and y of its instances keep their ratio.
        args: of the form.
        auxiliary: category of the part that comes with it, if any.
        extended: of those that RoboCasa365's default registries do not draw.
        added: of those that RoboCasa365 has no category for.
    """

    name: str
    groups: tuple[str, ...]
    properties: frozenset[str]
    shape: str
    typical_size: Size
    colours: tuple[Rgb, ...]
    tied: bool = False
    args: dict[str, Any] = field(default_factory=dict, compare=False)
    auxiliary: str | None = None
    extended: bool = False
    added: bool = False

    @property
    def graspable(self) -> bool:
        """Whether a parallel gripper of 8 cm opening can lift it."""
        return "graspable" in self.properties

    @property
    def largest(self) -> Size:
        """Bounds of the full extents of its instances, metres."""
        x, y, z = (s * (1 + _SPREAD) * (1 + _STRETCH) for s in self.typical_size)
        return x, y, z


@dataclass(frozen=True)
class Instance:
    """One object model.

    Attributes:
        category: its kind.
        index: in 0 .. INSTANCES_PER_CATEGORY - 1.
        own_size: full extents x, y, z as it was made, metres.
        rgba: main colour.
        seed: for details such as labels.
        scale: factors of its axes.
        upright: whether its longest axis was turned up.
        face_down: whether it was turned over about its x axis.
        stained: the colour that all of it has instead of its own looks.
    """

    category: Category
    index: int
    own_size: Size
    rgba: Rgba
    seed: int
    scale: Size = (1.0, 1.0, 1.0)
    upright: bool = False
    face_down: bool = False
    stained: Rgb | None = None

    @property
    def model(self) -> str:
        """Name of the model, e.g. `apple_3`."""
        return f"{self.category.name}_{self.index}"

    @functools.cached_property
    def size(self) -> Size:
        """Full extents x, y, z as it is put down, scaled and turned, metres."""
        x, y, z = (s * k for s, k in zip(self.own_size, self.scale, strict=True))
        if self.upright and max(x, y) > z:
            return (z, y, x) if x >= y else (x, z, y)
        return x, y, z

    @property
    def upright_axis(self) -> str | None:
        """Axis that a quarter turn about brings the longest extent up: "x", "y", or None where it stands already."""
        x, y, z = (s * k for s, k in zip(self.own_size, self.scale, strict=True))
        if not self.upright or max(x, y) <= z:
            return None
        return "y" if x >= y else "x"

    @property
    def horizontal_radius(self) -> float:
        """Half of the diagonal of its footprint, metres, as RoboCasa's placement and receptacle tests use it."""
        return math.hypot(self.size[0], self.size[1]) / 2

    @property
    def bottom_offset(self) -> float:
        """Height of its underside relative to its origin, metres (negative)."""
        return -self.size[2] / 2

    @property
    def top_offset(self) -> float:
        """Height of its top relative to its origin, metres."""
        return self.size[2] / 2

    @functools.cached_property
    def interior(self) -> Interior | None:
        """Its interior in the frame of its body; None if it holds no other objects, or was turned."""
        inside = model_of(self).interior
        if inside is None or self.upright_axis is not None or self.face_down:
            return None
        cx, cy, cz = (c * k for c, k in zip(inside.center, self.scale, strict=True))
        hx, hy, hz = (h * k for h, k in zip(inside.half, self.scale, strict=True))
        return Interior((cx, cy, cz), (hx, hy, hz))


def _colour(text: str) -> Rgb:
    return (int(text[1:3], 16) / 255, int(text[3:5], 16) / 255, int(text[5:7], 16) / 255)


def _read() -> dict[str, Category]:
    file = resources.files(__package__) / "categories.yaml"
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast where libyaml is there
    records = yaml.load(file.read_text(encoding="utf-8"), Loader=loader)
    categories = {}
    for name, record in records.items():
        unknown = set(record["properties"]) - set(PROPERTIES)
        assert not unknown, (name, unknown)
        x, y, z = record["size"]
        categories[name] = Category(
            name=name,
            groups=tuple(record["groups"]),
            properties=frozenset(record["properties"]),
            shape=record["form"],
            typical_size=(x, y, z),
            colours=tuple(_colour(c) for c in record["colours"]),
            tied=record.get("tied", False) or x == y,
            args=record.get("args", {}),
            auxiliary=record.get("auxiliary"),
            extended=record.get("extended", False),
            added=record.get("added", False),
        )
    return categories


CATEGORIES: dict[str, Category] = _read()
# What is made to fit another thing, as a lid its saucepan, has its size drawn with that one's seed.
_FITS = {c.auxiliary: c.name for c in CATEGORIES.values() if c.auxiliary}
_BASE_GROUPS = tuple(sorted({g for c in CATEGORIES.values() for g in c.groups}))
GROUPS: tuple[str, ...] = tuple(sorted({*_EVERYTHING, *_UNIONS, *_BASE_GROUPS, *CATEGORIES}))


@functools.cache
def categories_of(group: str) -> tuple[Category, ...]:
    """Categories of a group, by name; "all" and "any" have all, and every category is a group of its own.

    Raises:
        UnknownNameError: no such group.
    """
    if group not in GROUPS:
        raise UnknownNameError("object group", group, GROUPS)
    if group in _EVERYTHING:
        return tuple(CATEGORIES[name] for name in sorted(CATEGORIES))
    names = {c.name for c in CATEGORIES.values() if group == c.name or group in c.groups}
    for member in _UNIONS.get(group, ()):
        names |= {c.name for c in categories_of(member)}
    return tuple(CATEGORIES[name] for name in sorted(names))


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


@functools.cache
def instance(category: Category, index: int) -> Instance:
    """The instance of an index: a pure function of category and index."""
    seed = zlib.crc32(f"{_FITS.get(category.name, category.name)}/{index}".encode())
    rng = np.random.default_rng(seed)
    factors = 1 + rng.uniform(-_SPREAD, _SPREAD) + np.zeros(3)
    stretch = 1 + rng.uniform(-_STRETCH, _STRETCH, 3)
    if category.tied:
        stretch[1] = stretch[0] = 1.0
    size = np.round(np.asarray(category.typical_size) * factors * stretch, 5)
    colour = np.asarray(category.colours[index % len(category.colours)]) * rng.uniform(0.9, 1.06)
    red, green, blue = (float(np.clip(c, 0, 1)) for c in colour)
    return Instance(category, index, (float(size[0]), float(size[1]), float(size[2])), (red, green, blue, 1.0), seed)


@functools.lru_cache(maxsize=1024)
def _model(category: Category, index: int) -> Model:
    item = instance(category, index)
    red, green, blue, _ = item.rgba
    form = find_form(category.shape)

    def drawn() -> Model:
        rng = np.random.default_rng([item.seed, 1])
        draft = Draft(item.own_size, (red, green, blue), rng, category.args, category.name, item.seed)
        form(draft)
        return draft.model()

    if not form.__module__.startswith(f"{__package__}."):  # somebody's own, whose code may change unseen
        return drawn()
    made_from = (category.shape, item.own_size, item.rgba, category.args, category.name, item.seed)
    made_by = stamp(Path(__file__).parent)
    content = kept("objects", f"{category.name}_{index}", made_from, made_by, lambda: to_bytes(drawn()))
    return from_bytes(content)


def model_of(item: Instance) -> Model:
    """The shape of an instance, before scaling and turning; made once on a machine (`envs.kept_files`).

    Raises:
        UnknownNameError: the category's form does not exist.
    """
    return _model(item.category, item.index)


def scaled(item: Instance, factors: float | Iterable[float]) -> Instance:
    """The instance with its axes scaled by one factor, or one for each of x, y, z.

    Raises:
        UserError: not one or three positive factors.
    """
    x, y, z = (a * b for a, b in zip(item.scale, _three(factors), strict=True))
    return replace(item, scale=(x, y, z))


def _three(factors: float | Iterable[float]) -> list[float]:
    """Factors of x, y and z, or a UserError where they are not one or three positive ones."""
    values = [float(factors)] * 3 if isinstance(factors, int | float) else [float(f) for f in factors]
    if len(values) != 3 or min(values) <= 0:
        raise UserError(f"object scale {values}: expected one positive factor, or three of them for x, y and z.")
    return values


def pool(
    groups: Collection[str],
    *,
    properties: Iterable[str] = (),
    exclude: Iterable[str] = (),
    max_size: tuple[float | None, float | None, float | None] = (None, None, None),
    scale: float | Iterable[float] = 1.0,
    with_added: bool = False,
) -> tuple[Category, ...]:
    """Categories of any of the groups that have all properties, by name; `added` ones only by their own names.

    Args:
        groups: names of groups; their categories are united.
        properties: of PROPERTIES, all asked for.
        exclude: names of groups or categories that are not wanted.
        max_size: bounds of the full extents of every instance along x, y, z, metres; None leaves an axis free.
        scale: factor, or three, that the object will be scaled by.
        with_added: also those that we added.

    Raises:
        UnknownNameError: no such group or property.
        UserError: not one or three positive factors.
    """
    for name in properties:
        if name not in PROPERTIES:
            raise UnknownNameError("object property", name, PROPERTIES)
    factors = _three(scale)
    unwanted = {c.name for group in exclude for c in categories_of(group)}
    found = {c.name: c for group in groups for c in categories_of(group) if c.name not in unwanted}
    wanted = set(properties)

    def fits(category: Category) -> bool:
        sizes = zip(category.largest, factors, max_size, strict=True)
        return all(bound is None or size * factor <= bound for size, factor, bound in sizes)

    fitting = tuple(found[name] for name in sorted(found) if wanted <= found[name].properties and fits(found[name]))
    return fitting if with_added else _asked_for(fitting, groups)


def _asked_for(categories: Iterable[Category], groups: Collection[str]) -> tuple[Category, ...]:
    """Without those that we added, but for those that are named themselves."""
    return tuple(category for category in categories if not category.added or category.name in groups)


def sample(
    rng: np.random.Generator,
    groups: tuple[str, ...],
    split: str,
    *,
    exclude: frozenset[str] = frozenset(),
    properties: Iterable[str] = (),
    max_size: tuple[float | None, float | None, float | None] = (None, None, None),
    object_scale: float | Iterable[float] = 1.0,
    rotate_upright: bool = False,
) -> Instance:
    """Draw an instance: a category of the groups that has the properties, then one of the split's instances.

    Categories are drawn alike, as each has the same number of instances.

    Args:
        rng: generator that is advanced.
        groups: names of groups; their categories are united.
        split: "pretrain" or "target".
        exclude: names of groups or categories that are not wanted.
        properties: of PROPERTIES, all asked for.
        max_size: bounds of the full extents along x, y, z, metres; None leaves an axis free.
        object_scale: factor of its size, or three.
        rotate_upright: turn its longest axis up.

    Raises:
        UnknownNameError: no such group, property or split.
        UserError: no category is left.
    """
    wanted = tuple(properties)
    factors = object_scale if isinstance(object_scale, int | float) else tuple(object_scale)
    drawn = pool(groups, properties=wanted, exclude=exclude, max_size=max_size, scale=factors, with_added=True)
    if not (categories := _asked_for(drawn, groups)):
        raise UserError(
            f"no object category of groups {tuple(groups)} has the properties {sorted(wanted)} within {max_size} m, "
            f"without {sorted(exclude)}; widen the groups or the bounds."
        )
    # One of ours is drawn again, so that most scenes of a seed are as they were when those were drawn, too.
    category = drawn[int(rng.integers(len(drawn)))]
    if category not in categories:
        category = categories[int(rng.integers(len(categories)))]
    item = scaled(instance(category, int(rng.choice(split_indices(split)))), factors)
    return replace(item, upright=True) if rotate_upright else item


def auxiliary(item: Instance) -> Instance | None:
    """The part that comes with an instance and fits it, e.g. the lid of a saucepan: same index, same scale."""
    if item.category.auxiliary is None:
        return None
    return replace(instance(CATEGORIES[item.category.auxiliary], item.index), scale=item.scale)
