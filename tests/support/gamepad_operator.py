"""An operator with a gamepad: eyes in the simulation, hands on the sticks, a demonstration in mind."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from page_support import Page
from scipy.spatial.transform import Rotation
from teleop_support import WAIT_S

from robocasa_lerobot.demos.recorder import Recording
from robocasa_lerobot.envs.robots.panda_omron.control.kernel import POSITION_SCALE_M, ROTATION_SCALE_RAD
from robocasa_lerobot.envs.robots.panda_omron.names import ARM_CENTER_SITE, GRIP_SITE

DEAD = 0.1  # of the page's gamepad
GAIN = 2.0  # of what is missing, per step; about a quarter of a command arrives
NEAR_M, NEAR_RAD = 0.02, 0.15  # within which the next pose is looked at
PATIENCE = 12  # steps for a pose, after which the next one is tried all the same
GRIP_STEPS = 12  # that the fingers take


@dataclass(frozen=True)
class Poses:
    """Where a demonstration's hand was in the world at its T steps: (T, 3), T rotations, closed (T,) or not."""

    positions: NDArray[np.float64]
    rotations: Rotation
    closed: NDArray[np.bool_]

    @classmethod
    def of(cls, recording: Recording) -> Poses:
        seen = recording.observations
        turned = Rotation.from_quat(seen["robot0_eef_quat_site"])
        return cls(np.asarray(seen["robot0_eef_pos"]), turned, recording.actions[:, 6] > 0)


class Follower:
    """Leads the hand along the poses by the gamepad alone; `index` is the pose that is looked at."""

    def __init__(self, page: Page, poses: Poses) -> None:
        self._page, self._poses = page, poses
        self.index, self._since, self._grip = 0, 0, 0
        self.reached: dict[int, int] = {}  # of each step, the pose that was looked at

    def go(self, until: int, phase: str = "review") -> None:
        """Until a pose is looked at, or the phase begins."""
        session = self._page.session
        deadline, last = time.monotonic() + WAIT_S, -1
        while self.index < until and session.phase != phase:
            assert time.monotonic() < deadline, f"pose {self.index} of {until}: {session.phase}"
            steps = len(session.driven)
            if steps == last:
                time.sleep(0.005)
                continue
            last = steps
            self._look(steps)
        self._page.pad()

    def back(self, steps: int) -> None:
        """The episode is at an earlier step again: so is what is looked at."""
        self.index = self.reached[max(step for step in self.reached if step <= steps)]
        self._since = 0

    def _look(self, steps: int) -> None:
        data, poses, steering = self._page.session.env.data, self._poses, self._page.session.driver.steering
        base = data.site(ARM_CENTER_SITE).xmat.reshape(3, 3)
        while True:
            missing = base.T @ (poses.positions[self.index] - data.site(GRIP_SITE).xpos)
            here = Rotation.from_matrix(data.site(GRIP_SITE).xmat.reshape(3, 3))
            turn = base.T @ (poses.rotations[self.index] * here.inv()).as_rotvec()
            near = np.linalg.norm(missing) < NEAR_M and np.linalg.norm(turn) < NEAR_RAD
            gripped = self._grip == 0 and steering.closed == poses.closed[self.index]
            late = self._since > PATIENCE
            if not (gripped and (near or late)) or self.index == len(poses.positions) - 1:
                break
            self.index, self._since = self.index + 1, 0
        self.reached[steps] = self.index
        self._since += 1
        self._grip = max(0, self._grip - 1)
        press = {}
        if steering.closed != poses.closed[self.index] and self._grip == 0 and near:
            press, self._grip = {"b0": 1.0}, GRIP_STEPS
        x, y, z = np.clip(GAIN * missing / POSITION_SCALE_M, -1, 1)
        roll, pitch, yaw = np.clip(GAIN * turn / ROTATION_SCALE_RAD, -1, 1)
        sticks = [_stick(-y), _stick(-x), _stick(-yaw), _stick(-z)]
        triggers = {"b5": max(roll, 0.0), "b4": max(-roll, 0.0)}
        triggers |= {"b7": abs(_stick(max(pitch, 0.0))), "b6": abs(_stick(max(-pitch, 0.0)))}
        self._page.pad(sticks, **{name: float(value) for name, value in {**triggers, **press}.items()})


def _stick(wanted: float) -> float:
    """The deflection that the page takes for a wanted one."""
    return 0.0 if wanted == 0 else float(np.sign(wanted) * (DEAD + (1 - DEAD) * abs(wanted)))
