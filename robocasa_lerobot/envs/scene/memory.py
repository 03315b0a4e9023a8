"""What a goal remembers from step to step: numbers that are positions of hidden joints.

Positions are what every state and every recording holds, so memory needs no second channel
(docs/decisions/0026-goals-with-memory.md). A joint is a slide along x of a body without shape: no force acts on it, it
touches nothing, and it sleeps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robocasa_lerobot.envs.kitchens.fixtures.base import set_inertia

PREFIX = "memory"  # of the names of bodies and joints
# So light that the solver, whose tolerance goes by the mass of everything, takes no notice.
_MASS_KG, _SIZE_M = 1e-6, (0.01, 0.01, 0.01)


def add_memory(spec: mujoco.MjSpec, kept: Mapping[str, tuple[str, ...]]) -> None:
    """Add a hidden joint `memory_<owner>_<number>` for each number that is kept, by owner; they start at zero."""
    for owner, numbers in kept.items():
        for number in numbers:
            body = spec.worldbody.add_body(name=_body(owner, number))
            body.add_joint(name=_joint(owner, number), type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
            set_inertia(body, _MASS_KG, _SIZE_M)


@dataclass
class Memory:
    """Where the numbers of a scene's goals stand in `qpos`, by owner."""

    places: dict[str, NDArray[np.intp]] = field(default_factory=dict)

    @classmethod
    def of(cls, model: mujoco.MjModel, kept: Mapping[str, tuple[str, ...]]) -> Memory:
        """Find the joints that `add_memory` added."""
        return cls(
            {
                owner: np.array([model.joint(_joint(owner, n)).qposadr[0] for n in numbers], dtype=np.intp)
                for owner, numbers in kept.items()
            }
        )

    def read(self, data: mujoco.MjData, owner: str) -> NDArray[np.float64]:
        """A copy of an owner's numbers, in the order in which they were asked for."""
        numbers: NDArray[np.float64] = data.qpos[self.places[owner]]
        return numbers

    def write(self, data: mujoco.MjData, owner: str, numbers: ArrayLike) -> None:
        """Keep other numbers. Nothing has to be evaluated anew: nothing else depends on these joints."""
        data.qpos[self.places[owner]] = numbers


def _body(owner: str, number: str) -> str:
    return f"{PREFIX}_{owner}_{number}"


def _joint(owner: str, number: str) -> str:
    return f"{_body(owner, number)}_joint"
