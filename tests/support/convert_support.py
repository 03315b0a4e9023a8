"""Small demonstration files in this project's HDF5 layout, made without the environments."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot import contract

MESH = "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets/meshes/tile.stl"
TEXTURE = "textures/checks.png"
INSTRUCTION = "Öffne die Schublade: 引き出しを開ける"
# The names that the converter asks a PandaOmron scene for, in the smallest scene that has something to see.
SCENE = f"""
<mujoco model="kitchen">
  <compiler angle="radian"/>
  <asset>
    <texture name="checks" type="2d" file="{TEXTURE}"/>
    <material name="checks" texture="checks" texrepeat="2 2"/>
    <mesh name="tile" file="{MESH}"/>
  </asset>
  <worldbody>
    <light pos="0 0 4" dir="0.2 0.1 -1" type="directional"/>
    <geom type="plane" size="5 5 0.1" material="checks" group="1"/>
    <geom type="mesh" mesh="tile" pos="1.5 0.2 0.5" rgba="0.2 0.5 0.3 1" group="1"/>
    <geom type="box" size="0.2 0.2 0.2" pos="1.2 -0.4 0.2" rgba="0.8 0.2 0.1 1" group="1"/>
    <geom type="box" size="3 3 3" pos="1.2 -0.4 0.2" rgba="1 1 0 1" group="0"/>
    <body name="mobilebase0_base">
      <joint name="forward" type="slide" axis="1 0 0"/>
      <joint name="yaw" type="hinge" axis="0 0 1"/>
      <geom type="box" size="0.2 0.2 0.1" pos="0 0 0.1" mass="1" group="1"/>
      <site name="mobilebase0_center" pos="0 0 0.7"/>
      <camera name="robot0_agentview_left" pos="-0.5 0.35 1.05" quat="0.556 0.299 -0.377 -0.678" fovy="60"/>
      <camera name="robot0_agentview_right" pos="-0.5 -0.35 1.05" quat="0.678 0.377 -0.299 -0.556" fovy="60"/>
      <body name="robot0_right_hand" pos="0.4 0 0.9" quat="0 1 0 0">
        <joint name="wrist" type="hinge" axis="0.3 0.2 1"/>
        <geom type="sphere" size="0.06" mass="1" rgba="0.9 0.9 0.9 1" group="1"/>
        <camera name="robot0_eye_in_hand" pos="0.05 0 0" quat="0 0.707107 0.707107 0" fovy="75"/>
        <body name="gripper0_right_eef" pos="0 0 0.097">
          <site name="gripper0_right_grip_site"/>
          <body>
            <joint name="gripper0_right_finger_joint1" type="slide" axis="0 1 0"/>
            <geom type="box" size="0.01 0.01 0.02" pos="0 0.02 0" mass="0.1" group="1"/>
          </body>
          <body>
            <joint name="gripper0_right_finger_joint2" type="slide" axis="0 1 0"/>
            <geom type="box" size="0.01 0.01 0.02" pos="0 -0.02 0" mass="0.1" group="1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
_FREE_SCENE = SCENE.replace(f'file="{TEXTURE}"', 'builtin="flat" width="8" height="8"').replace(
    f'<mesh name="tile" file="{MESH}"/>', '<mesh name="tile" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
)


def write_demos(
    path: Path,
    lengths: Sequence[int] = (12, 9),
    *,
    images: int | None = None,
    proprioception: bool = True,
    env_name: str = "OpenDrawer",
    instruction: str | None = INSTRUCTION,
    seed: int = 0,
) -> Path:
    """Write a file with one demo for each length; `images` is the size in pixels of stored pictures, None for none."""
    rng = np.random.default_rng(seed)
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env"] = env_name
        data.attrs["env_args"] = json.dumps({"env_name": env_name, "type": 1, "env_kwargs": {"control_freq": 20}})
        data.attrs["total"] = sum(lengths)
        file.create_dataset(f"assets/{TEXTURE}", data=np.frombuffer(_texture(), np.uint8))
        for index, length in enumerate(lengths):
            _write_demo(data.create_group(f"demo_{index}"), length, rng, images, proprioception, instruction)
    return path


def _write_demo(
    group: h5py.Group,
    length: int,
    rng: np.random.Generator,
    images: int | None,
    proprioception: bool,
    instruction: str | None,
) -> None:
    meta: dict[str, Any] = {"layout_id": 3, "style_id": 5}
    if instruction is not None:
        meta["lang"] = instruction
    group.attrs["ep_meta"] = json.dumps(meta)
    group.attrs["model_file"] = SCENE
    group.attrs["num_samples"] = length
    states = _states(length, rng)
    group["states"] = states
    group["actions"] = _actions(length, rng)
    if proprioception:
        for key, values in _observations(states).items():
            group[f"obs/{key}"] = values
    if images is not None:
        for offset, camera in enumerate(contract.CAMERAS):
            group[f"obs/{camera}_image"] = moving_pictures(length, images, offset)


def moving_pictures(length: int, size: int, offset: int = 0) -> NDArray[np.uint8]:
    """Smooth pictures (T, size, size, 3) uint8 with a bright square on a diagonal path, different at every step."""
    pictures = np.empty((length, size, size, 3), np.uint8)
    across = np.tile(np.linspace(40, 160, size), (size, 1))
    background = np.stack([across.T, across, np.full_like(across, 60)], axis=-1)
    for step in range(length):
        pictures[step] = background
        row = (step * 3 + offset * 5) % (size - 8)
        column = (step * 5) % (size - 8)
        pictures[step, row : row + 8, column : column + 8] = (250, 200 - 40 * offset, 30)
    return pictures


def _actions(length: int, rng: np.random.Generator) -> NDArray[np.float64]:
    actions = rng.uniform(-1, 1, (length, contract.ACTION_SIZE))
    for name in contract.BINARY_PARTS:
        where = contract.ACTION_SLICES_HDF5[name]
        actions[:, where] = np.where(actions[:, where] > 0, 1.0, -1.0)
    actions[0, 0] = -0.0  # to be kept, bit for bit
    return actions


def _states(length: int, rng: np.random.Generator) -> NDArray[np.float64]:
    time = np.arange(length) / contract.CONTROL_HZ
    phase = rng.uniform(0, 6, 5)
    qpos = np.sin(2 * np.pi * time[:, None] * [0.3, 0.5, 0.7, 0.4, 0.4] + phase) * [0.3, 0.6, 1.0, 0.02, 0.02]
    return np.concatenate([time[:, None], qpos, rng.normal(size=(length, 5))], axis=1)


def _observations(states: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Proprioception with robosuite's definitions, through MuJoCo's own functions where the converter has its own."""
    model = mujoco.MjModel.from_xml_string(_FREE_SCENE)
    data = mujoco.MjData(model)
    rows: dict[str, list[NDArray[np.float64]]] = {key: [] for key in contract.STATE_PART_HDF5_KEYS.values()}
    for state in states:
        data.qpos[:] = state[1 : 1 + model.nq]
        mujoco.mj_forward(model, data)
        base, grip = data.site("mobilebase0_center"), data.site("gripper0_right_grip_site")
        rotation = base.xmat.reshape(3, 3)
        hand = data.body("robot0_right_hand").xmat.reshape(3, 3)
        rows["robot0_base_pos"].append(base.xpos.copy())
        rows["robot0_base_quat"].append(mujoco_quaternion(rotation))
        rows["robot0_base_to_eef_pos"].append(rotation.T @ (grip.xpos - base.xpos))
        rows["robot0_base_to_eef_quat"].append(mujoco_quaternion(rotation.T @ hand))
        rows["robot0_gripper_qpos"].append(data.qpos[3:5].copy())
    return {key: np.stack(values) for key, values in rows.items()}


def mujoco_quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quaternion xyzw with w >= 0 of a rotation matrix (3, 3)."""
    wxyz = np.empty(4)
    mujoco.mju_mat2Quat(wxyz, np.ascontiguousarray(rotation).ravel())
    return np.roll(wxyz if wxyz[0] >= 0 else -wxyz, -1)


def _texture() -> bytes:
    checks = ((np.indices((64, 64)) // 16).sum(0) % 2 * 160 + 60).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(np.stack([checks, checks, checks // 2 + 60], -1)).save(stream, "PNG")
    return stream.getvalue()


def tree_hashes(root: Path) -> dict[str, str]:
    """SHA-256 of every file under a folder."""
    return {
        str(file.relative_to(root)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(root.rglob("*"))
        if file.is_file()
    }


def leftovers(out: Path) -> list[str]:
    """What a conversion left beside its output."""
    return sorted(path.name for path in out.parent.glob(f"{out.name}*"))
