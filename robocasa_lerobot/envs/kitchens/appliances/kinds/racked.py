"""What ovens, toaster ovens and dishwashers share: a cavity behind a door that folds down, racks that slide out."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region, Vector


@dataclass
class Racked(Appliance):
    """Door `door`; racks `rack0`, and above it `rack1`.

    Attributes:
        rack_gap_m: between the room above a rack and the part over it, metres.
        rack_edge_m: between that room and the walls to the sides, and those at front and back, metres.
    """

    rack_gap_m: ClassVar[float] = 0.01
    rack_edge_m: ClassVar[tuple[float, float]] = (0.02, 0.02)

    @abstractmethod
    def cavity(self) -> tuple[np.ndarray, np.ndarray]:
        """Opposite corners of its inside in its frame, metres, each (3,)."""

    @abstractmethod
    def rack_levels(self) -> tuple[float, ...]:
        """Height of each rack from below, as a share of the cavity's."""

    @property
    def doors(self) -> tuple[str, ...]:
        """The door."""
        return ("door",)

    @property
    def racks(self) -> tuple[str, ...]:
        """Racks from below."""
        return tuple(f"rack{i}" for i in range(len(self.rack_levels())))

    @property
    def regions(self) -> dict[str, Region]:
        """Above each rack, moving with it, then the whole cavity."""
        low, high = self.cavity()
        half, (side, end) = (high - low) / 2, self.rack_edge_m
        heights = [*self.rack_heights(), high[2]]
        found = {}
        for index, rack in enumerate(self.racks):
            room = (heights[index + 1] - heights[index] - self.rack_gap_m) / 2
            found[rack] = Region(f"{self.name}_{rack}", (0, 0, room), (half[0] - side, half[1] - end, room))
        found["interior"] = Region.between(self.name, low, high)
        return found

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of the ranges of door and racks."""
        return {part: self.share(data, part) for part in (*self.doors, *self.racks)}

    def rack_heights(self) -> list[float]:
        """Top of each rack from below in its frame, metres."""
        low, high = self.cavity()
        return [float(low[2] + share * (high[2] - low[2])) for share in self.rack_levels()]

    def add_rack(
        self,
        parts: Parts,
        root: mujoco.MjsBody,
        rack: str,
        size: Vector,
        *,
        mass: float,
        reach: float,
        bars: int,
        height: float = 0.02,
        back: float = 0.0,
        rim: float = 0.0,
        friction: float = 1.5,
        damping: float = 8.0,
    ) -> mujoco.MjsBody:
        """A wire rack in the middle of the cavity, which slides out by `reach` of its depth.

        `size` is width, depth and thickness, `height` that of its inertia, `back` how far it lies before the middle,
        `rim` the height of its fence; metres.
        """
        low, high = self.cavity()
        level = self.rack_heights()[self.racks.index(rack)]
        body = parts.slide(
            root,
            rack,
            ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2 - back, level),
            (0, -1, 0),
            (0.0, reach * float(size[1])),
            mass=mass,
            size=(size[0], size[1], height),
            friction=friction,
            damping=damping,
        )
        parts.wire_rack(body, size, "wire", bars=bars, rim=rim, name=rack)
        return body


def rack_words(count: int) -> tuple[str, ...]:
    """Words for racks from below; a single one needs none."""
    return ("",) if count == 1 else ("bottom", "top") if count == 2 else ("bottom", "middle", "top")


def fold_door(
    parts: Parts,
    root: mujoco.MjsBody,
    pos: Vector,
    size: Vector,
    *,
    mass: float,
    weight_at: tuple[float, float],
    friction: float,
    damping: float,
    limit: float = np.pi / 2,
    armature: float = 0.05,
) -> mujoco.MjsBody:
    """A door on a hinge at its lower edge, joint `door_joint`, without geoms; friction holds it where it is left.

    Args:
        parts: of the appliance.
        root: body that it hangs on.
        pos: middle of its lower edge, metres.
        size: width, thickness and height, metres.
        mass: kilograms.
        weight_at: where it weighs, metres behind its hinge and share of its height: so that it stays shut.
        friction: of its joint, Nm.
        damping: of its joint, Nms/rad.
        armature: of its joint, kg m2.
        limit: how far it folds down, radians.
    """
    inwards, share = weight_at
    return parts.hinge(
        root,
        "door",
        pos,
        (1, 0, 0),
        (0.0, limit),
        mass=mass,
        size=size,
        center=(0, inwards, size[2] * share),
        friction=friction,
        damping=damping,
        armature=armature,
    )
