"""Makes the two files of this folder from the recordings beside the checkout; run it only when those change.

    python tests/envs/golden/make_golden.py

`panda_omron_bodies.json`: the robot's bodies as robosuite compiled them, one row each: name, parent, position, wxyz
quaternion, mass, centre of mass, quaternion and diagonal of the inertia. `robosuite_traces.npz`: for a few of the
recorded traces all actions, and joints (`qpos`, our order and offset) and observations at every fifth step (`steps`).
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
REPOSITORY = FOLDER.parents[2]
# One of each kind, and the two random ones that stay clear of singular poses.
TRACES = (
    "arm_and_base_random",
    "arm_random_mode-1",
    "arm_rx+1_mode+1",
    "arm_ry-1_mode-1",
    "arm_x+1_mode-1",
    "arm_z-1_mode+1",
    "base_forward_+0.75",
    "base_left_-1.00",
    "base_yaw_+1.00",
    "gripper_close_open",
    "static",
    "torso_+1.0",
)
OBSERVATIONS = ("robot0_base_pos", "robot0_base_quat", "robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
EVERY = 5


def main() -> None:
    sys.path.append(str(REPOSITORY / "benchmarks"))
    from trace_replay import load_traces

    shared = REPOSITORY.parent / "shared"
    table = shared / "facts" / "panda_omron_bodies.jsonl"
    rows = [list(json.loads(line).values()) for line in table.read_text().splitlines()]
    body = ",\n".join(json.dumps(row) for row in rows)
    (FOLDER / "panda_omron_bodies.json").write_text(f"[\n{body}\n]\n")
    recordings = load_traces(shared / "real" / "robosuite_traces" / "panda_omron_traces.npz")
    out = {}
    for name in TRACES:
        recording = recordings[name]
        steps = np.arange(0, len(recording["actions"]) + 1, EVERY)
        out |= {f"{name}/actions": recording["actions"], f"{name}/steps": steps}
        out |= {f"{name}/{key}": recording[key][steps].round(9) for key in ("qpos", *OBSERVATIONS)}
    np.savez_compressed(FOLDER / "robosuite_traces.npz", **out)


if __name__ == "__main__":
    main()
