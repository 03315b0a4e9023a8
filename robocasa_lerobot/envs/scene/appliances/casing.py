"""A plain closed casing, for categories that have no class of their own."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from robocasa_lerobot.envs.scene.appliances.base import Appliance
from robocasa_lerobot.envs.scene.appliances.parts import Parts


@dataclass
class Casing(Appliance):
    """A rounded block of the model's size and finish."""

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add the block."""
        parts.block(root, (0, 0, 0), self.size, 0.02, self.record["finish"])
