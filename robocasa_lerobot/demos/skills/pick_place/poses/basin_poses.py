"""Where a vessel may be put down in a basin: on its floor with room on all sides, or there below the spout."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, base_pose, floor_axes
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.place_poses import PlacePoses
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.base import Region
from robocasa_lerobot.envs.predicates.objects import middle_of

LARGE_M = 0.17  # a vessel longer than this is not dropped into a basin, where it might lean on a wall
# Of where its origin may come: shares of the basin's half sizes; heights over the floor, metres, with costs.
ACROSS, DEEP = (-0.5, -0.25, 0.0, 0.25, 0.5), (-0.6, -0.35, -0.15, 0.0, 0.2)
DROPS_M, DROP_COST = (0.0, 0.03, 0.07), 2.0
# Below the spout: of the vessel's middle before its tip, and to a side, metres; a cost for each of them.
BEFORE_M, ASIDE_M, OFF_COST = (0.0, 0.02, 0.04, 0.06), (0.0, -0.03, 0.03), 2.0
SPARE_M, OUT_COST = 0.008, 15.0  # to the basin's walls, and what each metre less costs


def is_large(obj: Graspable) -> bool:
    """Whether an object is a vessel that a basin has room for only if it is put down well."""
    return obj.item is not None and obj.item.interior is not None and max(obj.item.size[:2]) > LARGE_M


def on_floor(env: KitchenEnv, basin: Region) -> PlacePoses:
    """All over the floor of a basin, or of a rack: which of these have room for an object is asked by `room_in`."""

    def poses() -> list[PlacePose]:
        wide, deep, tall = basin.half
        return [
            PlacePose(basin.world(env.data, (x * wide, y * deep, -tall)) + drop * UP, DROP_COST * drop)
            for x, y, drop in itertools.product(ACROSS, DEEP, DROPS_M)
        ]

    return poses


def below_spout(env: KitchenEnv, obj: Graspable, sink: Sink) -> PlacePoses:
    """On the floor of the basin, so that the stream falls into a vessel, or rather behind its middle."""

    def poses() -> list[PlacePose]:
        data, basin = env.data, sink.basin
        tip = data.site(f"{sink.name}_water").xpos
        floor = float(basin.world(data, (0.0, 0.0, -basin.half[2]))[2])
        ahead, left = floor_axes(base_pose(data)[1])
        off = (middle_of(env.scene, data, obj.name) - data.body(obj.name).xpos) * [1.0, 1.0, 0.0]
        found = []
        for before, aside, drop in itertools.product(BEFORE_M, ASIDE_M, DROPS_M):
            point = np.array([*tip[:2], floor + drop]) - before * ahead + aside * left - off
            found.append(PlacePose(point, OFF_COST * abs(aside) + DROP_COST * drop))
        return found

    return poses


def room_in(
    env: KitchenEnv, obj: Graspable, basin: Region, *, out_cost: float = OUT_COST, flat_cost: float = 0.0
) -> Callable[[Array, Array], float]:
    """The cost of an object that would meet the walls of a basin, by its origin (3,) and rotation (3, 3).

    With `flat_cost` also of what it is higher than it need be, for each metre: it would come to lean on something.
    """
    body = env.data.body(basin.body)
    axes = body.xmat.reshape(3, 3).copy()
    center = basin.world(env.data)
    half = np.asarray(basin.half[:2]) - SPARE_M
    lowest = float(np.ptp(obj.cloud, axis=0).min())

    def cost(origin: Array, turn: Array) -> float:
        points = (obj.cloud @ turn.T + origin - center) @ axes
        out = np.maximum(np.abs(points[:, :2]).max(axis=0) - half, 0.0)
        return out_cost * float(out.sum()) + flat_cost * (float(np.ptp(points[:, 2])) - lowest)

    return cost
