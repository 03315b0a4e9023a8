"""Fridges: French door, side by side, bottom freezer; with shelves, crisper drawers and bins in the doors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import mujoco
import numpy as np

from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, Standing
from robocasa_lerobot.envs.kitchens.appliances.parts import Parts
from robocasa_lerobot.envs.kitchens.fixtures.base import Region
from robocasa_lerobot.envs.kitchens.fixtures.regions import USABLE_SHELF
from robocasa_lerobot.envs.kitchens.fixtures.swept import TALL_STANDOFF_M

DOOR_M, _FOOT_M = 0.060, 0.035
_WALL_M, _BACK_M = 0.035, 0.06
_CRISPER_M = 0.19  # height of a crisper drawer
_SHELF_M = 0.010
# Drawers in a freezer: their height; what a door that is nearly open takes of the compartment at its hinge, and a gap
# at the other side.
_FREEZER_DRAWER_M, _DOOR_SIDE_M, _OTHER_SIDE_M = 0.17, 0.036, 0.008
# Of the crisper drawers above the floor of a fridge that reaches down to its feet: the arm, whose shoulder is a metre
# high, does not reach farther down than 0.4 m. Below them is an open room for bottles.
_BOTTLES_M = 0.42

Box = tuple[np.ndarray, np.ndarray]  # low and high corner


@dataclass
class Fridge(Appliance):
    """Doors are named `fridge_...` and `freezer_...`, drawers `fridge_drawer<i>` and `freezer_drawer`."""

    standing: ClassVar[Standing] = Standing("floor", back_m=0.03, name="fridge")
    stand_offset_m: ClassVar[float] = TALL_STANDOFF_M

    @property
    def doors(self) -> tuple[str, ...]:
        """Doors; the freezer's drawer of a French door fridge is none."""
        return tuple(self._doors())

    @property
    def compartments(self) -> tuple[str, ...]:
        """`fridge`, and `freezer` where that has a door; that of a French door fridge is a drawer."""
        return tuple(dict.fromkeys(door.split("_")[0] for door in self.doors))

    @property
    def drawers(self) -> tuple[str, ...]:
        """Crisper drawers, all in one row, low in the fridge; left to right."""
        return tuple(f"fridge_drawer{i}" for i in range(self.record["drawers"]))

    def parts_to_choose(self, name: str) -> dict[str, dict[str, str]]:
        """Its crisper drawers, which need no words."""
        return {drawer: {} for drawer in self.drawers}

    @property
    def freezer_drawers(self) -> tuple[str, ...]:
        """Drawers on shelves of the freezer, from below; most fridges have none."""
        return ()

    @property
    def sliding(self) -> tuple[str, ...]:
        """Every drawer."""
        behind_front = ("freezer_drawer",) if self.record.kind == "fridge_french_door" else ()
        return (*self.drawers, *self.freezer_drawers, *behind_front)

    @property
    def regions(self) -> dict[str, Region]:
        """`fridge_shelf<i>` and `freezer_shelf<i>` from below, then drawers and the whole compartments."""
        found: dict[str, Region] = {}
        for part in ("fridge", "freezer"):
            (low, high), levels = self._room(part), self._levels(part)
            tops = [*[level - _SHELF_M for level in levels[1:]], float(high[2])]
            for index, (bottom, top) in enumerate(zip(levels, tops, strict=True)):
                if part == "freezer" and ("freezer_drawer" in self.sliding or index in self._drawer_levels()):
                    continue
                found[f"{part}_shelf{index}"] = Region.between(
                    self.name, (low[0] + 0.01, low[1] + 0.03, bottom), (high[0] - 0.01, high[1] - 0.01, top - 0.005)
                )
        for part in self.sliding:
            _, size = self._drawer(part)
            half = (size[0] / 2 - 0.016, size[1] / 2 - 0.02, size[2] * 0.42)
            found[part] = Region(f"{self.name}_{part}", (0.0, 0.0, -size[2] / 2 + 0.012 + half[2]), half)
        for part in ("fridge", "freezer"):
            found[part] = Region.between(self.name, *self._room(part))
        return found

    def usable_shelves(self, compartment: str) -> tuple[str, ...]:
        """Names of the regions over the shelves of "fridge" or "freezer" that goals may name, from below.

        A higher shelf is out of the arm's reach, a lower one too, and nothing stands in a lower room.
        """
        lowest, highest, room = USABLE_SHELF
        found = []
        for name, region in self.regions.items():
            bottom = self.pos[2] + region.center[2] - region.half[2]
            fits = lowest <= bottom <= highest and 2 * region.half[2] >= room - 1e-9
            if name.startswith(f"{compartment}_shelf") and fits:
                found.append(name)
        return tuple(found)

    def state(self, data: mujoco.MjData) -> dict[str, float | bool]:
        """Shares of the ranges of doors and drawers."""
        return {part: self.share(data, part) for part in (*self.doors, *self.sliding)}

    # Regions and shelves --------------------------------------------------------------------------------------

    def _split(self) -> float:
        """Height, or for side by side the x, between freezer and fridge, in the fixture's frame."""
        share = float(self.record["freezer"])
        if self.record.kind == "fridge_side_by_side":
            return -self.width / 2 + share * self.width
        return -self.height / 2 + _FOOT_M + share * (self.height - _FOOT_M)

    def _room(self, part: str) -> Box:
        """Inside of a compartment."""
        width, depth, height = self.size
        low = np.array([-width / 2 + _WALL_M, -depth / 2 + DOOR_M, -height / 2 + _FOOT_M + _WALL_M])
        high = np.array([width / 2 - _WALL_M, depth / 2 - _BACK_M, height / 2 - _WALL_M])
        axis = 0 if self.record.kind == "fridge_side_by_side" else 2
        if part == "fridge":
            low[axis] = self._split() + _WALL_M / 2
        else:
            high[axis] = self._split() - _WALL_M / 2
        return low, high

    def _levels(self, part: str) -> list[float]:
        """Surfaces that objects stand on in a compartment, from below."""
        low, high = self._room(part)
        if part == "freezer":
            if self.record.kind != "fridge_side_by_side":
                middle = float(low[2] + high[2]) / 2
                return [float(low[2]), middle]
            return [float(z) for z in np.linspace(low[2], high[2], self.record["shelves"] + 1)[:-1]]
        first = self._crisper_floor() + _CRISPER_M + 0.02
        count = int(self.record["shelves"])
        # Rooms of the height that counts as usable at least.
        count = min(count, int((high[2] - first) / (USABLE_SHELF[2] + _SHELF_M + 0.012)))
        return [float(z) for z in np.linspace(first, high[2], count + 1)[:-1]]

    def _drawer_levels(self) -> tuple[int, ...]:
        """Numbers of the freezer's levels that drawers stand on, from below."""
        return ()

    def _crisper_floor(self) -> float:
        """Height of what the crisper drawers slide on, in the fixture's frame."""
        low, _ = self._room("fridge")
        return float(low[2]) + (_BOTTLES_M if self.record.kind == "fridge_side_by_side" else 0.0)

    def _drawer(self, part: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and size of a drawer when in."""
        if part == "freezer_drawer":
            low, high = self._room("freezer")
            size = high - low - np.array([0.03, 0.05, 0.10])
            return (low + high) / 2 + np.array([0.0, -0.02, -0.04]), size
        if part in self.freezer_drawers:
            low, high = self._room("freezer")
            low, high = low + np.array([_DOOR_SIDE_M, 0.0, 0.0]), high - np.array([_OTHER_SIDE_M, 0.0, 0.0])
            size = np.array([high[0] - low[0], (high[1] - low[1]) * 0.86, _FREEZER_DRAWER_M])
            level = self._levels("freezer")[self._drawer_levels()[int(part[-1])]]
            return np.array([(low[0] + high[0]) / 2, low[1] + 0.055 + size[1] / 2, level + 0.004 + size[2] / 2]), size
        low, high = self._room("fridge")
        count = len(self.drawers)
        pitch = (high[0] - low[0]) / count
        index = int(part[-1])
        size = np.array([pitch - 0.012, (high[1] - low[1]) * 0.86, _CRISPER_M - 0.012])
        centre = np.array(
            [
                low[0] + (index + 0.5) * pitch,
                low[1] + 0.055 + size[1] / 2,
                self._crisper_floor() + _CRISPER_M / 2 - 0.002,
            ]
        )
        return centre, size

    def _doors(self) -> dict[str, tuple[float, float, float, float, int]]:
        """By door x0, x1, z0, z1 and the side of the hinge (-1 left)."""
        half, bottom, top, split = self.width / 2, -self.height / 2 + _FOOT_M, self.height / 2, self._split()
        gap = 0.003
        if self.record.kind == "fridge_french_door":
            return {
                "fridge_left_door": (-half, -gap, split + gap, top, -1),
                "fridge_right_door": (gap, half, split + gap, top, 1),
            }
        if self.record.kind == "fridge_side_by_side":
            return {
                "freezer_door": (-half, split - gap, bottom, top, -1),
                "fridge_door": (split + gap, half, bottom, top, 1),
            }
        return {
            "fridge_door": (-half, half, split + gap, top, 1),
            "freezer_door": (-half, half, bottom, split - gap, 1),
        }

    # Geometry -------------------------------------------------------------------------------------------------

    def assemble(self, parts: Parts, root: mujoco.MjsBody) -> None:
        """Add the case, shelves, drawers and doors."""
        width, depth, height = self.size
        side = {"steel": "graphite", "warm_steel": "graphite", "black_steel": "black"}.get(
            self.record["finish"], self.record["finish"]
        )
        front = -depth / 2 + DOOR_M
        foot = ((-width / 2 + 0.02, front, -height / 2), (width / 2 - 0.02, depth / 2 - 0.02, -height / 2 + _FOOT_M))
        parts.span(root, *foot, "black")
        low, high = (-width / 2, front, -height / 2 + _FOOT_M), (width / 2, depth / 2, height / 2)
        walls = dict.fromkeys(("left", "right", "bottom", "top", "front"), _WALL_M) | {"back": _BACK_M}
        parts.shell(root, low, high, walls, side, "lining")
        inner_low, inner_high = self._room("freezer")[0], self._room("fridge")[1]
        split, half_wall = self._split(), _WALL_M / 2
        if self.record.kind == "fridge_side_by_side":
            wall = ((split - half_wall, front, inner_low[2]), (split + half_wall, inner_high[1], inner_high[2]))
        else:
            wall = ((inner_low[0], front, split - half_wall), (inner_high[0], inner_high[1], split + half_wall))
        parts.span(root, *wall, "lining")
        for part in ("fridge", "freezer"):
            if part == "freezer" and "freezer_drawer" in self.sliding:
                continue
            room_low, room_high = self._room(part)
            boards = self._levels(part)[0 if part == "fridge" else 1 :]
            if part == "fridge" and self._crisper_floor() > room_low[2]:
                boards = [self._crisper_floor() - 0.004, *boards]
            for level in boards:
                shelf = ((room_low[0], room_low[1] + 0.03, level - _SHELF_M), (room_high[0], room_high[1], level))
                parts.span(root, *shelf, "shelf_glass")
                lip = ((room_low[0], room_low[1] + 0.025, level - 0.014), (room_high[0], room_low[1] + 0.033, level))
                parts.span(root, *lip, "silver", collide=False)
        for part in (*self.drawers, *self.freezer_drawers):
            self._add_crisper(parts, root, part)
        if "freezer_drawer" in self.sliding:
            self._add_freezer_drawer(parts, root)
        for name, where in self._doors().items():
            self._add_door(parts, root, name, where)

    def _slide(self, parts: Parts, root: mujoco.MjsBody, part: str, mass: float, friction: float) -> mujoco.MjsBody:
        centre, size = self._drawer(part)
        return parts.slide(
            root,
            part,
            centre,
            (0, -1, 0),
            (0.0, 0.75 * float(size[1])),
            mass=mass,
            size=size,
            friction=friction,
            damping=6.0,
            armature=0.05,
        )

    def _add_crisper(self, parts: Parts, root: mujoco.MjsBody, part: str) -> None:
        _, size = self._drawer(part)
        half = size / 2
        body = self._slide(parts, root, part, 0.8, 1.0)
        parts.shell(body, -half, half * np.array([1, 1, 0.86]), 0.007, "crisper", open_side="top")
        # A ledge along the upper edge of its front, to pull by.
        parts.box(body, (0, -half[1] - 0.018, half[2] * 0.62), (size[0] * 0.9, 0.036, 0.012), "white")
        parts.box(body, (0, -half[1] - 0.033, half[2] * 0.62 - 0.013), (size[0] * 0.9, 0.008, 0.026), "white")

    def _add_freezer_drawer(self, parts: Parts, root: mujoco.MjsBody) -> None:
        centre, size = self._drawer("freezer_drawer")
        half = size / 2
        body = self._slide(parts, root, "freezer_drawer", 3.0, 2.0)
        parts.shell(body, -half, half * np.array([1, 1, 0.7]), 0.010, "lining", open_side="top")
        x, y = self.width / 2, -self.depth / 2 - centre[1]
        low_z, high_z = -self.height / 2 + _FOOT_M - centre[2], self._split() - 0.003 - centre[2]
        spans = [(low_z, high_z)]
        if self.record["family"] == "four_door":
            # Its front looks like two drawers.
            spans = [(low_z, (low_z + high_z) / 2 - 0.003), ((low_z + high_z) / 2 + 0.003, high_z)]
        for bottom, top in spans:
            parts.span(body, (-x + 0.002, y, bottom), (x - 0.002, y + DOOR_M - 0.004, top), self.record["finish"])
            parts.span(
                body, (-x + 0.01, y + DOOR_M - 0.004, bottom), (x - 0.01, y + DOOR_M - 0.001, top), "lining",
                collide=False,
            )  # fmt: skip
        parts.handle(
            body, (0, y, high_z - 0.06), self.width * 0.72, self._metal(), axis="x", name="freezer_drawer_handle",
            style=self.record["handle"],
        )  # fmt: skip

    def _metal(self) -> str:
        return "chrome" if self.record["family"] == "retro" else "steel_plain"

    def _add_door(
        self, parts: Parts, root: mujoco.MjsBody, name: str, where: tuple[float, float, float, float, int]
    ) -> None:
        x0, x1, z0, z1, hinge = where
        width, height = x1 - x0, z1 - z0
        pivot = x0 if hinge < 0 else x1
        limits = (-np.pi / 2, 0.0) if hinge < 0 else (0.0, np.pi / 2)
        middle = -hinge * width / 2
        door = parts.hinge(
            root,
            name,
            (pivot, -self.depth / 2 + DOOR_M, (z0 + z1) / 2),
            (0, 0, 1),
            limits,
            mass=8.0,
            size=(width, DOOR_M, height),
            center=(middle, -DOOR_M / 2, 0),
            friction=1.0,
            damping=2.5,
            armature=0.05,
        )
        finish = self.record["finish"]
        if self.record["family"] == "retro":
            # Its front is bowed: a wide block with round edges.
            parts.block(door, (middle, -DOOR_M / 2, 0), (width - 0.002, DOOR_M - 0.004, height - 0.002), 0.028, finish)
        else:
            parts.box(door, (middle, -DOOR_M / 2 - 0.001, 0), (width - 0.002, DOOR_M - 0.006, height - 0.002), finish)
        parts.box(door, (middle, -0.003, 0), (width - 0.03, 0.005, height - 0.02), "lining", collide=False)
        low, high = self._room("freezer" if name.startswith("freezer") else "fridge")
        drawers = [self._drawer(drawer) for drawer in self.freezer_drawers if name.startswith("freezer")]
        taken = [(at[2] - size[2] / 2 - (z0 + z1) / 2, at[2] + size[2] / 2 - (z0 + z1) / 2) for at, size in drawers]
        self._add_bins(parts, door, middle, min(width, float(high[0] - low[0])) - 0.10, height, taken)
        metal = self._metal()
        length = min(0.55, height * 0.62)
        # Near the free edge, and near the robot's reach: low on an upper door, high on a lower one.
        z = 0.0
        if self.record.kind == "fridge_bottom_freezer":
            z = (height / 2 - length / 2 - 0.06) * (1 if name == "freezer_door" else -1)
        elif self.record.kind == "fridge_french_door":
            z = -height * 0.10
        grip = -hinge * (width - 0.05)
        parts.handle(
            door, (grip, -DOOR_M + 0.002, z), length, metal, axis="z", name=f"{name}_handle",
            style=self.record["handle"],
        )  # fmt: skip
        if self.record["dispenser"] and (name in ("fridge_left_door", "freezer_door")):
            spot = (middle - hinge * 0.02, -DOOR_M, height * 0.10)
            parts.box(door, spot, (0.20, 0.006, 0.34), "black", collide=False)
            parts.box(door, (spot[0], spot[1] - 0.002, spot[2] - 0.05), (0.15, 0.006, 0.20), "iron", collide=False)
            parts.box(door, (spot[0], spot[1] - 0.004, spot[2] + 0.11), (0.13, 0.004, 0.05), "screen", collide=False)
            parts.box(door, (spot[0], spot[1] - 0.012, spot[2] - 0.145), (0.15, 0.02, 0.01), "silver", collide=False)

    def _add_bins(
        self,
        parts: Parts,
        door: mujoco.MjsBody,
        middle: float,
        width: float,
        height: float,
        taken: Sequence[tuple[float, float]],
    ) -> None:
        """Shelves on the inside of the door, in front of the ones in the case when it is shut; none before drawers.

        Heights `taken` by drawers are from the door's middle, metres.
        """
        count = 3 if height > 0.9 else (2 if height > 0.55 else 1)
        deep = 0.055
        for share in np.linspace(-0.36, 0.22, count) if count > 1 else (-0.30,):
            z = float(share) * height
            if any(low - 0.08 < z < high + 0.02 for low, high in taken):
                continue
            parts.box(door, (middle, deep / 2, z), (width, deep, 0.008), "lining")
            parts.box(door, (middle, deep - 0.004, z + 0.035), (width, 0.008, 0.07), "crisper")

    looks: ClassVar = {"closed": {}, "open": {}}


@dataclass
class FrenchDoorFridge(Fridge):
    """Two doors above a freezer drawer."""

    looks: ClassVar = {
        "closed": {},
        "open": {"fridge_left_door": 1.0, "fridge_right_door": 1.0, "freezer_drawer": 0.6, "fridge_drawer0": 0.4},
    }


@dataclass
class BottomFreezerFridge(Fridge):
    """The fridge above, the freezer below, both with a door."""

    looks: ClassVar = {"closed": {}, "open": {"fridge_door": 1.0, "freezer_door": 0.7, "fridge_drawer0": 0.5}}
