"""Turn a mug whose handle is in the way of a level hand: by its rim, from above, and down again where it stood.

Else the hand comes in beside the handle, meets it and knocks the mug away, or takes it by the rim, and then the two do
not fit below a spout.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import (
    FROM_ABOVE,
    GraspStrategy,
    ahead_of,
    in_radians,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import UPRIGHT_COS, Graspable
from robocasa_lerobot.demos.skills.pick_place.mugs import FROM_THE_SIDE, handle_of
from robocasa_lerobot.demos.skills.pick_place.pick import pick
from robocasa_lerobot.demos.skills.pick_place.place import PlacePose, PlaceStrategy, put
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

# Of the handle's direction along the heading: below the first it is in the way, from the second on well away.
IN_THE_WAY, AWAY = -0.1, 0.6
FACING_COST = 2.0  # of what that falls short by
MOST_TURNS = 2


def below_a_spout(obj: Graspable) -> GraspStrategy:
    """How an object is grasped that goes below a spout: level, and by its rim only where nothing else is left."""
    tilts = in_radians((78, 0.0), (84, 0.05), (60, 1.9))
    return replace(FROM_THE_SIDE, tilts=tilts, close_fit=True, first=turned_first(obj))


def turned_first(obj: Graspable) -> Callable[[KitchenEnv], Iterator[Array]] | None:
    """Before a grasp from the side: turn a mug that stands with its handle on the robot's side."""
    handle = handle_of(obj)
    if handle is None:
        return None
    left = MOST_TURNS

    def first(env: KitchenEnv) -> Iterator[Array]:
        nonlocal left
        ahead, body = ahead_of(env), env.data.body(obj.name)
        rotation = body.xmat.reshape(3, 3).copy()
        if not left or rotation[2, 2] < UPRIGHT_COS or float(rotation @ handle @ ahead) > IN_THE_WAY:
            return
        left -= 1
        foot = body.xpos - obj.below(rotation) * UP

        def fit(origin: Array, turn: Array) -> float:
            return FACING_COST * max(AWAY - float(turn @ handle @ ahead), 0.0)

        yield from pick(env, obj, FROM_ABOVE)
        yield from put(env, obj, PlaceStrategy(lambda: [PlacePose(foot)], fit=fit), [])

    return first
