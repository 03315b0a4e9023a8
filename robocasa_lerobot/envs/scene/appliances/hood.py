"""Extractor hoods: a canopy and a chimney; nothing on them moves."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.envs.scene.appliances import meshes
from robocasa_lerobot.envs.scene.appliances.shapes import Shapes
from robocasa_lerobot.envs.scene.fixtures.base import Fixture, add_box
from robocasa_lerobot.envs.scene.materials import MaterialPalette


@dataclass
class Hood(Fixture):
    """In the style's appliance finish.

    Attributes:
        design: "box", "pyramid" or "slim".
    """

    design: str = "box"

    def build(self, spec: mujoco.MjSpec, palette: MaterialPalette) -> None:
        """Add canopy, chimney and filter."""
        width, depth, height = self.size
        root = self.root_body(spec)
        steel = palette("appliance")
        canopy = {"box": 0.10, "pyramid": 0.06, "slim": 0.05}[self.design]
        low = -height / 2
        add_box(root, (0, 0, low + canopy / 2), (width, depth, canopy), steel, name=f"{self.name}_canopy")
        chimney = (width * 0.42, 0.30)
        if self.design == "pyramid":
            rise = 0.28 * height
            y = depth / 2 - chimney[1] / 2
            rings = [
                meshes.rounded_rectangle(width, depth, low + canopy, 0.001, 1),
                meshes.rounded_rectangle(*chimney, low + canopy + rise, 0.001, 1) + np.array([0, y, 0]),
            ]
            geom = Shapes(spec, palette, self.name, "pretrain").mesh(root, meshes.loft(rings), (0, 0, 0), "silver")
            geom.material = steel
        size = (*chimney, height - canopy)
        add_box(root, (0, depth / 2 - chimney[1] / 2, canopy / 2), size, steel)
        add_box(root, (0, 0, low - 0.001), (width * 0.8, depth * 0.7, 0.004), palette("appliance_dark"), collide=False)
        for side in (-1, 1):
            spot = (side * width * 0.12, -depth / 2 - 0.002, low + canopy / 2)
            add_box(root, spot, (0.02, 0.004, 0.012), palette("appliance_dark"), collide=False)
