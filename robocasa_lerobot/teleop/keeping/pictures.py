"""The last pictures that clients were sent: what they say of one is about what it shows, not about what came since."""

from __future__ import annotations

import collections
import dataclasses
from dataclasses import dataclass

import mujoco

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.physics.whole_state import write_physics
from robocasa_lerobot.envs.state import KitchenState
from robocasa_lerobot.teleop.views import FreeCamera

_MOST = 256  # that are remembered


@dataclass(frozen=True)
class _Picture:
    """When it was drawn, of which state if of any, and how the free camera stood."""

    at: float
    state: KitchenState | None
    free: FreeCamera


class LastPictures:
    """Pictures by their numbers, which count up from 1."""

    def __init__(self) -> None:
        self._number = 0
        self._kept: collections.OrderedDict[int, _Picture] = collections.OrderedDict()

    def add(self, now: float, state: KitchenState | None, free: FreeCamera) -> int:
        """The number of the next picture."""
        self._number += 1
        self._kept[self._number] = _Picture(now, state, dataclasses.replace(free))
        while len(self._kept) > _MOST:
            self._kept.popitem(last=False)
        return self._number

    def age(self, number: int | None, now: float) -> float | None:
        """Seconds since a picture was drawn; None for one that is not known any more, or never was."""
        picture = None if number is None else self._kept.get(number)
        return None if picture is None else now - picture.at

    def shown(self, number: int, env: KitchenEnv, free: FreeCamera) -> tuple[mujoco.MjData, FreeCamera]:
        """The state in a picture and the free camera as it stood; the env's and `free` where that is not known."""
        picture = self._kept.get(number)
        if picture is None or picture.state is None or picture.state.seed != env.scene.seed:
            return env.data, free
        data = mujoco.MjData(env.model)
        write_physics(env.model, data, picture.state.physics, picture.state.asleep)
        return data, picture.free
