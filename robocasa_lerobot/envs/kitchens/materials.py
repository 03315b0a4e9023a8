"""Styles: which material each kind of surface has, read from a YAML file, and added to an MjSpec on demand."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from importlib import resources
from typing import Any

import mujoco
import yaml

from robocasa_lerobot.envs.kitchens.textures import TextureRecord, texture_png
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


# What no style has a say in, plain colours all: the splits may share no texture.
COMMON_SURFACES: dict[str, Surface] = {
    "cabinet_glass": Surface(rgba=(0.30, 0.34, 0.36, 1.0), shininess=0.9),
    "window_frame": Surface(rgba=(0.96, 0.96, 0.95, 1.0), shininess=0.3),
    "window_pane": Surface(rgba=(0.72, 0.86, 0.96, 1.0), shininess=0.9),
    "ceiling": Surface(rgba=(0.97, 0.97, 0.96, 1.0), shininess=0.0, emission=0.5),
    "trim": Surface(rgba=(0.95, 0.95, 0.93, 1.0), shininess=0.2),
    "toe_kick": Surface(rgba=(0.13, 0.13, 0.13, 1.0), shininess=0.05),
    "paper": Surface(rgba=(0.97, 0.97, 0.96, 1.0), shininess=0.02),
    "lamp": Surface(rgba=(1.0, 0.97, 0.88, 1.0), shininess=0.0, emission=0.9),
    "appliance_side": Surface(rgba=(0.42, 0.43, 0.45, 1.0), shininess=0.3),
    "appliance_dark": Surface(rgba=(0.07, 0.07, 0.08, 1.0), shininess=0.8),
    "burner": Surface(rgba=(0.18, 0.18, 0.19, 1.0), shininess=0.2),
    "display": Surface(rgba=(0.15, 0.55, 0.60, 1.0), shininess=0.8),
    "faucet": Surface(rgba=(0.72, 0.73, 0.75, 1.0), shininess=0.95),
}


LAST_TARGET_ID = 10  # ids 1..10 are target, 11..60 pretraining (docs/robocasa.md, section 6)


@dataclass(frozen=True)
class Style:
    """The surfaces and parts of a kitchen.

    Attributes:
        style_id: file number.
        name: in a few words.
        surfaces: by role (`cabinet`, `counter`, `floor`, ...).
        panel, upper_panel: designs of fronts, keys of `fixtures.fronts.PANELS`; of wall cabinets apart.
        handle: one of `fixtures.fronts.HANDLES`.
        hood, stool: one of `fixtures.hoods.DESIGNS` and of `fixtures.stools.DESIGNS`.
        appliances: models of the catalogue that it names, by appliance kind; of others one is drawn by its number.
    """

    style_id: int
    name: str
    surfaces: dict[str, Surface]
    panel: str
    upper_panel: str
    handle: str
    hood: str
    stool: str
    appliances: dict[str, str]

    def surface(self, role: str) -> Surface:
        """Surface of a role.

        Raises:
            UnknownNameError: the style file has no such role.
        """
        if role not in self.surfaces:
            raise UnknownNameError(f"surface role of style {self.style_id}", role, self.surfaces)
        return self.surfaces[role]

    @property
    def split(self) -> str:
        """Split that it belongs to."""
        return split_of(self.style_id)


def split_of(number: int) -> str:
    """Split of a layout or style id: 1..10 target, above that pretraining."""
    return "target" if number <= LAST_TARGET_ID else "pretrain"


def _surface(record: dict[str, Any]) -> Surface:
    return Surface(
        rgba=tuple(record.get("rgba", (1.0, 1.0, 1.0, 1.0))),
        texture=_texture(record["texture"]) if "texture" in record else None,
        shininess=record.get("shininess", 0.2),
        reflectance=record.get("reflectance", 0.0),
        emission=record.get("emission", 0.0),
    )


def _texture(record: dict[str, Any]) -> TextureRecord:
    colours = {key: tuple(record[key]) for key in ("rgb", "rgb2")}
    return TextureRecord(**{**record, **colours})


def style_ids() -> tuple[int, ...]:
    """Ids of the styles that exist as files, ascending."""
    folder = resources.files(__package__) / "styles"
    return tuple(sorted(int(f.name[6:9]) for f in folder.iterdir() if f.name.startswith("style_")))


_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@functools.cache
def load_style(style_id: int) -> Style:
    """Read a style file.

    Raises:
        UnknownNameError: there is no style of that id.
    """
    if style_id not in style_ids():
        raise UnknownNameError("style", str(style_id), map(str, style_ids()))
    file = resources.files(__package__) / "styles" / f"style_{style_id:03d}.yaml"
    record = yaml.load(file.read_text(), Loader=_LOADER)
    surfaces = {role: _surface(entry) for role, entry in record["surfaces"].items()}
    for role, otherwise in (("upper", "cabinet"), ("island", "cabinet"), ("counter_island", "counter")):
        surfaces.setdefault(role, surfaces[otherwise])
    panel = record["panel"]
    return Style(
        style_id,
        record["name"],
        {**COMMON_SURFACES, **surfaces},
        panel,
        record.get("upper_panel", panel),
        record["handle"],
        record["hood"],
        record["stool"],
        record.get("appliances", {}),
    )


class MaterialPalette:
    """Adds a style's materials to an MjSpec, each once, when a geom first asks for it; without textures on request.

    `added` are names of materials that the spec has already.
    """

    def __init__(
        self, spec: mujoco.MjSpec, style: Style, *, textures: bool = True, added: frozenset[str] = frozenset()
    ) -> None:
        self._spec, self.style, self._textures = spec, style, textures
        self._added = set(added)

    @property
    def added(self) -> frozenset[str]:
        """Names of the materials that the spec has by now."""
        return frozenset(self._added)

    def __call__(self, role: str) -> str:
        """Name of the material of a surface role, e.g. `cabinet`."""
        return self.add(f"material_{role}", self.style.surface(role))

    def shade(self, role: str, strength: float = 0.72) -> str:
        """Name of a darker variant of a role's material: the shade in a joint or below an edge."""
        surface = self.style.surface(role)
        r, g, b, a = surface.rgba
        dark = (r * strength, g * strength, b * strength, a)
        return self.add(f"material_{role}_shade_{round(100 * strength)}", replace(surface, rgba=dark, shininess=0.0))

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
        if surface.texture is not None and self._textures:
            record = surface.texture
            if record.file not in self._spec.assets:
                texture = self._spec.add_texture(name=record.file, type=mujoco.mjtTexture.mjTEXTURE_2D)
                texture.file = record.file
                self._spec.assets[record.file] = texture_png(record)
            material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = record.file
            if record.scale_m == 0:
                return name
            material.texuniform = True
            # MuJoCo maps texture coordinates over half lengths: one repetition covers 2 / texrepeat metres.
            material.texrepeat = [2.0 / record.scale_m, 2.0 / record.scale_m]
        return name
