"""What LeRobot's devices say, as the kitchen's twelve numbers.

Frames: x forward, y left, z up, of the robot's base. A full command moves the hand's goal by 5 cm or 0.5 rad per step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robocasa_lerobot import contract
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import POSITION_SCALE_M, ROTATION_SCALE_RAD
from robocasa_lerobot.errors import UserError

NAMES: tuple[str, ...] = tuple(contract.component_names(contract.ACTION_PARTS))
OPEN, CLOSED = -1.0, 1.0
# What a motion is added to: the pose that the hand has reached, of which a quarter arrives in a step, or its goal
# before, so that all of it arrives in the end. Deflections mean a speed and end at once; a phone's pose is a place.
FROM_REACHED, FROM_GOAL = -1.0, 1.0
JUMP_M = 0.06  # of a phone from one step to the next: its tracking was lost, the hand stays
_DELTAS = ("delta_x", "delta_y", "delta_z")
# LeRobot has a phone's turns for a tool that points down (`EEReferenceAndDelta`): about x and z the other way round.
_TURNS_OF_TOOL = np.array([-1.0, 1.0, -1.0])
_TARGETS = ("target_x", "target_y", "target_z", "target_wx", "target_wy", "target_wz")


class HandTranslator:
    """Turns the actions of a device that leads the hand into the kitchen's; remembers the gripper and the last pose.

    Understood are `delta_x/y/z` in [-1, 1] with `gripper` 0 (close), 1 (stay), 2 (open), as LeRobot's gamepad and
    keyboard give, and `target_x/y/z` (m, of the base) with `target_wx/wy/wz` (rotation vector, of the tool) since
    `enabled` became true and `gripper_vel`, as its phone gives.

    Args:
        speed: share of the full speed.
        keyboard_axes: x is left and y backward, as LeRobot's `keyboard_ee` has it.
    """

    def __init__(self, speed: float = 1.0, keyboard_axes: bool = False) -> None:
        self._speed, self._keyboard_axes = speed, keyboard_axes
        self.reset()

    def reset(self) -> None:
        """Forget the gripper's last command and the last pose: a new episode starts with an open hand."""
        self._gripper = OPEN
        self._last: tuple[NDArray[np.float64], Rotation] | None = None

    def action(self, said: Mapping[str, Any]) -> dict[str, float]:
        """The twelve numbers by name, in stored order, for what a device said; nothing said holds the hand still.

        Raises:
            UserError: the device says something else.
        """
        if not said:
            return self._named(np.zeros(6))
        if set(_DELTAS) <= said.keys():
            return self._named(self._from_deltas(said))
        if set(_TARGETS) <= said.keys():
            motion = self._from_pose(said)
            return self._named(np.zeros(6)) if motion is None else self._named(motion, FROM_GOAL)
        raise UserError(
            f"the teleoperator says {', '.join(sorted(map(str, said))[:8])}; a kitchen understands its own "
            f"twelve numbers ({', '.join(NAMES)}), delta_x, delta_y, delta_z with gripper, or a phone's pose. "
            "Use --teleop.type=robocasa_hand, robocasa_replay or gamepad."
        )

    def _from_deltas(self, said: Mapping[str, Any]) -> NDArray[np.float64]:
        x, y, z = (float(said[name]) for name in _DELTAS)
        if self._keyboard_axes:
            x, y = -y, x
        # 0 close, 1 stay, 2 open.
        grip = float(said.get("gripper", 1.0))
        self._grip(close=grip < 0.5, open_=grip > 1.5)
        return np.array([x, y, z, 0.0, 0.0, 0.0]) * self._speed

    def _from_pose(self, said: Mapping[str, Any]) -> NDArray[np.float64] | None:
        """The motion since the last pose; None where the hand is to stay where it is, and push no longer."""
        grip = float(said.get("gripper_vel", 0.0))
        self._grip(close=grip < -0.5, open_=grip > 0.5)
        if not said.get("enabled", True):
            self._last = None
            return None
        values = np.array([float(said[name]) for name in _TARGETS])
        now = values[:3], Rotation.from_rotvec(values[3:] * _TURNS_OF_TOOL)
        last, self._last = self._last, now
        if last is None or np.linalg.norm(now[0] - last[0]) > JUMP_M:
            return None
        turned = (now[1] * last[1].inv()).as_rotvec()
        motion = np.concatenate([(now[0] - last[0]) / POSITION_SCALE_M, turned / ROTATION_SCALE_RAD])
        return np.asarray(motion * self._speed)

    def _grip(self, close: bool, open_: bool) -> None:
        if close != open_:
            self._gripper = CLOSED if close else OPEN

    def _named(self, hand: NDArray[np.float64], mode: float = FROM_REACHED) -> dict[str, float]:
        hand = np.clip(hand, -1.0, 1.0)
        vector = contract.join_action(
            {
                "base_motion": np.zeros(4),
                "control_mode": [mode],
                "end_effector_position": hand[:3],
                "end_effector_rotation": hand[3:],
                "gripper_close": [self._gripper],
            }
        )
        return dict(zip(NAMES, vector.tolist(), strict=True))
