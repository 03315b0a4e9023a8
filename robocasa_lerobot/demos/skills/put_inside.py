"""Put an object into a part of a fixture: onto a shelf or a rack, into a drawer, a jug or a bowl, under a spout.

What fails: a rolling pin as long as the drawer, now and then a loaf in the bowl, long food deep in a fridge's drawer
below a shelf. For CoffeeSetupMug see `cups`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import OPEN, Array, HandTarget, base_pose, grip_position, hand_rotation
from robocasa_lerobot.demos.skills.common import SkillError, hold_hand, move_hand
from robocasa_lerobot.demos.skills.cups import FROM_THE_SIDE
from robocasa_lerobot.demos.skills.pick import ANYHOW, FROM_ABOVE, RELEASE_STEPS, Manner, best_way
from robocasa_lerobot.demos.skills.put import Putting, Spot, move
from robocasa_lerobot.demos.skills.put_down import done_when
from robocasa_lerobot.demos.skills.racks import pull
from robocasa_lerobot.demos.skills.things import Thing, thing
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance
from robocasa_lerobot.envs.kitchens.appliances.kinds.stand_mixer import StandMixer
from robocasa_lerobot.envs.kitchens.fixtures.base import Region
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer
from robocasa_lerobot.envs.kitchens.fixtures.regions import regions_of
from robocasa_lerobot.envs.predicates.logic import AllOf
from robocasa_lerobot.envs.predicates.objects import ObjectInside
from robocasa_lerobot.envs.tasks.conditions import stage_condition
from robocasa_lerobot.envs.tasks.task import Stage

EDGE_M = 0.015  # kept from a region's sides
INWARDS = (0.0, 0.05, 0.10)  # from the front of a region, metres
DROPS_M = (0.0, 0.04, 0.08, 0.12)  # over the floor of what is open above
DROP_COST, DEEP_COST, ASIDE_COST = 2.0, 2.0, 0.5  # for each metre
# A jug stands below a wall cabinet: the hand comes level, from any side, and lets go over the rim.
OVER_RIM_M = (0.0, 0.015, 0.03, 0.045)  # of the underside
LEVEL_LEANS = (np.deg2rad(72.0), np.deg2rad(85.0))
TURNS = tuple(float(np.deg2rad(turn)) for turn in (0.0, 30.0, -30.0, 60.0, -60.0))
RIMS_M = (0.012, 0.045, 0.08)  # of the underside above a jug's rim: a level hand needs room below it
HIGH_COST = 0.5  # for each metre that a shelf is above the lowest one
STEEP_LEANS = (0.0, np.deg2rad(30.0), np.deg2rad(55.0), np.deg2rad(80.0))
LEANS = (0.0, np.deg2rad(30.0), np.deg2rad(55.0))
# Out of a drawer below a shelf, whose hind part the shelf covers.
FROM_CRISPER = Manner(
    tuple((float(np.deg2rad(tilt)), extra) for tilt, extra in ((35, 0.0), (50, 0.1), (20, 0.1), (65, 0.2), (5, 0.2))),
    ("along",),
    narrow=True,
)
HARD = 1.0  # cost of taking something out of it, from which on it is pulled out first
OFF_M = 0.10  # of the hand from what it has let go


def place_inside(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object into the regions of its target whose names begin with its part.

    Raises:
        SkillError: it is not there after all attempts.
    """
    done = done_when(env, stage)
    what = thing(env, stage.object)
    fixture, part = env.scene.fixture(stage.target), env.scene.part(stage.target, stage.part)
    regions = [region for name, region in regions_of(fixture) if name.startswith(part) and _usable(env, stage, region)]
    if isinstance(fixture, StandMixer):
        how = Putting(_over(env, regions[0]), done, leans=STEEP_LEANS, entries=("up", "across", "out"), in_m=0.2)
    elif isinstance(fixture, Drawer) or "drawer" in part:
        how = Putting(
            _in(env, what, regions, DROPS_M), done, leans=(0.0, np.deg2rad(30.0), np.deg2rad(50.0)),
            entries=("up", "across"), taking=ANYHOW if "drawer" in part else FROM_ABOVE,
        )  # fmt: skip
    else:
        how = Putting(
            _in(env, what, regions, (0.0,)), done, leans=LEANS, entries=("up", "across", "out"), taking=ANYHOW,
            in_m=0.28,
        )  # fmt: skip
    yield from move(env, what, how)


def place_inside_fridge(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object from a shelf of a fridge into its drawer, or out of the drawer onto a shelf.

    Raises:
        SkillError: it is not there after all attempts.
    """
    done = done_when(env, stage)
    what = thing(env, stage.object)
    fixture, part = env.scene.fixture(stage.target), env.scene.part(stage.target, stage.part)
    regions = [region for name, region in regions_of(fixture) if name.startswith(part) and _usable(env, stage, region)]
    into = "drawer" in part
    how = Putting(
        _in(env, what, regions, DROPS_M if into else (0.0,)), done, leans=LEANS, entries=("up", "across", "out"),
        taking=ANYHOW if into else FROM_CRISPER, in_m=0.28, narrow=not into,
    )  # fmt: skip
    if not into and best_way(env, what, FROM_CRISPER).cost > HARD:
        yield from _pull_out(env, stage)
    yield from move(env, what, how)


def _pull_out(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Pull the drawer that holds the stage's object all the way out, and let it go."""
    with contextlib.suppress(SkillError):
        yield from pull(env, Stage("racks", "pull", stage.target, part="{drawer}"))
    data = env.data
    at = HandTarget(grip_position(data), hand_rotation(data))
    yield from hold_hand(data, at, OPEN, RELEASE_STEPS)
    off = HandTarget(at.position - OFF_M * at.rotation[:, 2], at.rotation)
    yield from move_hand(data, off, OPEN, tolerance=0.03, max_steps=20)


def drop_into_jug(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Let the stage's object fall into the jug of its target.

    Raises:
        SkillError: it is not there after all attempts.
    """
    done = done_when(env, stage)
    region = regions_of(env.scene.fixture(stage.target))[0][1]

    def spots() -> list[Spot]:
        return [Spot(region.world(env.data, (0.0, 0.0, region.half[2] + rim)), DROP_COST * rim) for rim in OVER_RIM_M]

    how = Putting(spots, done, leans=LEVEL_LEANS, entries=("out", "across"), in_m=0.2, turns=TURNS, falls=True)
    yield from move(env, thing(env, stage.object), how)


def place_at_site(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Stand the stage's object where a site of its target is: a mug under a spout.

    Raises:
        SkillError: it is not there after all attempts.
    """
    done = done_when(env, stage)
    data, appliance = env.data, env.scene.fixture(stage.target, Appliance)
    region = next(iter(appliance.regions.values()))

    def spots() -> list[Spot]:
        site = data.site(f"{appliance.name}_{stage.part}").xpos
        floor = region.world(data, (0.0, 0.0, -region.half[2]))[2]
        return [Spot(np.array([*site[:2], floor]))]

    how = Putting(spots, done, entries=("out", "level"), taking=FROM_THE_SIDE, in_m=0.17, gap_m=0.003)
    yield from move(env, thing(env, stage.object), how)


def _usable(env: KitchenEnv, stage: Stage, region: Region) -> bool:
    """Whether things in a region count, where the stage's condition bounds its height."""
    floor = float(region.world(env.data, (0.0, 0.0, -region.half[2]))[2])
    whole = stage_condition(env.declaration, stage)
    for term in whole.parts if isinstance(whole, AllOf) else (whole,):
        if isinstance(term, ObjectInside):
            low, high, least = term.height
            return low <= floor <= high and 2 * region.half[2] >= least
    return True


def _in(env: KitchenEnv, what: Thing, regions: list[Region], drops: tuple[float, ...]) -> Callable[[], list[Spot]]:
    """Spots on the floors of regions, near their fronts."""
    data = env.data

    def spots() -> list[Spot]:
        half = what.half_extents(data.body(what.name).xmat.reshape(3, 3))
        across = float(max(half[:2]))
        base, _ = base_pose(data)
        lowest = min(float(region.world(data, (0, 0, -region.half[2]))[2]) for region in regions)
        found = []
        for region in regions:
            wide, deep, tall = region.half
            room_x, room_y = max(wide - across - EDGE_M, 0.0), max(deep - across - EDGE_M, 0.0)
            own = float(np.clip(region.local(data, base)[0], -room_x, room_x))
            columns = sorted({round(x, 3) for x in (own, *np.linspace(-room_x, room_x, 5))}, key=lambda x: abs(x - own))
            rise = float(region.world(data, (0, 0, -tall))[2]) - lowest
            for x in columns[:5]:
                for inwards in INWARDS:
                    y = min(-room_y + inwards, room_y)
                    for drop in drops:
                        point = region.world(data, (x, y, -tall + drop))
                        cost = DROP_COST * drop + DEEP_COST * inwards + ASIDE_COST * abs(x - own) + HIGH_COST * rise
                        found.append(Spot(point, cost))
        return found

    return spots


def _over(env: KitchenEnv, region: Region) -> Callable[[], list[Spot]]:
    """Spots over a jug or bowl, from deep in it to its rim."""

    def spots() -> list[Spot]:
        tall = 2 * region.half[2]
        return [
            Spot(region.world(env.data, (0.0, 0.0, z - region.half[2])), DROP_COST * z)
            for z in (tall * 0.3, tall * 0.6, tall * 0.85, *(tall + rim for rim in RIMS_M))
        ]

    return spots
