"""What LeRobot's env calls, with the names and sizes of robocasa 1.0.1; every call is noted in `STAND_IN_NOTES`."""

import json
import os

import numpy as np

CAMERAS = ("robot0_agentview_left", "robot0_agentview_right", "robot0_eye_in_hand")
STATE = {
    "state.base_position": 3,
    "state.base_rotation": 4,
    "state.end_effector_position_relative": 3,
    "state.end_effector_rotation_relative": 4,
    "state.gripper_qpos": 2,
}


def note(**values):
    with open(os.environ["STAND_IN_NOTES"], "a") as file:  # noqa: PTH123
        file.write(json.dumps(values) + "\n")


class _Kitchen:
    lang = ""

    def get_ep_meta(self):
        return {"lang": self.lang}


class RoboCasaGymEnv:
    def __init__(self, env_name, camera_widths, camera_heights, split, obj_registries):
        note(made=env_name, width=camera_widths, height=camera_heights, split=split, objects=list(obj_registries))
        self.env = _Kitchen()
        self._size = (camera_heights, camera_widths, 3)

    def reset(self, seed=None):
        note(reset=seed)
        self._rng = np.random.default_rng(seed)
        self._step = 0
        self.env.lang = f"close the drawer no. {seed % 10}"
        return self._seen(), {}

    def step(self, action):
        note(step={name: np.asarray(value).tolist() for name, value in action.items()})
        self._step += 1
        return self._seen(), 0.0, self._step == 9, False, {"success": self._step == 7}

    def close(self):
        note(closed=True)

    def _seen(self):
        seen, number = {}, 0
        for name, size in STATE.items():
            seen[name] = np.arange(number, number + size) + self._step
            number += size
        for place, camera in enumerate(CAMERAS):
            seen[f"video.{camera}"] = np.full(self._size, 40 * place + self._step, np.uint8)
        return seen
