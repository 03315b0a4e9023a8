"""Put an object on, or into, another one, or into the basin of a sink.

What fails: the wrist is held up under a wall cabinet on its way out; a microwave in a corner leaves no place to stand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.common import stage_done
from robocasa_lerobot.demos.skills.microwaves import go_round_door, taking_out
from robocasa_lerobot.demos.skills.pick import FROM_A_SLOT, FROM_ABOVE
from robocasa_lerobot.demos.skills.put import Putting, Spot, move
from robocasa_lerobot.demos.skills.things import thing
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.tasks.task import Stage

# Shares of the depth of what it goes into at which an object may be let go, with their costs.
DROPS = ((0.0, 0.0), (0.5, 0.4), (1.1, 0.7))
EDGE_M, OFF_SHARE, BESIDE_COST = 0.005, 0.5, 3.0  # beside the middle, with a cost for each metre
BASIN_AHEAD_M, BASIN_ASIDE_M = 0.09, 0.08  # from the basin's middle: before the faucet, whose spout reaches over it
# Heights of the underside over the basin's rim at which an object is let go, metres, with their costs.
BASIN_DROPS = ((-0.07, 0.0), (-0.03, 0.2), (0.02, 0.5))


def place_on(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Put the stage's object on, or into, the object that is its target, both standing free.

    Raises:
        SkillError: it is not there after all attempts.
    """
    how = Putting(_on(env, stage), done_when(env, stage), leans=(0.0, np.deg2rad(25.0)), taking=FROM_ABOVE)
    yield from move(env, thing(env, stage.object), how)


def place_on_reaching_in(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """The same where one of the two stands in a microwave, an oven or a toaster.

    Raises:
        SkillError: it is not there after all attempts.
    """
    what = thing(env, stage.object)
    yield from go_round_door(env)
    how = Putting(
        _on(env, stage),
        done_when(env, stage),
        leans=(0.0, np.deg2rad(30.0), np.deg2rad(55.0)),
        entries=("up", "across", "out"),
        taking=FROM_A_SLOT if what.item is not None and what.item.upright_axis is not None else taking_out(env, what),
        in_m=0.25,
    )
    yield from move(env, what, how)


def place_into_basin(env: KitchenEnv, stage: Stage) -> Iterator[Array]:
    """Take the stage's object and let it go low over the front half of the basin.

    Raises:
        SkillError: it is not there after all attempts.
    """
    data, basin = env.data, env.scene.fixture(stage.target, Sink).basin

    def spots() -> list[Spot]:
        ahead = min(BASIN_AHEAD_M, basin.half[1] - 0.07)
        return [
            Spot(basin.world(data, (aside, -ahead, basin.half[2])) + z * UP, extra + abs(aside))
            for aside in (0.0, -BASIN_ASIDE_M, BASIN_ASIDE_M)
            for z, extra in BASIN_DROPS
        ]

    how = Putting(spots, done_when(env, stage), leans=(0.0, np.deg2rad(25.0)), entries=("up", "across"))
    yield from move(env, thing(env, stage.object), how)


def done_when(env: KitchenEnv, stage: Stage) -> Callable[[], bool]:
    """Whether the stage's condition holds."""
    return lambda: stage_done(env, stage)


def _on(env: KitchenEnv, stage: Stage) -> Callable[[], list[Spot]]:
    """Spots in or on the object that is the stage's target: its middle, or beside what lies there already."""
    what = thing(env, stage.object)
    data, holder = env.data, env.scene.objects[stage.target]

    def spots() -> list[Spot]:
        body = data.body(holder.name)
        turn, inside = body.xmat.reshape(3, 3), holder.item.interior
        if inside is None:
            return [Spot(body.xpos + UP * holder.item.size[2] / 2)]
        middle, half = np.array(inside.center), np.array(inside.half)
        deep = 2 * half[2]
        room = np.maximum(half[:2] - what.half_extents(np.eye(3))[:2].max() - EDGE_M, 0.0)
        room = np.minimum(room, OFF_SHARE * half[:2])
        floors = [
            (np.array([x * room[0], y * room[1], -half[2]]), BESIDE_COST * float(np.hypot(x * room[0], y * room[1])))
            for x in (0, -1, 1)
            for y in (0, -1, 1)
            if (x, y) == (0, 0) or room.max() > 0.01
        ]
        return [
            Spot(body.xpos + turn @ (middle + floor) + UP * deep * share, aside + (extra if deep > 0.02 else 0.0))
            for floor, aside in floors
            for share, extra in DROPS
        ]

    return spots
