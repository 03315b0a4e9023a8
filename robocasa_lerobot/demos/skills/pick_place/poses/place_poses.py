"""Where an object may be put down: on or in another one, over a basin, a jug or a burner, in a region, at a site."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array, base_pose
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, contents_of, filled, graspable, half_length
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose
from robocasa_lerobot.demos.skills.pick_place.poses.plate_poses import is_flat, offsets
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.base import Region
from robocasa_lerobot.envs.predicates.objects import RECEPTACLE_SHARE

type PlacePoses = Callable[[], Sequence[PlacePose]]

# Shares of the depth of what it goes into at which an object may be let go, with their costs.
DROPS = ((0.0, 0.0), (0.5, 0.4), (1.1, 0.7))
# The same for what is so narrow, from its middle to its side, that fingers would open against its walls.
OVER_RIM, NARROW_M = ((1.02, 0.0), (1.2, 0.2)), 0.03
# The same for pots, in which fingers that open brace against the walls, and lift the pot as they leave.
POT_DROPS = ((0.0, 1.3), (0.5, 1.1), (1.1, 0.3), (1.4, 0.4))
POT_DEEP_M, POT_HALF_M = 0.08, (0.04, 0.075)  # least depth; half of its width inside
EDGE_M, OFF_SHARE, BESIDE_COST = 0.005, 0.5, 3.0  # beside the middle, with a cost for each metre
ASIDE_SHARE, ON_OTHERS_COST = 0.4, 8.0  # beside what lies there, with a gain for each metre from it
NARROW_SHARE = 0.7  # the same in what is narrow: what stands there is as high in its middle as anywhere
LEAST_ROOM_M, SHALLOW_M = 0.01, 0.02
COUNTS_SHARE = 0.85  # of how far from the middle an object counts as in or on another one, however narrow that is
# In a vessel an object goes to where others heap up least, so that it comes to touch the vessel: cost for each metre,
# and factors of how far it is from the middle.
HEAP_COST, BESIDE_SHARES = 8.0, (1.0, 1.4)
ON_EDGE_SHARE, OVER_EDGE_M = 2.4, 0.01  # such a factor, where others reach so far over the edge: one leans on that
BASIN_AHEAD_M, BASIN_ASIDE_M = 0.09, 0.08  # from the basin's middle: before the faucet, whose spout reaches over it
# Heights of the underside over the basin's rim at which an object is let go, metres, with their costs.
BASIN_DROPS = ((-0.07, 0.0), (-0.03, 0.2), (0.02, 0.5))
COLUMNS, MANY_COLUMNS = 5, 13  # points across a region; where its place among others matters
REGION_EDGE_M = 0.015  # kept from a region's sides
INWARDS = (0.0, 0.05, 0.10)  # from the front of a region, metres
# The same, behind others: where so many lie less far than this from the front.
BEHIND, FRONT_M, FULL = (0.17, 0.24), 0.20, 2
DROPS_M = (0.0, 0.04, 0.08, 0.12)  # over the floor of receptacles that are open above
DROP_COST, DEEP_COST, ASIDE_COST = 2.0, 2.0, 0.5  # for each metre
HIGH_COST = 0.5  # for each metre that a shelf is above the lowest one
OVER_RIM_M = (0.0, 0.015, 0.03, 0.045)  # of the underside
RIMS_M = (0.012, 0.045, 0.08)  # of the underside above a bowl's rim: a level hand needs room below it
FAR_COST, BURNER_ROOM_M = 0.8, 0.10  # for each metre from the robot; half of what a vessel takes on a burner
ELSEWHERE_M = 0.6  # an object's origin as far as this is nowhere near
# Of a knob from the vessel's middle, that a hand fits between; a knob less than this below the burners is on top.
KNOB_ROOM_M, TIGHT_COST, ON_TOP_M = 0.30, 2.0, 0.05


def reach_on(env: KitchenEnv, holder: str) -> float:
    """How far from an object's middle others are put in or on it, metres: goals count them there, with some to spare.

    Goals measure to a corner of its box, beyond the rim of a round one; this is a share of half its length.
    """
    return COUNTS_SHARE * RECEPTACLE_SHARE * half_length(env, holder)


def on_object(env: KitchenEnv, obj: Graspable, holder: str, *, more: bool = False) -> PlacePoses:
    """In or on another object: its middle, or beside what lies there already, or is to come where there is `more`."""
    data, placed = env.data, env.scene.objects[holder]

    def poses() -> list[PlacePose]:
        body = data.body(placed.name)
        turn, inside = body.xmat.reshape(3, 3), placed.item.interior
        if inside is None:
            return [PlacePose(body.xpos + UP * placed.item.size[2] / 2)]
        middle, half = np.array(inside.center), np.array(inside.half)
        deep = 2 * half[2]
        most = reach_on(env, placed.name)
        names = [name for name in contents_of(env, placed.name) if name != obj.name]
        others = [data.body(name).xpos[:2].copy() for name in names]
        tops = _points_of(env, names)
        width = float(np.sort(obj.half_extents(data.body(obj.name).xmat.reshape(3, 3))[:2])[0])
        room = np.maximum(half[:2] - obj.half_extents(np.eye(3))[:2].max() - EDGE_M, 0.0)
        room = np.minimum(room, OFF_SHARE * half[:2])
        narrow = deep > SHALLOW_M and half[:2].min() < NARROW_M
        if others:  # beside them, though it may then lean on the wall
            room = np.maximum(room, (NARROW_SHARE if narrow else ASIDE_SHARE) * half[:2])
        found = []
        if (others or more) and is_flat(env, placed.name):
            for beside in offsets(most):
                floor = body.xpos + turn @ (middle + np.array([*beside, -half[2]]))
                cost = BESIDE_COST * float(np.linalg.norm(beside))
                found += [PlacePose(floor + UP * deep * drop, cost + extra) for drop, extra in DROPS]
            return found
        sides, heaped = (0.0, -1.0, 1.0), bool(others) and deep > SHALLOW_M
        shares: tuple[float, ...] = BESIDE_SHARES if heaped else BESIDE_SHARES[:1]
        edge = body.xpos[2] + middle[2] + half[2]
        if heaped and tops[:, 2].max() > edge + OVER_EDGE_M:
            shares += (ON_EDGE_SHARE,)
        for i, j, share in itertools.product(sides, sides, shares):
            if (i, j) != (0.0, 0.0) and room.max() <= LEAST_ROOM_M:
                continue
            beside = np.array([i, j]) * share * room
            beside *= most / max(float(np.linalg.norm(beside)), most)
            floor = body.xpos + turn @ (middle + np.array([*beside, -half[2]]))
            cost = BESIDE_COST * float(np.linalg.norm(beside))
            if heaped:
                cost += HEAP_COST * _height_at(tops, floor, width)
            cost -= ON_OTHERS_COST * min((float(np.linalg.norm(floor[:2] - other)) for other in others), default=0.0)
            found += [
                PlacePose(floor + UP * deep * drop, cost + (extra if deep > SHALLOW_M else 0.0))
                for drop, extra in (OVER_RIM if narrow else POT_DROPS if _jams(half) else DROPS)
            ]
        return found

    return poses


def _jams(half: Array) -> bool:
    """Whether an open hand is about as wide as a vessel inside, whose half extents (3,) are given, and that is deep."""
    return bool(2 * half[2] > POT_DEEP_M and POT_HALF_M[0] < min(half[:2]) < POT_HALF_M[1])


def _points_of(env: KitchenEnv, names: Sequence[str]) -> Array:
    """Points (n, 3) in the room that fill objects."""
    found: list[Array] = [np.zeros((0, 3))]
    for name in names:
        body = env.data.body(name)
        turn = body.xmat.reshape(3, 3)
        found += [filled(solid.cloud()) @ turn.T + body.xpos for solid in graspable(env, name).solids]
    return np.concatenate(found)


def _height_at(points: Array, floor: Array, within: float) -> float:
    """How high points reach over a floor, no farther than `within` from a place on it, metres."""
    near = points[np.linalg.norm(points[:, :2] - floor[:2], axis=1) < within]
    return float(max(near[:, 2].max() - floor[2], 0.0)) if len(near) else 0.0


def in_basin(env: KitchenEnv, basin: Region) -> PlacePoses:
    """Low over the front half of a basin."""

    def poses() -> list[PlacePose]:
        ahead = min(BASIN_AHEAD_M, basin.half[1] - 0.07)
        return [
            PlacePose(basin.world(env.data, (aside, -ahead, basin.half[2])) + z * UP, extra + abs(aside))
            for aside in (0.0, -BASIN_ASIDE_M, BASIN_ASIDE_M)
            for z, extra in BASIN_DROPS
        ]

    return poses


def in_regions(
    env: KitchenEnv,
    obj: Graspable,
    regions: list[Region],
    drops: tuple[float, ...],
    columns: int = COLUMNS,
    *,
    behind: bool = False,
) -> PlacePoses:
    """On the floors of regions, near their fronts, or let fall from heights `drops` above, metres.

    Of the points across a region, so many are taken that are nearest to the robot. With `behind`, or where the front is
    full, places farther back are among them.
    """
    data = env.data

    def poses() -> list[PlacePose]:
        half = obj.half_extents(data.body(obj.name).xmat.reshape(3, 3))
        across = float(max(half[:2]))
        base, _ = base_pose(data)
        lowest = min(float(region.world(data, (0, 0, -region.half[2]))[2]) for region in regions)
        found = []
        for region in regions:
            wide, deep, tall = region.half
            room_x, room_y = max(wide - across - REGION_EDGE_M, 0.0), max(deep - across - REGION_EDGE_M, 0.0)
            own = float(np.clip(region.local(data, base)[0], -room_x, room_x))
            inside = INWARDS + BEHIND if behind or _full_in_front(env, obj, region) else INWARDS
            across_it = {round(x, 3) for x in (own, *np.linspace(-room_x, room_x, columns).tolist())}
            rise = float(region.world(data, (0, 0, -tall))[2]) - lowest
            for x in sorted(across_it, key=lambda x: abs(x - own))[:columns]:
                for inwards in inside:
                    y = min(-room_y + inwards, room_y)
                    for drop in drops:
                        point = region.world(data, (x, y, -tall + drop))
                        cost = DROP_COST * drop + DEEP_COST * inwards + ASIDE_COST * abs(x - own) + HIGH_COST * rise
                        found.append(PlacePose(point, cost))
        return found

    return poses


def _full_in_front(env: KitchenEnv, obj: Graspable, region: Region) -> bool:
    """Whether several other objects lie at the front of a region."""
    points = [env.data.body(name).xpos for name in env.scene.objects if name not in (obj.name, *obj.contents)]
    inside = [point for point in points if region.contains(env.data, point)]
    at_front = [float(region.local(env.data, point)[1]) + region.half[1] < FRONT_M for point in inside]
    return sum(at_front) >= FULL


def over_jug(env: KitchenEnv, jug: Region) -> PlacePoses:
    """Over the rim of a jug, from where the object falls into it."""

    def poses() -> list[PlacePose]:
        return [PlacePose(jug.world(env.data, (0.0, 0.0, jug.half[2] + rim)), DROP_COST * rim) for rim in OVER_RIM_M]

    return poses


def over_bowl(env: KitchenEnv, bowl: Region) -> PlacePoses:
    """In the middle of a bowl, from deep in it to above its rim."""

    def poses() -> list[PlacePose]:
        tall = 2 * bowl.half[2]
        return [
            PlacePose(bowl.world(env.data, (0.0, 0.0, z - bowl.half[2])), DROP_COST * z)
            for z in (tall * 0.3, tall * 0.6, tall * 0.85, *(tall + rim for rim in RIMS_M))
        ]

    return poses


def at_site(env: KitchenEnv, site: str, floor: Region) -> PlacePoses:
    """Below or at a site, on the floor of a region: under a spout."""

    def poses() -> list[PlacePose]:
        point: Array = env.data.site(site).xpos
        return [PlacePose(np.array([*point[:2], floor.world(env.data, (0.0, 0.0, -floor.half[2]))[2]]))]

    return poses


def over_burners(env: KitchenEnv, obj: Graspable, hob: Hob, burners: Sequence[str]) -> PlacePoses:
    """On the middle of a burner that carries nothing: the front ones first, and those that leave room at the knob."""

    def poses() -> list[PlacePose]:
        base, _ = base_pose(env.data)
        found = []
        for burner in burners:
            region = hob.regions[burner]
            floor = region.world(env.data, (0.0, 0.0, -region.half[2]))
            if not _taken(env, obj, floor):
                tight = KNOB_ROOM_M - _apart_from_knob(env, hob, burner, floor)
                cost = FAR_COST * float(np.linalg.norm((floor - base)[:2])) + TIGHT_COST * max(tight, 0.0)
                found.append(PlacePose(floor, cost))
        return found

    return poses


def _apart_from_knob(env: KitchenEnv, hob: Hob, burner: str, floor: Array) -> float:
    """How far a burner's own knob is from its middle where both are on top; a knob on the front blocks no hand."""
    away = env.data.body(f"{hob.name}_knob_{burner}").xpos - floor
    return float(np.linalg.norm(away[:2])) if away[2] > -ON_TOP_M else np.inf


def _taken(env: KitchenEnv, obj: Graspable, point: Array) -> bool:
    """Whether another object reaches to where an object would stand, however it is turned."""
    reach = min(float(np.linalg.norm(obj.cloud[:, :2], axis=1).max()), BURNER_ROOM_M) + EDGE_M
    for name in env.scene.objects:
        if name == obj.name or name in obj.contents:
            continue
        body, turn = env.data.body(name), env.data.body(name).xmat.reshape(3, 3)
        if np.linalg.norm(body.xpos - point) > ELSEWHERE_M:
            continue
        for solid in graspable(env, name).solids:
            away = filled(solid.cloud()) @ turn.T + body.xpos - point
            if float(np.linalg.norm(away[:, :2], axis=1).min()) < reach:
                return True
    return False
