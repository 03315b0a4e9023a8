"""Styles: which material each kind of surface has, read from a YAML file, and added to an MjSpec on demand."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

import mujoco
import yaml

from robocasa_lerobot.envs.scene.textures import TextureRecord, texture_png
from robocasa_lerobot.errors import UnknownNameError


@dataclass(frozen=True)
class Surface:
    """Look of a surface: a texture or a plain colour.

    Attributes:
        rgba: plain colour, or the tint of the texture.
        texture: generated texture, if any.
        shininess: in [0, 1], of the highlight; also its strength.
        reflectance: in [0, 1]; only the `quality` render preset shows it.
        emission: in [0, 1], light that it seems to give by itself.
    """

    rgba: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    texture: TextureRecord | None = None
    shininess: float = 0.2
    reflectance: float = 0.0
    emission: float = 0.0


@dataclass(frozen=True)
class Style:
    """The surfaces and parts of a kitchen, by role (`cabinet`, `counter`, `floor`, ...)."""

    style_id: int
    name: str
    surfaces: dict[str, Surface]
    handle: str

    def surface(self, role: str) -> Surface:
        """Surface of a role.

        Raises:
            UnknownNameError: the style file has no such role.
        """
        if role not in self.surfaces:
            raise UnknownNameError(f"surface role of style {self.style_id}", role, self.surfaces)
        return self.surfaces[role]


def _surface(record: dict[str, Any]) -> Surface:
    return Surface(
        rgba=tuple(record.get("rgba", (1.0, 1.0, 1.0, 1.0))),
        texture=_texture(record["texture"]) if "texture" in record else None,
        shininess=record.get("shininess", 0.2),
        reflectance=record.get("reflectance", 0.0),
    )


def _texture(record: dict[str, Any]) -> TextureRecord:
    colours = {key: tuple(record[key]) for key in ("rgb", "rgb2")}
    return TextureRecord(**{**record, **colours})


def style_ids() -> tuple[int, ...]:
    """Ids of the styles that exist as files, ascending."""
    folder = resources.files("robocasa_lerobot.envs.scene") / "styles"
    return tuple(sorted(int(f.name[6:9]) for f in folder.iterdir() if f.name.startswith("style_")))


@functools.cache
def load_style(style_id: int) -> Style:
    """Read a style file.

    Raises:
        UnknownNameError: there is no style of that id.
    """
    if style_id not in style_ids():
        raise UnknownNameError("style", str(style_id), map(str, style_ids()))
    file = resources.files("robocasa_lerobot.envs.scene") / "styles" / f"style_{style_id:03d}.yaml"
    record = yaml.safe_load(file.read_text())
    surfaces = {role: _surface(entry) for role, entry in record["surfaces"].items()}
    return Style(style_id, record["name"], surfaces, record["handle"])


class MaterialPalette:
    """Adds a style's materials to an MjSpec, each once, when a geom first asks for it."""

    def __init__(self, spec: mujoco.MjSpec, style: Style) -> None:
        self._spec, self._style = spec, style
        self._added: set[str] = set()

    def __call__(self, role: str) -> str:
        """Name of the material of a surface role, e.g. `cabinet`."""
        return self.add(f"material_{role}", self._style.surface(role))

    def plain(self, rgba: tuple[float, float, float, float], shininess: float = 0.2) -> str:
        """Name of a material of one colour that no style owns (objects, labels)."""
        name = "plain_" + "".join(f"{round(c * 255):02x}" for c in rgba) + f"_{round(shininess * 100):02d}"
        return self.add(name, Surface(rgba=rgba, shininess=shininess))

    def add(self, name: str, surface: Surface) -> str:
        """Add a material under a name unless it is there already; returns the name."""
        if name in self._added:
            return name
        self._added.add(name)
        material = self._spec.add_material(name=name, rgba=surface.rgba)
        material.specular = 0.3 + 0.5 * surface.shininess
        material.shininess = surface.shininess
        material.reflectance = surface.reflectance
        material.emission = surface.emission
        if surface.texture is not None:
            record = surface.texture
            texture_name = f"{name}_texture"
            texture = self._spec.add_texture(name=texture_name, type=mujoco.mjtTexture.mjTEXTURE_2D)
            texture.file = record.file
            self._spec.assets[record.file] = texture_png(record)
            material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture_name
            material.texuniform = True
            # MuJoCo maps texture coordinates over half lengths: one repetition covers 2 / texrepeat metres.
            material.texrepeat = [2.0 / record.scale_m, 2.0 / record.scale_m]
        return name
