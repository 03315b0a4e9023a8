"""Is a kitchen sound: fixtures apart, walkways wide, objects at rest. For tests and the sweep over all kitchens."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.catalogue import kinds_standing
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.footprints import Footprint
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.scene.roles import footprint
from robocasa_lerobot.envs.scene.scene import Scene

PENETRATION_M = 0.002  # that fixtures may have
WALKWAY_M = 1.0  # free before everything that opens
SETTLE_S, MOVED_M = 1.0, 0.01
_PROBE_M = 0.05  # thickness of the slices that walkways are looked through in
_OPENING = ("drawer", "hinge_cabinet", "single_cabinet", "oven", "stovetop")  # besides what stands on the floor
_BELOW_M = 0.9  # what begins above it obstructs no robot


@dataclass(frozen=True)
class Overlap:
    """Two fixtures that reach into each other, by this depth in metres."""

    first: str
    second: str
    depth: float


def overlaps(model: mujoco.MjModel, data: mujoco.MjData, fixtures: dict[str, Fixture]) -> list[Overlap]:
    """Colliding geoms of different fixtures that reach more than 2 mm into each other, the deepest of each pair.

    Before: positions are evaluated.
    """
    owner = _owners(model, fixtures)
    geoms = np.flatnonzero((owner >= 0) & (model.geom_contype != 0))
    centers, halves = _boxes(model, data, geoms)
    names = list(fixtures)
    deepest: dict[tuple[int, int], float] = {}
    for index, geom in enumerate(geoms):
        apart = np.abs(centers[index + 1 :] - centers[index]) - halves[index + 1 :] - halves[index]
        near = geoms[index + 1 :][(apart < -PENETRATION_M).all(axis=1) & (owner[geoms[index + 1 :]] != owner[geom])]
        for other in near:
            distance = mujoco.mj_geomDistance(model, data, int(geom), int(other), 0.001, None)
            if distance < -PENETRATION_M:
                first, second = sorted((int(owner[geom]), int(owner[other])))
                deepest[first, second] = min(deepest.get((first, second), 0.0), float(distance))
    return [Overlap(names[a], names[b], round(-depth, 5)) for (a, b), depth in sorted(deepest.items())]


def _owners(model: mujoco.MjModel, fixtures: dict[str, Fixture]) -> NDArray[np.intp]:
    """Number of the fixture that each geom belongs to, -1 for none."""
    roots = {model.body(name).id: number for number, name in enumerate(fixtures)}
    body_owner = np.full(model.nbody, -1, dtype=np.intp)
    for body in range(1, model.nbody):  # parents come before children
        body_owner[body] = roots.get(body, body_owner[model.body_parentid[body]])
    return np.asarray(body_owner[model.geom_bodyid])


def _boxes(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: NDArray[np.intp]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Middles and half sizes of boxes along the room's axes around geoms, metres."""
    rotations = data.geom_xmat[geoms].reshape(-1, 3, 3)
    centers = data.geom_xpos[geoms] + (rotations @ model.geom_aabb[geoms, :3, None])[:, :, 0]
    halves = (np.abs(rotations) @ model.geom_aabb[geoms, 3:, None])[:, :, 0]
    return centers, halves


def blocked_walkways(layout: Layout) -> list[str]:
    """What opens at the floor and has less than a metre free before it, with the obstacles there."""
    room = layout.room
    standing = [
        f
        for name, f in layout.fixtures.items()
        if f.pos[2] - f.height / 2 < _BELOW_M and layout.types[name] not in ("stool", "floor", "wall")
    ]
    marks = [(f, footprint(f), float(np.hypot(f.width, f.depth)) / 2) for f in standing]
    found = []
    for fixture in layout.of_type(*_OPENING, *kinds_standing("under_counter"), *kinds_standing("floor")):
        if fixture.pos[2] - fixture.height / 2 > _BELOW_M:
            continue
        away = WALKWAY_M / 2 + 0.08  # the first centimetres are handles and the counter's edge
        half = (fixture.width / 2 - 0.03, (WALKWAY_M - 0.16) / 2)
        x, y, _ = fixture.to_world((0.0, -fixture.depth / 2 - away, 0.0))
        free = Footprint(float(x), float(y), fixture.yaw, half)
        corners = free.corners()
        low, high = corners.min(axis=0), corners.max(axis=0)
        if low[0] < room["x_min"] or high[0] > room["x_max"] or low[1] < room["y_min"] or high[1] > 0:
            found.append(f"{fixture.name}: a wall")
        reach = float(np.hypot(*half))
        found += [
            f"{fixture.name}: {other.name}"
            for other, mark, radius in marks
            if other is not fixture and np.hypot(mark.x - x, mark.y - y) < radius + reach and free.overlaps(mark)
        ]
    return found


def moved(scene: Scene, data: mujoco.MjData) -> dict[str, float]:
    """Metres that each object, and the middle of each door, drawer and rack, moved in a second after all had settled.

    `data` is the state at the episode's start; it is stepped.
    """
    model = scene.model
    objects = {name: data.body(name).xpos.copy() for name in scene.objects}
    parts = _moving_parts(model, scene)
    before = data.xipos[parts].copy()
    for _ in range(round(SETTLE_S / model.opt.timestep)):
        mujoco.mj_step(model, data)
    found = {name: float(np.linalg.norm(data.body(name).xpos - start)) for name, start in objects.items()}
    travel = np.linalg.norm(data.xipos[parts] - before, axis=1)
    return found | {model.body(part).name: float(distance) for part, distance in zip(parts, travel, strict=True)}


def _moving_parts(model: mujoco.MjModel, scene: Scene) -> NDArray[np.intp]:
    """Bodies of fixtures that can move and be met; what only shows a state, such as water, cannot be met."""
    own = {model.body(name).id for name in (*scene.objects, scene.robot.names.base)}
    solid = set(model.geom_bodyid[model.geom_contype != 0])
    return np.array(
        [b for b in range(1, model.nbody) if model.body_weldid[b] and b in solid and model.body_rootid[b] not in own],
        dtype=np.intp,
    )
