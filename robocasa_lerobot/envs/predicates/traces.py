"""Conditions with memory on where objects have been: moved from an earlier pose, rubbed over a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np

from robocasa_lerobot.envs.predicates.logic import plain
from robocasa_lerobot.envs.predicates.memory import Array, WithMemory
from robocasa_lerobot.envs.predicates.objects import ObjectTouches, ObjectTouchesAnyCounter
from robocasa_lerobot.envs.predicates.robot import Grasped
from robocasa_lerobot.errors import UserError

if TYPE_CHECKING:
    from robocasa_lerobot.envs.scene.scene import Scene

_POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")
_BOX = ("x_low", "y_low", "x_high", "y_high")


@dataclass(frozen=True)
class MovedSince(WithMemory):
    """An object has moved or turned by more than a bound in the last control step, or since the reset.

    Attributes:
        object: name.
        since: "step" or "reset".
        by_m: bound of the distance that its origin has moved, metres; None where that does not count.
        by_rad: bound of the angle that it has turned by, radians; None where that does not count.
        across: count the horizontal distance alone.
        about_vertical: count the turn about the vertical alone, not that it tips.
    """

    object: str
    since: Literal["step", "reset"]
    by_m: float | None = None
    by_rad: float | None = None
    across: bool = False
    about_vertical: bool = False

    def __post_init__(self) -> None:
        if (self.by_m is None and self.by_rad is None) or self.since not in ("step", "reset"):
            raise UserError(
                f'{self}: expected a bound, `by_m` in metres or `by_rad` in radians, and since="step" or "reset".'
            )

    @property
    def name(self) -> str:
        """E.g. `obj_moved_since_reset`."""
        return f"{plain(self.object)}_{'turned' if self.by_m is None else 'moved'}_since_{self.since}"

    @property
    def numbers(self) -> tuple[str, ...]:
        """The earlier pose in the world; and, of the last step, whether it has moved: 0 or 1."""
        return _POSE if self.since == "reset" else (*_POSE, "moved")

    def begin(self, scene: Scene, data: mujoco.MjData) -> Array:
        """The pose at reset."""
        return np.append(self._pose(scene, data), np.zeros(len(self.numbers) - len(_POSE)))

    def after_step(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Compare with the step before, and keep the present pose for the next one."""
        kept = self.kept(scene, data)
        if self.since == "reset":
            return kept
        pose = self._pose(scene, data)
        return np.append(pose, float(self._far(kept[: len(_POSE)], pose)))

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare with the reset, or read what the last step has brought."""
        kept = self.kept(scene, data)
        return self._far(kept, self._pose(scene, data)) if self.since == "reset" else bool(kept[-1] > 0.5)

    def _far(self, before: Array, now: Array) -> bool:
        axes = 2 if self.across else 3
        if self.by_m is not None and float(np.linalg.norm(now[:axes] - before[:axes])) > self.by_m:
            return True
        if self.by_rad is None:
            return False
        turn = np.zeros(4)  # since then
        mujoco.mju_negQuat(turn, before[3:])
        mujoco.mju_mulQuat(turn, now[3:], turn.copy())
        w, x, y, z = turn
        if self.about_vertical:
            return abs(float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))) > self.by_rad
        return 2 * float(np.arccos(min(1.0, abs(w)))) > self.by_rad

    def _pose(self, scene: Scene, data: mujoco.MjData) -> Array:
        body = data.body(scene.fill(self.object))
        return np.concatenate([body.xpos, body.xquat])


@dataclass(frozen=True)
class Strokes(WithMemory):
    """A held tool has rubbed a surface: at several places apart from each other, over some span.

    A place is where the tool's origin is, in the frame of the surface, after a control step in which the gripper holds
    the tool and the tool touches the surface; it counts if it is far enough from those kept. That many places are
    kept, and the box around all that counted.

    Attributes:
        tool: name of the object that is held.
        surface: role of a fixture, name of an object, or "" for any counter.
        n_places: how many there must be.
        apart_m: least distance of two places, horizontal, metres.
        span_m: least diagonal of the box around the places, horizontal, metres.
    """

    tool: str
    surface: str
    n_places: int = 5
    apart_m: float = 0.02
    span_m: float = 0.10

    @property
    def name(self) -> str:
        """E.g. `sponge_rubbed_over_board`."""
        return f"{plain(self.tool)}_rubbed_over_{self.surface or 'any_counter'}"

    @property
    def numbers(self) -> tuple[str, ...]:
        """How many places counted (at most those kept), the box around them, and those kept."""
        places = (f"{axis}{number}" for number in range(self.n_places) for axis in "xy")
        return ("places", *_BOX, *places)

    def after_step(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Keep the present place, if it is one and enough is not done yet."""
        kept = self.kept(scene, data)
        if self._enough(kept) or not self._rubs(scene, data):
            return kept
        count, place = int(kept[0]), self._place(scene, data)
        places = kept[5 : 5 + 2 * count].reshape(-1, 2)
        if count and float(np.linalg.norm(places - place, axis=1).min()) < self.apart_m:
            return kept
        if count < self.n_places:
            kept[0], kept[5 + 2 * count : 7 + 2 * count] = count + 1, place
        kept[1:3] = np.minimum(kept[1:3], place) if count else place
        kept[3:5] = np.maximum(kept[3:5], place) if count else place
        return kept

    def holds(self, scene: Scene, data: mujoco.MjData) -> bool:
        """Compare number and span with the wanted ones."""
        return self._enough(self.kept(scene, data))

    def progress(self, scene: Scene, data: mujoco.MjData) -> float:
        """Share of the places and of the span, the lesser half of it."""
        kept = self.kept(scene, data)
        span = float(np.linalg.norm(kept[3:5] - kept[1:3]))
        return (float(kept[0]) / self.n_places + min(1.0, span / self.span_m)) / 2

    def _enough(self, kept: Array) -> bool:
        return bool(kept[0] >= self.n_places and np.linalg.norm(kept[3:5] - kept[1:3]) >= self.span_m)

    def _rubs(self, scene: Scene, data: mujoco.MjData) -> bool:
        if not Grasped(self.tool).holds(scene, data):
            return False
        touches = ObjectTouches(self.tool, self.surface) if self.surface else ObjectTouchesAnyCounter(self.tool)
        return touches.holds(scene, data)

    def _place(self, scene: Scene, data: mujoco.MjData) -> Array:
        """Where the tool is on the surface, (2,); in the world where it may be any counter."""
        point = data.body(scene.fill(self.tool)).xpos
        if self.surface:
            on_object = self.surface in scene.objects
            body = data.body(self.surface if on_object else scene.fixture(self.surface).name)
            point = body.xmat.reshape(3, 3).T @ (point - body.xpos)
        place: Array = point[:2].copy()
        return place
