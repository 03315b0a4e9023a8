"""What tools are used on: the top of an object or the floor of a vessel, a counter, the basin of a sink."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.demos.skills.pick_place.location import locate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture
from robocasa_lerobot.envs.kitchens.fixtures.counters import Counter

DEEP_M = 0.03  # of a vessel, that is used inside rather than on its rim
FRONT_SHARE = 0.3  # of half a basin's depth, by which the faucet is kept clear of


@dataclass(frozen=True)
class Surface:
    """A level rectangle in the world.

    Attributes:
        middle: world, metres.
        axes: of the rectangle, in rows, unit vectors.
        size: full extents along the axes, metres.
        bodies: that make it, which the tool may touch.
        fixture: that it belongs to, or that its object is on.
        title: for messages.
    """

    middle: Array
    axes: NDArray[np.float64]
    size: tuple[float, float]
    bodies: frozenset[int]
    fixture: Fixture | None
    title: str


def surface_of(env: KitchenEnv, target: str, beside: Array) -> Surface:
    """The surface of a target, an object's name or a fixture's role; of a counter what is around `beside`, world.

    Raises:
        SkillError: the target has no such surface.
    """
    if target in env.scene.objects:
        return _of_object(env, target)
    fixture = env.scene.fixture(target)
    bodies = _bodies(env, fixture.name)
    c, s = np.cos(fixture.yaw), np.sin(fixture.yaw)
    axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    match fixture:
        case Sink():
            half = fixture.basin.half
            middle = fixture.basin.world(env.data, (0.0, -FRONT_SHARE * half[1], -half[2]))
            return Surface(middle, axes, (2 * half[0], half[1]), bodies, fixture, "the sink")
        case Counter():
            middle = np.array([beside[0], beside[1], fixture.surface_z])
            return Surface(middle, axes, (np.inf, np.inf), bodies, fixture, "the counter")
    raise SkillError(f"{target} is nothing that a tool is used on")


def _of_object(env: KitchenEnv, name: str) -> Surface:
    body, item = env.data.body(name), env.scene.objects[name].item
    axes, inside = body.xmat.reshape(3, 3).T.copy(), item.interior
    bodies, fixture = _bodies(env, name), locate(env, name).fixture
    if inside is not None and 2 * inside.half[2] > DEEP_M:
        middle = body.xpos + axes.T @ np.asarray(inside.center) - UP * inside.half[2]
        return Surface(middle, axes, (2 * inside.half[0], 2 * inside.half[1]), bodies, fixture, name)
    middle = body.xpos + UP * item.size[2] / 2
    return Surface(middle, axes, (item.size[0], item.size[1]), bodies, fixture, name)


def _bodies(env: KitchenEnv, name: str) -> frozenset[int]:
    return frozenset(int(body) for body in np.flatnonzero(env.scene.subtree(name)))
