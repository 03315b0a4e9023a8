"""What a gallery shows beside tasks: layouts, styles, appliances and objects, as pictures with a title."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds, models_of
from robocasa_lerobot.envs.kitchens.layout import layout_ids, layout_record
from robocasa_lerobot.envs.kitchens.materials import load_style, split_of, style_ids
from robocasa_lerobot.envs.objects.catalogue import CATEGORIES, instance, split_indices
from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.gallery.appliance_pictures import appliance_pictures
from robocasa_lerobot.gallery.kitchen_pictures import kitchen_photo, kitchen_plan
from robocasa_lerobot.gallery.object_pictures import object_tiles

SPLITS = ("pretrain", "target")
_SHOWN_IN = {"target": 2, "pretrain": 12}  # the layout that a style is shown in: an L with an island
_OBJECTS_AT_ONCE = 24
_LETTER_PX, _LINE_PX = 6, 12  # of captions: about, and at most


@dataclass(frozen=True)
class Tile:
    """A picture of a gallery.

    Attributes:
        title: below it.
        category: that pages are filtered by.
        split: "pretrain" or "target".
        picture: (height, width, 3).
    """

    title: str
    category: str
    split: str
    picture: NDArray[np.uint8]


def layouts(splits: tuple[str, ...], categories: tuple[str, ...], size: int) -> Iterator[Tile]:
    """Every layout from above, in the style of its number; categories are plans."""
    for layout_id in layout_ids():
        record = layout_record(layout_id)
        if split_of(layout_id) in splits and (not categories or record["plan"] in categories):
            picture = kitchen_plan(layout_id, layout_id, (size, round(1.2 * size)))
            yield Tile(f"layout {layout_id}: {record['name']}", record["plan"], split_of(layout_id), picture)


def styles(splits: tuple[str, ...], categories: tuple[str, ...], size: int) -> Iterator[Tile]:
    """Every style in a kitchen of its split; categories are the designs of fronts."""
    for style_id in style_ids():
        style, split = load_style(style_id), split_of(style_id)
        if split in splits and (not categories or style.panel in categories):
            picture = kitchen_photo(_SHOWN_IN[split], style_id, (size, round(1.6 * size)))
            yield Tile(f"style {style_id}: {style.name}", style.panel, split, picture)


def appliances(splits: tuple[str, ...], categories: tuple[str, ...], size: int) -> Iterator[Tile]:
    """Every appliance in its states side by side; categories are fixture types."""
    for kind in kinds():
        for record in models_of(kind):
            if record.kind == kind and record.split in splits and (not categories or kind in categories):
                states = appliance_pictures(record.model_id, size=size)
                yield Tile(f"{record.model_id}: {', '.join(states)}", kind, record.split, np.hstack([*states.values()]))


def objects(splits: tuple[str, ...], categories: tuple[str, ...], size: int) -> Iterator[Tile]:
    """The first instance of every object category in each split; categories are theirs, or groups."""
    chosen = [
        (split, instance(category, split_indices(split)[0]))
        for name, category in sorted(CATEGORIES.items())
        for split in splits
        if not categories or name in categories or set(category.groups) & set(categories)
    ]
    for start in range(0, len(chosen), _OBJECTS_AT_ONCE):
        batch = chosen[start : start + _OBJECTS_AT_ONCE]
        pictures = object_tiles([item for _, item in batch], size)
        for (split, item), picture in zip(batch, pictures, strict=True):
            yield Tile(item.model, item.category.groups[0] if item.category.groups else "untyped", split, picture)


Section = Callable[[tuple[str, ...], tuple[str, ...], int], Iterator[Tile]]
# By name: how its pictures are made, their height in pixels, and the columns of a contact sheet.
SECTIONS: dict[str, tuple[Section, int, int]] = {
    "layouts": (layouts, 300, 4),
    "styles": (styles, 270, 4),
    "appliances": (appliances, 150, 3),
    "objects": (objects, 140, 10),
}


def categories_of(section: str) -> set[str]:
    """What a section's pictures can be chosen by."""
    if section == "layouts":
        return {layout_record(layout_id)["plan"] for layout_id in layout_ids()}
    if section == "styles":
        return {load_style(style_id).panel for style_id in style_ids()}
    if section == "appliances":
        return set(kinds())
    return {*CATEGORIES, *(group for category in CATEGORIES.values() for group in category.groups)}


def check_categories(sections: Sequence[str], categories: Sequence[str]) -> None:
    """Every category is one of some section.

    Raises:
        UnknownNameError: one is of none; names the closest ones.
    """
    known = set().union(*map(categories_of, sections))
    for category in categories:
        if category not in known:
            raise UnknownNameError(f"category of {', '.join(sections)}", category, known)


def tiles_of(section: str, splits: tuple[str, ...] = SPLITS, categories: tuple[str, ...] = ()) -> Iterator[Tile]:
    """Pictures of a section.

    Raises:
        UnknownNameError: no such section or split.
    """
    if section not in SECTIONS:
        raise UnknownNameError("section of the gallery", section, SECTIONS)
    for split in splits:
        if split not in SPLITS:
            raise UnknownNameError("split", split, SPLITS)
    make, size, _ = SECTIONS[section]
    yield from make(splits, categories, size)


def write_sheets(section: str, tiles: list[Tile], out: Path, rows: int = 6) -> list[Path]:
    """Write contact sheets `<section>_<i>.png` to a folder; returns their paths."""
    out.mkdir(parents=True, exist_ok=True)
    columns = SECTIONS[section][2]
    paths = []
    for sheet, start in enumerate(range(0, len(tiles), columns * rows)):
        chosen = tiles[start : start + columns * rows]
        width = max(tile.picture.shape[1] for tile in chosen)
        captions = [textwrap.wrap(tile.title, width // _LETTER_PX - 1) for tile in chosen]
        below = max(tile.picture.shape[0] for tile in chosen)
        height = below + _LINE_PX * max(map(len, captions)) + 4
        picture = Image.new("RGB", (columns * width, -(-len(chosen) // columns) * height), (250, 250, 250))
        draw = ImageDraw.Draw(picture)
        for index, (tile, lines) in enumerate(zip(chosen, captions, strict=True)):
            x, y = index % columns * width, index // columns * height
            picture.paste(Image.fromarray(tile.picture), (x, y))
            for number, line in enumerate(lines):
                draw.text((x + 4, y + below + 2 + number * _LINE_PX), line, fill=(20, 20, 20))
        paths.append(out / f"{section}_{sheet}.png")
        picture.save(paths[-1])
    return paths
