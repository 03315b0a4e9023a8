"""Demonstration files in the layouts of others, byte layout as their writers make it, small and without their code."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from convert_support import INSTRUCTION, moving_pictures, write_demos
from numpy.typing import NDArray

from robocasa_lerobot import contract

OSC_POSE = {"type": "OSC_POSE", "input_type": "delta", "impedance_mode": "fixed", "gripper": {"type": "GRIP"}}


def composite(*sides: str, **fields: Any) -> dict[str, Any]:
    """The `controller_configs` of one robot in robosuite >= 1.5."""
    return {"type": "BASIC", "body_parts": {"arms": {side: {**OSC_POSE, **fields} for side in sides}}}


def write_robosuite(
    path: Path,
    arms: Sequence[str],
    action_size: int,
    environment: dict[str, Any],
    *,
    lengths: Sequence[int] = (5, 4),
    fingers: int = 2,
    joints: int = 7,
    cameras: Sequence[str] = ("agentview",),
    size: int = 32,
) -> Path:
    """robomimic's layout with the observations `<arm>eef_pos`, ...; `arms` such as `robot0_` or `robot0_left_`."""
    rng = np.random.default_rng(0)
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        kwargs = {"control_freq": 20, **environment}
        data.attrs["env_args"] = json.dumps({"env_name": "TwoArmLift", "type": 1, "env_kwargs": kwargs})
        data.attrs["total"] = sum(lengths)
        for index, length in enumerate(lengths):
            demo = data.create_group(f"demo_{index}")
            demo.attrs["num_samples"] = length
            demo["actions"] = rng.uniform(-1, 1, (length, action_size))
            demo["states"] = rng.normal(size=(length, 20))
            for arm in arms:
                demo[f"obs/{arm}eef_pos"] = rng.normal(size=(length, 3))
                demo[f"obs/{arm}eef_quat"] = rng.normal(size=(length, 4))
                if fingers:
                    demo[f"obs/{arm}gripper_qpos"] = rng.normal(size=(length, fingers))
            robots = sorted({arm.split("_")[0] for arm in arms})
            for robot in robots:
                demo[f"obs/{robot}_joint_pos"] = rng.normal(size=(length, joints * len(arms) // len(robots)))
            for offset, camera in enumerate(cameras):
                demo[f"obs/{camera}_image"] = moving_pictures(length, size, offset)
    return path


def write_robocasa_v01(path: Path, lengths: Sequence[int] = (6, 5, 4, 7), size: int = 128) -> Path:
    """RoboCasa v0.1/v0.2 with pictures: `mask/`, `action_dict/`, `actions_abs`, `next_obs`, `object`, names from 0."""
    write_demos(path, lengths, images=size, env_name="PnPCounterToSink")
    rng = np.random.default_rng(1)
    with h5py.File(path, "a") as file:
        names = []
        for name, demo in file["data"].items():
            if not name.startswith("demo_"):
                continue
            names.append(name.encode())
            length = len(demo["actions"])
            absolute = demo["actions"][:]
            absolute[:, :6] = rng.normal(size=(length, 6))
            demo["actions_abs"] = absolute
            for key, width in (("rel_pos", 3), ("rel_rot_axis_angle", 3), ("rel_rot_6d", 6), ("gripper", 1)):
                demo[f"action_dict/{key}"] = rng.normal(size=(length, width)).astype(np.float32)
            demo["obs/object"] = rng.normal(size=(length, 14))
            demo["next_obs/object"] = rng.normal(size=(length, 14))
            demo["rewards"] = np.zeros(length)
            demo["dones"] = np.eye(1, length, length - 1, dtype=np.int64)[0]
            meta = json.loads(demo.attrs["ep_meta"])
            meta["object_cfgs"] = [{"name": "obj", "info": {"cat": "hot_dog", "split": "A"}}]
            meta["fixture_refs"] = {"sink": "sink_main_group"}
            demo.attrs["ep_meta"] = json.dumps(meta)
        file["mask/2_demos"] = np.array([names[3], names[1]])
        file["mask/train"] = np.array(names[:3])
        file["mask/valid"] = np.array(names[3:])
        file["mask/gone"] = np.array([b"demo_77"])
    return path


def write_mimicgen(path: Path) -> Path:
    """RoboCasa's layout with MimicGen's `src_demo_inds`, `src_demo_labels` and `datagen_info`."""
    write_demos(path, (6, 5), images=32)
    with h5py.File(path, "a") as file:
        for index, name in enumerate(("demo_0", "demo_1")):
            demo = file["data"][name]
            length = len(demo["actions"])
            demo["src_demo_inds"] = np.array([7 + index, 3])
            demo["src_demo_labels"] = np.array([[7 + index]] * 4 + [[3]] * (length - 4))
            demo["datagen_info/eef_pose"] = np.tile(np.eye(4), (length, 1, 1))
            demo["datagen_info/subtask_term_signals/grasp"] = np.zeros(length, np.int64)
            demo["datagen_info"].attrs["env_interface_name"] = "MG_OpenDrawer"
    return path


def write_raw_collection(path: Path) -> Path:
    """RoboCasa's raw human collection: demos from 1, states and actions only."""
    write_demos(path, (5, 6), proprioception=False)
    with h5py.File(path, "a") as file:
        data = file["data"]
        data.move("demo_1", "demo_2")
        data.move("demo_0", "demo_1")
    return path


def write_aloha(path: Path, length: int = 6) -> Path:
    """One episode in a file: `action`, `observations/qpos`, `observations/images/<camera>`, no attributes."""
    rng = np.random.default_rng(2)
    with h5py.File(path, "w") as file:
        file["action"] = rng.normal(size=(length, 14)).astype(np.float32)
        file["observations/qpos"] = rng.normal(size=(length, 14)).astype(np.float32)
        file["observations/qvel"] = rng.normal(size=(length, 14)).astype(np.float32)
        for offset, camera in enumerate(("top", "left_wrist")):
            file[f"observations/images/{camera}"] = moving_pictures(length, 32, offset)
    return path


def write_libero(path: Path) -> Path:
    """LIBERO: robomimic's groups with other names, pictures upside down, the language in a JSON attribute."""
    rng = np.random.default_rng(3)
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["problem_info"] = json.dumps({"problem_name": "living_room", "language_instruction": [INSTRUCTION]})
        for index in range(2):
            demo = data.create_group(f"demo_{index}")
            demo["actions"] = rng.normal(size=(5, 7))
            demo["obs/ee_states"] = rng.normal(size=(5, 6))
            demo["obs/gripper_states"] = rng.normal(size=(5, 2))
            demo["obs/agentview_rgb"] = moving_pictures(5, 32)[:, ::-1]
            demo["states"] = rng.normal(size=(5, 40))
    return path


def stored_actions(path: Path, names: Sequence[str], key: str = "actions") -> NDArray[np.float64]:
    """Actions of episodes of a PandaOmron file, in stored order."""
    with h5py.File(path) as file:
        return np.asarray(contract.hdf5_to_stored(np.concatenate([file[f"data/{name}/{key}"][:] for name in names])))
