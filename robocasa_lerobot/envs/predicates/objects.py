"""Conditions on objects: inside, on, touching, upright. Lengths in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.kinds.racked import Racked
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.base import Region
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter
from robocasa_lerobot.envs.predicates.contacts import touching
from robocasa_lerobot.envs.predicates.logic import Term, plain

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

# The bounding box may stand out of a region by this much: RoboCasa's slack is 0.05 over the region's extent in metres
# (docs/robocasa.md, section 8), more than this; what lies tilted on a shelf has corners below it.
INSIDE_MARGIN_M = 0.05
RECEPTACLE_SHARE = 0.7  # of the receptacle's horizontal radius (docs/robocasa.md, section 8)
UPRIGHT_RAD = np.deg2rad(15.0)


@dataclass(frozen=True)
class ObjectInBasin(Term):
    """An object's centre is inside a basin of a sink: either one, where it has two."""

    object: str
    fixture: str

    @property
    def name(self) -> str:
        """E.g. `obj_in_sink`."""
        return f"{plain(self.object)}_in_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Test the body's origin against the basins' regions."""
        origin = data.body(scene.fill(self.object)).xpos
        return any(basin.contains(data, origin) for basin in scene.fixture(self.fixture, Sink).regions.values())


@dataclass(frozen=True)
class OverBasin(Term):
    """An object's centre is over one basin of a sink, at whatever height.

    Attributes:
        object: name.
        fixture: role of the sink.
        basin: its name, "basin0" (the left one, under the spout) or "basin1".
    """

    object: str
    fixture: str
    basin: str

    @property
    def name(self) -> str:
        """E.g. `cup_over_sink_basin0`."""
        return plain(f"{self.object}_over_{self.fixture}_{self.basin}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Test the body's origin against the basin's region, on the floor plan."""
        region = scene.fixture(self.fixture, Sink).regions[scene.fill(self.basin)]
        local = region.local(data, data.body(scene.fill(self.object)).xpos)
        return bool(np.all(np.abs(local[:2]) <= np.asarray(region.half)[:2]))


@dataclass(frozen=True)
class ObjectInside(Term):
    """All corners of an object's bounding box are in one of a fixture's regions, or nearly, its origin altogether.

    Attributes:
        object: name.
        fixture: role.
        region: start of the region's name, or a shelf by its level, as "fridge_shelf:highest"; all of the fixture's
            regions if empty. May name a choice in braces.
        margin: by which corners may stand out.
        lower: share of the region's height, from its floor, that the object's origin must be in.
        height: bounds of the height of the region's floor in the room, and its least height.
    """

    object: str
    fixture: str
    region: str = ""
    margin: float = INSIDE_MARGIN_M
    lower: float = 1.0
    height: tuple[float, float, float] = (-np.inf, np.inf, 0.0)

    @property
    def name(self) -> str:
        """E.g. `obj_inside_cabinet`."""
        return f"{plain(self.object)}_inside_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Test the origin against each region, then the corners."""
        name = scene.fill(self.object)
        origin = data.body(name).xpos
        around = [
            region
            for region in scene.regions(self.fixture, self.region)
            if self._has(data, region, origin) and self._usable(data, region)
        ]
        if not around:
            return False
        corners = object_corners(scene, data, name)
        return any(region.encloses(data, corners, self.margin) for region in around)

    def _usable(self, data: mujoco.MjData, region: Region) -> bool:
        low, high, least = self.height
        floor = float(region.world(data, (0.0, 0.0, -region.half[2]))[2])
        return low <= floor <= high and 2 * region.half[2] >= least

    def _has(self, data: mujoco.MjData, region: Region, origin: NDArray[np.float64]) -> bool:
        middle = region.local(data, origin)
        in_box = np.abs(middle) <= region.half
        inside = in_box[2] and (in_box[:2].all() or np.linalg.norm(middle[:2]) <= region.across)
        return bool(inside) and float(middle[2]) <= (2 * self.lower - 1) * region.half[2]


@dataclass(frozen=True)
class ObjectTouches(Term):
    """An object touches a fixture, or one part of it, or another object.

    Attributes:
        object: name.
        what: role of a fixture, or name of an object.
        part: of the fixture; may name a choice in braces.
    """

    object: str
    what: str
    part: str = ""

    @property
    def name(self) -> str:
        """E.g. `obj_touches_counter`."""
        return f"{plain(self.object)}_touches_{self.what}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look at the contacts."""
        body = self.what if self.what in scene.objects else scene.fixture(self.what).name
        part = scene.fill(self.part)
        what = scene.subtree(f"{body}_{part}" if part else body)
        return touching(scene.model, data, scene.subtree(scene.fill(self.object)), what)


@dataclass(frozen=True)
class ObjectOnRack(Term):
    """An object touches a rack of an oven, a toaster oven or a dishwasher, whichever."""

    object: str
    fixture: str

    @property
    def name(self) -> str:
        """E.g. `bagel_on_rack_of_toaster_oven`."""
        return f"{plain(self.object)}_on_rack_of_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look at the contacts with every rack."""
        fixture = scene.fixture(self.fixture, Racked)
        racks = scene.subtree(*(f"{fixture.name}_{rack}" for rack in fixture.racks))
        return touching(scene.model, data, scene.subtree(scene.fill(self.object)), racks)


@dataclass(frozen=True)
class ObjectTouchesAnyCounter(Term):
    """An object touches a counter."""

    object: str

    @property
    def name(self) -> str:
        """E.g. `obj_touches_any_counter`."""
        return f"{plain(self.object)}_touches_any_counter"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look at the contacts with every counter."""
        counters = [name for name, fixture in scene.fixtures.items() if isinstance(fixture, Counter)]
        return touching(scene.model, data, scene.subtree(scene.fill(self.object)), scene.subtree(*counters))


@dataclass(frozen=True)
class ObjectOn(Term):
    """An object lies in or on a receptacle: they touch, and its centre is near the receptacle's middle.

    Attributes:
        object, receptacle: names.
        within: horizontal distance of the centres; None is 0.7 of the receptacle's horizontal radius.
    """

    object: str
    receptacle: str
    within: float | None = None

    @property
    def name(self) -> str:
        """E.g. `obj_on_plate`."""
        return plain(f"{self.object}_on_{self.receptacle}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Look at distance, then contacts."""
        name, receptacle = scene.fill(self.object), scene.fill(self.receptacle)
        apart = data.body(name).xpos[:2] - middle_of(scene, data, receptacle)[:2]
        limit = RECEPTACLE_SHARE * radius(scene, receptacle) if self.within is None else self.within
        return float(np.linalg.norm(apart)) < limit and touching(
            scene.model, data, scene.subtree(name), scene.subtree(receptacle)
        )


@dataclass(frozen=True)
class ObjectAtSite(Term):
    """An object's origin is near a site of a fixture.

    Attributes:
        object: name.
        fixture: role.
        site: of the fixture, without its name.
        across, high: bounds of the horizontal and of the vertical distance.
    """

    object: str
    fixture: str
    site: str
    across: float
    high: float

    @property
    def name(self) -> str:
        """E.g. `obj_under_coffee_machine`."""
        return f"{plain(self.object)}_under_{self.fixture}"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare both distances with the bounds."""
        site = data.site(f"{scene.fixture(self.fixture).name}_{self.site}").xpos
        apart = data.body(scene.fill(self.object)).xpos - site
        return float(np.linalg.norm(apart[:2])) < self.across and abs(float(apart[2])) < self.high


@dataclass(frozen=True)
class ObjectUpright(Term):
    """An object's roll and pitch are below 15 degrees."""

    object: str

    @property
    def name(self) -> str:
        """E.g. `obj_upright`."""
        return f"{plain(self.object)}_upright"

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare both with the bound."""
        down = data.body(scene.fill(self.object)).xmat.reshape(3, 3)[2]
        roll, pitch = np.arctan2(down[1], down[2]), np.arctan2(-down[0], np.hypot(down[1], down[2]))
        return bool(max(abs(roll), abs(pitch)) < UPRIGHT_RAD)


@dataclass(frozen=True)
class ObjectTilt(Term):
    """An object's own z axis is turned from the vertical by an angle within bounds.

    Attributes:
        object: name.
        low, high: bounds, radians, both allowed; pi is upside down.
        label: for the term's name.
    """

    object: str
    low: float = 0.0
    high: float = np.pi
    label: str = "tilted"

    @property
    def name(self) -> str:
        """E.g. `strainer_level`."""
        return plain(f"{self.object}_{self.label}")

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare the angle with the bounds."""
        up = data.body(scene.fill(self.object)).xmat.reshape(3, 3)[2, 2]
        return bool(self.low <= np.arccos(np.clip(up, -1.0, 1.0)) <= self.high)


def radius(scene: Scene, name: str) -> float:
    """Horizontal radius of an object, metres: from the middle of its bounding box to a corner, as seen from above.

    It is RoboCasa's `horizontal_radius`: its site for it lies at a corner of the box (docs/robocasa.md, section 8).
    """
    return scene.objects[name].item.horizontal_radius


def middle_of(scene: Scene, data: mujoco.MjData, name: str) -> NDArray[np.float64]:
    """Middle of an object's interior, else its origin, (3,): a pan's origin is off, towards the handle."""
    body, inside = data.body(name), scene.objects[name].item.interior
    middle: NDArray[np.float64] = body.xpos
    return middle if inside is None else middle + body.xmat.reshape(3, 3) @ np.asarray(inside.center)


def object_corners(scene: Scene, data: mujoco.MjData, name: str) -> NDArray[np.float64]:
    """Corners of an object's bounding box in the world, (8, 3)."""
    half = np.asarray(scene.objects[name].item.size) / 2
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    body = data.body(name)
    corners: NDArray[np.float64] = body.xpos + (signs * half) @ body.xmat.reshape(3, 3).T
    return corners
