"""A tool or vessel brought to where it is used: in the hand, and what it is used on within reach."""

from __future__ import annotations

from collections.abc import Iterator

from robocasa_lerobot.demos.motion import Array
from robocasa_lerobot.demos.skills.pick_place.carrying.carry import carry_to, in_reach, standing_pose_for
from robocasa_lerobot.demos.skills.pick_place.grasp_strategy import GraspStrategy
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.demos.skills.pick_place.pick import is_held
from robocasa_lerobot.demos.skills.pick_place.verbs import take
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture


def bring(
    env: KitchenEnv,
    obj: Graspable,
    target: str | tuple[Array, Fixture | None],
    strategy: GraspStrategy,
    *,
    towards_target: bool = False,
) -> Iterator[Array]:
    """Pick an object up unless it is in the hand, and drive along with it unless the target is in reach.

    Args:
        env: in its scene.
        obj: what is brought.
        target: name of the object that it is used on; or a place, world, metres, and the fixture that it belongs to.
        strategy: how it is grasped.
        towards_target: the arm is folded for where it goes on to the target from there.

    Raises:
        SkillError: it is not in the hand after all attempts, or there is no way to the target.
    """
    if not is_held(env, obj.name):
        yield from take(env, obj, strategy)
    middle, fixture = (
        (env.data.body(target).xpos.copy(), locate(env, target).fixture) if isinstance(target, str) else target
    )
    if fixture is not None and not in_reach(env, middle):
        stand = standing_pose_for(env, fixture, middle)
        yield from carry_to(env, obj, stand, middle if towards_target else None)
