"""Contact sheets of objects: every category at a glance."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style, style_ids
from robocasa_lerobot.envs.objects.catalogue import CATEGORIES, Instance, instance
from robocasa_lerobot.envs.objects.shapes import add_object
from robocasa_lerobot.envs.rendering import SceneRenderer

_LABEL_PX = 14


def object_pictures(
    out: Path,
    names: Sequence[str] | None = None,
    *,
    indices: Sequence[int] = (0,),
    tile: int = 160,
    columns: int = 8,
    rows: int = 6,
    title: bool = True,
) -> list[Path]:
    """Write contact sheets `objects_<i>.png` of categories (default: all) to a folder; returns their paths.

    Args:
        out: folder, made if need be.
        names: of categories.
        indices: instances of each category, one tile each.
        tile: edge of a tile, pixels.
        columns: tiles in a row.
        rows: of tiles on a sheet.
        title: write the name of the model below each.

    Raises:
        UnknownNameError: no style to light the scene with.
    """
    out.mkdir(parents=True, exist_ok=True)
    items = [instance(CATEGORIES[name], index) for name in names or CATEGORIES for index in indices]
    paths = []
    for sheet, start in enumerate(range(0, len(items), columns * rows)):
        chosen = items[start : start + columns * rows]
        edge = tile + (_LABEL_PX if title else 0)
        picture = Image.new("RGB", (columns * tile, -(-len(chosen) // columns) * edge), (250, 250, 250))
        draw = ImageDraw.Draw(picture)
        for k, (item, pixels) in enumerate(zip(chosen, object_tiles(chosen, tile), strict=True)):
            x, y = (k % columns) * tile, (k // columns) * edge
            picture.paste(Image.fromarray(pixels), (x, y))
            if title:
                draw.text((x + 4, y + tile), item.model, fill=(20, 20, 20))
        path = out / f"objects_{sheet}.png"
        picture.save(path)
        paths.append(path)
    return paths


def object_tiles(items: Sequence[Instance], size: int) -> list[NDArray[np.uint8]]:
    """A picture (size, size, 3) of each instance on a light table, from in front and above."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.visual.headlight.ambient = [0.42, 0.42, 0.42]
    spec.visual.headlight.diffuse = [0.2, 0.2, 0.2]
    spec.stat.extent = 1.0
    spec.visual.map.znear, spec.visual.map.zfar = 0.005, 10.0
    light = spec.worldbody.add_light(pos=[0, -1, 2], dir=[0.35, 0.5, -1.0])
    light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    light.diffuse = [0.5, 0.5, 0.5]
    light.castshadow = False
    palette = MaterialPalette(spec, load_style(style_ids()[0]))
    gap = 6.0
    for k, item in enumerate(items):
        table = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2.9, 2.9, 0.01], pos=[gap * k, 0, -0.01])
        table.rgba = [0.83, 0.82, 0.80, 1.0]
        table.group = 1
        body = add_object(spec, palette, f"obj{k}", item)
        body.pos = [gap * k, 0.0, item.size[2] / 2]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = SceneRenderer(model, size, size)
    tiles = []
    for k, item in enumerate(items):
        camera = mujoco.MjvCamera()
        camera.lookat = [gap * k, 0.0, item.size[2] * 0.5]
        reach = float(np.linalg.norm(item.size))
        camera.distance = 1.36 * reach
        camera.azimuth, camera.elevation = 115.0, -32.0
        tiles.append(renderer.render(data, camera))
    renderer.close()
    return tiles
